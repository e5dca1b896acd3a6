//! `rayburst bench`: how fast, beside peers in the same process.

mod frame;
mod pipeline;
mod plot;
mod update;

use std::{fs, path::Path};

use rayburst::{image::write_png, scene::Pose};
use rayburst_bench::{
    BuildBench, EngineSpec, FlatMesh, Mode, RayBench, RaySetKind, Row, bench_builds, bench_rays,
    geometric_means, row::GEOMETRIC_MEAN,
};

use crate::{
    args::bench::{BenchArgs, BenchBuildArgs, BenchCommonArgs, BenchKind, BenchRaysArgs},
    camera,
    error::{CliError, Result},
    load::{self, Loaded},
    output::{self, Format},
    terminal,
};

/// Measures.
pub(crate) fn run(args: &BenchArgs) -> Result<()> {
    match &args.kind {
        BenchKind::Rays(args) => rays(args),
        BenchKind::Build(args) => build(args),
        BenchKind::Update(args) => update::run(args),
        BenchKind::Pipeline(args) => pipeline::run(args),
        BenchKind::Frame(args) => frame::run(args),
    }
}

fn rays(args: &BenchRaysArgs) -> Result<()> {
    let common = &args.common;
    let options = RayBench {
        threads: common.threads.unwrap_or(1),
        repeats: common.repeat,
        seconds: f64::from(args.seconds),
        size: args.resolution,
        embree: common.peer.as_ref().map(|p| p.0.clone()),
        engines: engines(args)?,
        sets: args.sets.clone().map_or_else(|| RaySetKind::ALL.map(|(_, k)| k).to_vec(), |s| s.0),
    };
    each_scene(common, |name, loaded, mesh, report| {
        let size = (options.size, options.size);
        let pose = Pose::rest(&loaded.scene);
        let camera = camera::choose(&loaded.scene, &pose, &mesh.bounds(), size, &args.camera)?;
        Ok(bench_rays(name, mesh, &camera, &options, report)?)
    })
}

fn build(args: &BenchBuildArgs) -> Result<()> {
    let common = &args.common;
    let options = BuildBench {
        threads: common.threads.unwrap_or(1),
        repeats: common.repeat,
        seconds: f64::from(args.seconds),
        embree: common.peer.as_ref().map(|p| p.0.clone()),
        presets: common.presets().to_vec(),
    };
    each_scene(common, |name, _, mesh, report| Ok(bench_builds(name, mesh, &options, report)?))
}

/// Measures scene by scene, prints rows as they come, then writes the files that are asked for.
fn each_scene(
    args: &BenchCommonArgs,
    measure: impl Fn(&str, &Loaded, &FlatMesh, &mut dyn FnMut(&Row)) -> Result<Vec<Row>>,
) -> Result<()> {
    for path in [&args.json, &args.plot].into_iter().flatten() {
        output::check_writable(path)?;
    }
    if let Some(path) = args.plot.as_ref().filter(|path| !is_png(path)) {
        return Err(CliError::usage(format!("plots are .png, not {}", path.display())));
    }
    let mut all = Vec::new();
    for name in &args.scenes {
        let loaded = load::load(name, &args.instant)?;
        let mesh = FlatMesh::new(&loaded.scene).ok_or_else(|| {
            CliError::failed(format!("{name} has too many vertices for one mesh"))
        })?;
        let mut broken = Ok(());
        let mut report = |row: &Row| {
            if broken.is_ok() {
                broken = terminal::result(line(row));
            }
        };
        all.extend(measure(name, &loaded, &mesh, &mut report)?);
        broken?;
    }
    let means = geometric_means(&all);
    for mean in &means {
        terminal::result(line(mean))?;
    }
    all.extend(means);
    if let Some(path) = &args.json {
        write_json(path, &all)?;
    }
    if let Some(path) = &args.plot {
        write_png(path, &plot::draw(&all)?)?;
        terminal::say(format!("{}: the figures as bars", path.display()));
    }
    Ok(())
}

fn is_png(path: &Path) -> bool {
    Format::of(path).is_ok_and(|format| format == Format::Png)
}

