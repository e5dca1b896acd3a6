//! Many instances that move: the structure over them updated, and built anew.

use std::{sync::Arc, time::Instant};

use glam::{Affine3A, Quat, Vec3};
use rayburst_accel::{Blas, BuildOptions, Instance, Tlas, TriangleMesh};
use rayburst_scene::shapes;

use super::{
    Bench, Subject, UpdateCase,
    motion::Swarm,
    presets,
    timing::{Contender, Step},
};
use crate::{BenchError, Row};

const INSTANCES: usize = 100_000;
/// Frames that are repeated.
const FRAMES: usize = 4;

pub(super) fn run(bench: &Bench<'_>) -> Result<Vec<Row>, BenchError> {
    let ball = shapes::sphere(Vec3::ZERO, 0.3, 3).into_primitive(0);
    let triangles = [TriangleMesh::new(&ball.positions, &ball.indices)];
    let blas = Arc::new(Blas::build(&triangles, &BuildOptions::default())?);
    let swarm = Swarm::new(bench.options.scaled(INSTANCES));
    let turned = |(index, place): (usize, Vec3), frame: usize| {
        let axis = Vec3::new(1.0, index as f32 * 0.37, 2.0).normalize();
        let turn = Quat::from_axis_angle(axis, 0.1 * frame as f32 + index as f32);
        let size = Vec3::new(1.0, 0.5 + 0.5 * (index as f32).sin().abs(), 1.0);
        Instance::new(0, Affine3A::from_scale_rotation_translation(size, turn, place))
    };
    let frame = |frame: usize| -> Vec<Instance> {
        swarm.at(frame).enumerate().map(|instance| turned(instance, frame)).collect()
    };
    let frames: Vec<_> = (0..FRAMES).map(frame).collect();
    let subject = Subject {
        case: UpdateCase::Instances,
        scene: "balls".into(),
        triangles: ball.indices.len(),
        instances: frames[0].len(),
    };
    let mut contenders = contenders(bench, &blas, &frames)?;
    let (mut rows, measured) = bench.rates(&subject, "Minst/s", &mut contenders)?;
    let named = |index: usize| (contenders[index].policy.as_str(), &measured[index]);
    for (update, build) in [(0, 1), (2, 3)] {
        rows.push(bench.faster(&subject, named(update), named(build)));
    }
    Ok(rows)
}

/// The update and the build of the structure over some frames' instances of one BLAS, for each preset.
pub(super) fn contenders<'a>(
    bench: &'a Bench<'_>,
    blas: &'a Arc<Blas>,
    frames: &'a [Vec<Instance>],
) -> Result<Vec<Contender<'a>>, BenchError> {
    let mut contenders = Vec::new();
    for (name, options) in presets() {
        let build = move |frame: usize| {
            let instances = &frames[frame % frames.len()];
            bench.pool.install(|| Tlas::build(vec![blas.clone()], instances, &options))
        };
        let mut kept = build(0)?;
        let before = blas.stats();
        let update = move |frame: usize| {
            let instances = &frames[frame % frames.len()];
            let begin = Instant::now();
            let report = bench.pool.install(|| kept.update(instances))?;
            let seconds = begin.elapsed().as_secs_f64();
            // Transforms alone move: the mesh's structure is the same piece of memory.
            let is_same = kept.blases().iter().all(|own| Arc::ptr_eq(own, blas));
            assert!(is_same && blas.stats() == before, "an update touched a BLAS");
            Ok(Step { seconds, sah_cost: Some(report.sah_after) })
        };
        let rebuild = move |frame: usize| {
            let begin = Instant::now();
            let tlas = build(frame)?;
            let seconds = begin.elapsed().as_secs_f64();
            Ok(Step { seconds, sah_cost: Some(tlas.stats().sah_cost) })
        };
        contenders.push(Contender { policy: format!("update:{name}"), step: Box::new(update) });
        contenders.push(Contender { policy: format!("rebuild:{name}"), step: Box::new(rebuild) });
    }
    Ok(contenders)
}
