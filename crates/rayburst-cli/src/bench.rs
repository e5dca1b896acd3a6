//! `rayburst bench rays`: Mrays/s on every ray set, beside peers.

use std::{fs, path::Path};

use rayburst::scene::Pose;
use rayburst_bench::{FlatMesh, RayBench, Row, bench_rays};

use crate::{
    args::verbs::{BenchArgs, BenchKind, BenchRaysArgs},
    camera,
    error::{CliError, Result},
    load, output, terminal,
};

/// Measures.
pub(crate) fn run(args: &BenchArgs) -> Result<()> {
    match &args.kind {
        BenchKind::Rays(args) => rays(args),
    }
}

fn rays(args: &BenchRaysArgs) -> Result<()> {
    if let Some(path) = &args.json {
        output::check_writable(path)?;
    }
    let options = RayBench {
        threads: args.threads.unwrap_or(1),
        repeats: args.repeat,
        seconds: f64::from(args.seconds),
        size: args.resolution,
        embree: args.peer.as_ref().map(|p| p.0.clone()),
        sets: args.sets.clone().map_or(RayBench::default().sets, |s| s.0),
    };
    let mut all = Vec::new();
    for name in &args.scenes {
        let loaded = load::load(name, &args.instant)?;
        let mesh = FlatMesh::new(&loaded.scene).ok_or_else(|| {
            CliError::failed(format!("{name} has too many vertices for one mesh"))
        })?;
        let size = (options.size, options.size);
        let pose = Pose::rest(&loaded.scene);
        let camera = camera::choose(&loaded.scene, &pose, &mesh.bounds(), size, &args.camera)?;
        let mut broken = Ok(());
        let mut report = |row: &Row| {
            if broken.is_ok() {
                broken = terminal::result(line(row));
            }
        };
        all.extend(bench_rays(name, &mesh, &camera, &options, &mut report)?);
        broken?;
    }
    match &args.json {
        Some(path) => write_json(path, &all),
        None => Ok(()),
    }
}

fn line(row: &Row) -> String {
    let ratio = row.ratio.map_or(String::new(), |r| format!("  {r:.2} of the best peer"));
    format!(
        "{:16} {:17} {:28} {:8.2} {} ({:.2} to {:.2}){ratio}",
        row.scene,
        row.ray_set.unwrap_or_default(),
        row.engine.as_deref().unwrap_or_default(),
        row.value,
        row.unit,
        row.min,
        row.max,
    )
}

fn write_json(path: &Path, rows: &[Row]) -> Result<()> {
    let text = serde_json::to_string_pretty(rows)
        .map_err(|e| CliError::failed(format!("cannot write JSON: {e}")))?;
    rayburst::image::atomic_write(path, |w| std::io::Write::write_all(w, text.as_bytes()))?;
    let size = fs::metadata(path).map_or(0, |m| m.len());
    terminal::say(format!("{}: {} rows, {size} bytes", path.display(), rows.len()));
    Ok(())
}
