//! `rayburst bench frame`.

use std::sync::Arc;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayburst::{
    accel::BuildOptions,
    render::realtime::{FrameMode, FrameSettings},
    scene::Flattener,
};
use rayburst_bench::{FrameBench, Row, bench_frames};

use super::{short_name, write_json};
use crate::{args::bench::BenchFrameArgs, camera, error::Result, light, load, output, terminal};

/// Measures, prints a table for each mode and scale, then writes the file that is asked for.
pub(super) fn run(args: &BenchFrameArgs) -> Result<()> {
    if let Some(path) = &args.json {
        output::check_writable(path)?;
    }
    let mut settings = FrameSettings { size: args.size, ..FrameSettings::default() };
    args.frame.apply(&mut settings);
    let every = || FrameMode::ALL.map(|(_, mode)| mode).to_vec();
    let options = FrameBench {
        threads: args.threads.unwrap_or_else(cores),
        repeats: args.repeat,
        frames: args.frames,
        modes: args.modes.clone().map_or_else(every, |list| list.0),
        render_scales: args.render_scales.0.clone(),
        settings,
    };
    let mut all = Vec::new();
    for name in &args.scenes {
        let rows = measure(name, args, &options)?;
        for group in rows.chunk_by(is_of_one_table) {
            terminal::result(table(group, args.size))?;
        }
        all.extend(rows);
    }
    match &args.json {
        Some(path) => write_json(path, &all),
        None => Ok(()),
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn measure(name: &str, args: &BenchFrameArgs, options: &FrameBench) -> Result<Vec<Row>> {
    let mut loaded = load::load(name, &args.instant)?;
    light::apply(&mut loaded.scene, &args.light)?;
    let scene = &loaded.scene;
    let animations = load::animations(scene, &args.instant)?;
    let pose = load::pose(scene, &animations, args.instant.time);
    let flat = Arc::new(Flattener::new(scene, BuildOptions::default()).at(&pose)?);
    let camera = camera::choose(scene, &pose, &flat.bounds, args.size, &args.camera)?;
    let total = options.total_frames() as u64;
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
    if let Ok(style) =
        ProgressStyle::with_template("{prefix} [{bar:30}] {pos} of {len}, {eta} left")
    {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_prefix(short_name(name).to_owned());
    let rows = bench_frames(name, &flat, &camera, options, &mut || bar.inc(1));
    bar.finish_and_clear();
    Ok(rows?)
}

/// Whether rows are of the same mode and scale.
fn is_of_one_table(a: &Row, b: &Row) -> bool {
    (a.mode, a.render_scale) == (b.mode, b.render_scale)
}

/// The passes of one mode and scale, one a line, the whole frame last.
fn table(rows: &[Row], (width, height): (u32, u32)) -> String {
    let Some(first) = rows.first() else { return String::new() };
    let threads = if first.threads == 1 { "thread" } else { "threads" };
    let mut text = format!(
        "{}, {width}x{height}, {}, render scale {}, {}{} {threads}\n  {:18} {:>9} {:>9} {:>9} {:>11}",
        short_name(&first.scene),
        first.mode.unwrap_or_default(),
        first.render_scale.unwrap_or(1.0),
        first.denoiser.filter(|name| *name != "none").map_or(String::new(), |d| format!("{d}, ")),
        first.threads,
        "pass",
        "median",
        "least",
        "most",
        "rays/pixel",
    );
    for row in rows {
        let name = if row.unit == "ms" { row.pass.unwrap_or_default() } else { "" };
        text += &format!(
            "\n  {name:18} {:9.2} {:9.2} {:9.2} {:11.3} {}",
            row.value,
            row.min,
            row.max,
            row.rays_per_pixel.unwrap_or(0.0),
            row.unit,
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_aligned() {
        let row = |pass, value, unit| Row {
            bench: "frame",
            scene: "a/sponza.gltf".into(),
            mode: Some("hybrid"),
            render_scale: Some(0.5),
            pass: Some(pass),
            rays_per_pixel: Some(1.25),
            threads: 2,
            value,
            unit,
            min: 0.5 * value,
            max: 2.0 * value,
            ..Row::default()
        };
        let rows = [
            row("ambient_occlusion", 3.0, "ms"),
            row("frame", 12.5, "ms"),
            row("frame", 80.0, "fps"),
        ];
        let text = table(&rows, (640, 360));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "sponza, 640x360, hybrid, render scale 0.5, 2 threads");
        assert_eq!(lines.len(), 5);
        assert!(
            lines[2].contains("ambient_occlusion       3.00      1.50      6.00       1.250 ms")
        );
        let column = |line: &str, part: &str| line.find(part).map(|at| at + part.len());
        assert_eq!(column(lines[3], "12.50"), column(lines[1], "median"));
        assert_eq!(column(lines[4], "80.00"), column(lines[1], "median"));
    }
}
