//! `rayburst bench update`.

use rayburst_bench::{FlatMesh, Row, UpdateBench, UpdateCase, bench_updates};

use super::{short_name, write_json};
use crate::{
    args::bench::BenchUpdateArgs,
    error::{CliError, Result},
    load, output, terminal,
};

/// Measures, prints rows as they come, then writes the file that is asked for.
pub(super) fn run(args: &BenchUpdateArgs) -> Result<()> {
    if let Some(path) = &args.json {
        output::check_writable(path)?;
    }
    let every = || UpdateCase::ALL.map(|(_, case)| case).to_vec();
    let options = UpdateBench {
        threads: args.threads.unwrap_or(1),
        repeats: args.repeat,
        seconds: f64::from(args.seconds),
        cases: args.cases.clone().map_or_else(every, |list| list.0),
        scale: args.scale,
    };
    let mut all = Vec::new();
    if args.scenes.is_empty() {
        all.extend(measure(None, &options)?);
    }
    for (index, name) in args.scenes.iter().enumerate() {
        let loaded = load::load(name, &args.instant)?;
        let mesh = FlatMesh::new(&loaded.scene).ok_or_else(|| {
            CliError::failed(format!("{name} has too many vertices for one mesh"))
        })?;
        if mesh.indices.is_empty() {
            return Err(CliError::failed(format!("{name} has no triangles to move")));
        }
        // What is not about meshes is measured once.
        let of_meshes = |case: &UpdateCase| matches!(case, UpdateCase::Deform | UpdateCase::Twist);
        let cases = options.cases.iter().filter(|case| index == 0 || of_meshes(case));
        let options = UpdateBench { cases: cases.copied().collect(), ..options.clone() };
        all.extend(measure(Some((name, &mesh)), &options)?);
    }
    match &args.json {
        Some(path) => write_json(path, &all),
        None => Ok(()),
    }
}

fn measure(mesh: Option<(&str, &FlatMesh)>, options: &UpdateBench) -> Result<Vec<Row>> {
    let mut broken = Ok(());
    let rows = bench_updates(mesh, options, &mut |row| {
        if broken.is_ok() {
            broken = terminal::result(line(row));
        }
    })?;
    broken.map(|()| rows)
}

fn line(row: &Row) -> String {
    let (least, most) = (row.min, row.max);
    let mut text = format!(
        "{:10} {:16} {:17} {:8.2} ",
        row.case.unwrap_or_default(),
        short_name(&row.scene),
        row.policy.as_deref().unwrap_or_default(),
        row.value
    );
    match (row.ratio_of, &row.peer) {
        (Some("speed"), Some(peer)) => {
            text += &format!("times as fast as {peer} ({least:.2} to {most:.2})");
        }
        (Some(of), Some(peer)) => {
            text += &format!("of the {of} of {peer} ({least:.2} to {most:.2})");
        }
        _ => text += &format!("{} ({least:.2} to {most:.2})", row.unit),
    }
    if row.instances > 0 {
        text += &format!("  {} instances", row.instances);
    }
    if let Some(cost) = row.sah_cost {
        text += &format!("  SAH cost {cost:.1}");
    }
    if let (Some(frames), Some(rebuilds), Some(longest), None) =
        (row.frames, row.rebuilds, row.longest, row.ratio_of)
    {
        text += &format!(" a frame, {longest:.2} at most; {rebuilds} builds in {frames} frames");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_tell_what_was_measured() {
        let row = Row {
            bench: "update",
            case: Some("twist"),
            scene: "a/dragon.ply".into(),
            policy: Some("growth:1.3".into()),
            value: 1.5,
            unit: "ms",
            min: 1.0,
            max: 2.0,
            frames: Some(40),
            rebuilds: Some(3),
            longest: Some(9.0),
            ..Row::default()
        };
        let text = line(&row);
        for part in ["twist", "dragon ", "growth:1.3", "1.50 ms", "9.00 at most; 3 builds in 40"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let peer = Some("rebuild".to_owned());
        let ratio = Row { unit: "ratio", ratio_of: Some("time"), peer, ..row };
        assert!(line(&ratio).ends_with("1.50 of the time of rebuild (1.00 to 2.00)"));
        let faster = Row { ratio_of: Some("speed"), ..ratio };
        assert!(line(&faster).contains("1.50 times as fast as rebuild"));
    }
}
