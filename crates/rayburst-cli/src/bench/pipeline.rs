//! `rayburst bench pipeline`.

use rayburst::scene::Pose;
use rayburst_bench::{FlatMesh, PipelineBench, Row, bench_pipelines};

use super::{short_name, write_json};
use crate::{
    args::bench::BenchPipelineArgs,
    camera,
    error::{CliError, Result},
    load, output, terminal,
};

/// Measures, prints rows, then writes the file that is asked for.
pub(super) fn run(args: &BenchPipelineArgs) -> Result<()> {
    if let Some(path) = &args.json {
        output::check_writable(path)?;
    }
    let options = PipelineBench {
        threads: args.threads.unwrap_or(1),
        repeats: args.repeat,
        seconds: f64::from(args.seconds),
        size: args.resolution,
    };
    let mut all = Vec::new();
    for name in &args.scenes {
        let loaded = load::load(name, &args.instant)?;
        let mesh = FlatMesh::new(&loaded.scene).ok_or_else(|| {
            CliError::failed(format!("{name} has too many vertices for one mesh"))
        })?;
        let (size, pose) = ((args.resolution, args.resolution), Pose::rest(&loaded.scene));
        let camera = camera::choose(&loaded.scene, &pose, &mesh.bounds(), size, &args.camera)?;
        let mut broken = Ok(());
        all.extend(bench_pipelines(name, &mesh, &camera, &options, &mut |row| {
            if broken.is_ok() {
                broken = terminal::result(line(row));
            }
        })?);
        broken?;
    }
    match &args.json {
        Some(path) => write_json(path, &all),
        None => Ok(()),
    }
}

fn line(row: &Row) -> String {
    let (form, least, most) = (row.engine.as_deref().unwrap_or_default(), row.min, row.max);
    let mut text = format!(
        "{:16} {form:14} {:8.2} {} ({least:.2} to {most:.2})",
        short_name(&row.scene),
        row.value,
        row.unit
    );
    if let (Some(ratio), Some(peer)) = (row.ratio, &row.peer) {
        text += &format!("  {ratio:.2} of {peer}");
    }
    text
}
