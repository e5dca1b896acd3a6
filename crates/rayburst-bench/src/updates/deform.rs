//! A mesh in waves: refits of a tree beside builds.

use std::time::Instant;

use rayburst_accel::{Blas, TriangleMesh};

use super::{
    Bench, Subject, UpdateCase, motion, presets,
    timing::{Contender, Step},
};
use crate::{BenchError, FlatMesh, Row};

const TRIANGLES: usize = 1_000_000;
/// Phases of the waves, one after another.
const PHASES: usize = 4;

pub(super) fn run(
    bench: &Bench<'_>,
    given: Option<(&str, &FlatMesh)>,
) -> Result<Vec<Row>, BenchError> {
    let own;
    let (scene, mesh) = match given {
        Some(given) => given,
        None => {
            own = motion::sheet(bench.options.scaled(TRIANGLES));
            ("waves", &own)
        }
    };
    let phases: Vec<_> = (0..PHASES).map(|i| motion::waved(mesh, 0.7 * i as f32)).collect();
    let at = |frame: usize| [TriangleMesh::new(&phases[frame % PHASES], &mesh.indices)];
    let mut contenders = Vec::new();
    for (name, options) in presets() {
        let mut kept = bench.pool.install(|| Blas::build(&at(0), &options))?;
        let refit = move |frame| {
            let begin = Instant::now();
            let report = bench.pool.install(|| kept.refit(&at(frame)))?;
            let seconds = begin.elapsed().as_secs_f64();
            Ok(Step { seconds, sah_cost: Some(report.sah_after) })
        };
        let build = move |frame| {
            let begin = Instant::now();
            let blas = bench.pool.install(|| Blas::build(&at(frame), &options))?;
            let seconds = begin.elapsed().as_secs_f64();
            Ok(Step { seconds, sah_cost: Some(blas.stats().sah_cost) })
        };
        let refit = Contender { policy: format!("refit:{name}"), step: Box::new(refit) };
        let build = Contender { policy: format!("rebuild:{name}"), step: Box::new(build) };
        contenders.extend([refit, build]);
    }
    let subject = Subject {
        case: UpdateCase::Deform,
        scene: scene.to_owned(),
        triangles: mesh.indices.len(),
        instances: 0,
    };
    let (mut rows, measured) = bench.rates(&subject, "Mtri/s", &mut contenders)?;
    let named = |index: usize| (contenders[index].policy.as_str(), &measured[index]);
    // Each tree's refit beside its own build, and the default one's beside the fastest build.
    for (refit, build) in [(0, 1), (2, 1), (2, 3)] {
        rows.push(bench.faster(&subject, named(refit), named(build)));
    }
    Ok(rows)
}