/// Which engines are measured; Embree's only with its library.
fn engines(args: &BenchRaysArgs) -> Result<Vec<EngineSpec>> {
    let has_library = args.common.peer.is_some();
    let modes = args.mode.as_ref().map_or(&Mode::USUAL[..], |list| &list.0);
    let mut usual = EngineSpec::usual(args.common.presets(), modes);
    let Some(names) = &args.engines else {
        usual.retain(|spec| has_library || !spec.needs_library());
        return Ok(usual);
    };
    let mut engines = Vec::new();
    for name in &names.0 {
        for spec in EngineSpec::named(name, &usual) {
            if spec.needs_library() && !has_library {
                return Err(CliError::usage(format!(
                    "{spec} needs Embree's library: --peer embree=LIBRARY"
                )));
            }
            if !engines.contains(&spec) {
                engines.push(spec);
            }
        }
    }
    // This engine first: the others' hits are compared with its.
    engines.sort_by_key(|spec| !matches!(spec, EngineSpec::Rayburst(..)));
    Ok(engines)
}

/// A scene as it is shown: files without their folder.
fn short_name(scene: &str) -> &str {
    let is_file = [".gltf", ".glb", ".obj", ".ply"].iter().any(|end| scene.ends_with(end));
    let stem = Path::new(scene).file_stem().and_then(|stem| stem.to_str());
    stem.filter(|_| is_file).unwrap_or(scene)
}

fn line(row: &Row) -> String {
    let what = row.ray_set.or(row.builder).unwrap_or_default();
    let engine = row.engine.as_deref().unwrap_or_default();
    let mut text = format!("{:16} {what:17} {engine:26} ", short_name(&row.scene));
    let (least, most) = (row.min, row.max);
    if row.scene == GEOMETRIC_MEAN {
        let of = row.ratio_of.unwrap_or_default();
        text += &format!("{:8.2} of the peer's {of} ({least:.2} to {most:.2})", row.value);
    } else {
        text += &format!("{:8.2} {} ({least:.2} to {most:.2})", row.value, row.unit);
    }
    if let (Some(ratio), Some(peer)) = (row.ratio, &row.peer) {
        text += &format!("  {ratio:.2} of {peer}");
    }
    if let Some(ratio) = row.single_ratio.filter(|_| engine.ends_with(":call")) {
        text += &format!("  {ratio:.2} of the best single-ray peer");
    }
    if let (Some(nodes), Some(leaves)) = (row.nodes, row.leaves) {
        text += &format!("  {nodes:.1} + {leaves:.1} visits");
    }
    if let Some(share) = row.packet_share.filter(|&share| share > 0.0) {
        text += &format!(", {:.0} % in packets", 100.0 * share);
    }
    if let (Some(cost), Some(depth)) = (row.sah_cost, row.depth) {
        text += &format!("  SAH cost {cost:.1}, depth {depth}");
    }
    if row.best_peer {
        text += "  * best peer";
    }
    text
}

fn write_json(path: &Path, rows: &[Row]) -> Result<()> {
    let text = serde_json::to_string_pretty(rows)
        .map_err(|e| CliError::failed(format!("cannot write JSON: {e}")))?;
    rayburst::image::atomic_write(path, |w| std::io::Write::write_all(w, text.as_bytes()))?;
    let size = fs::metadata(path).map_or(0, |m| m.len());
    terminal::say(format!("{}: {} rows, {size} bytes", path.display(), rows.len()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_tell_what_was_measured() {
        let row = Row {
            bench: "rays",
            scene: "scenes/sponza.gltf".into(),
            ray_set: Some("ao"),
            engine: Some("rayburst:fast:call".into()),
            value: 6.0,
            unit: "Mrays/s",
            ratio: Some(1.5),
            peer: Some("embree:high:16".into()),
            single_ratio: Some(2.0),
            min: 5.0,
            max: 7.0,
            ..Row::default()
        };
        let text = line(&row);
        for part in
            ["sponza  ", "6.00 Mrays/s", "1.50 of embree:high:16", "2.00 of the best single"]
        {
            assert!(text.contains(part), "{part}: {text}");
        }
        let peer = Row { best_peer: true, ratio: None, single_ratio: None, ..row.clone() };
        assert!(line(&peer).ends_with("* best peer"));
        let mean = Row { scene: GEOMETRIC_MEAN.into(), ratio_of: Some("Mrays/s"), ..peer };
        assert!(line(&mean).contains("6.00 of the peer's Mrays/s (5.00 to 7.00)"));
        assert_eq!(short_name("a/b.ply"), "b");
        assert_eq!(short_name("dof:aperture=0.5"), "dof:aperture=0.5");
    }
}
