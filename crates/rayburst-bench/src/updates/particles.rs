//! Boxes that all fly their own way: what a frame of them takes, in every way to have them in a
//! structure.

use std::{sync::Arc, time::Instant};

use glam::{Affine3A, Vec3};
use rayburst_accel::{Blas, BuildOptions, Geometry, Instance, ProceduralBoxes, TriangleMesh};
use rayburst_math::Aabb;
use rayburst_scene::shapes::Shape;

use super::{
    Bench, Subject, UpdateCase, instances,
    motion::Swarm,
    presets,
    timing::{Contender, Step},
};
use crate::{BenchError, FlatMesh, Row};

/// How many, unless scaled.
const COUNTS: [usize; 2] = [100_000, 1_000_000];
/// Half the edge of a box.
const SIZE: f32 = 0.15;
/// Frames that are repeated.
const FRAMES: usize = 2;
/// Meshes of more boxes take too much memory.
const MOST_IN_A_MESH: usize = 250_000;

/// A way to have boxes in a structure.
struct Way {
    /// In the name of the scene.
    name: &'static str,
    measure: fn(&Bench<'_>, &Swarm, Subject) -> Result<Vec<Row>, BenchError>,
    /// How many boxes, at most.
    most: usize,
}

/// All ways: whatever else can hold boxes is added here.
const WAYS: [Way; 3] = [
    Way { name: "instances", measure: as_instances, most: usize::MAX },
    Way { name: "procedural", measure: as_procedural, most: usize::MAX },
    Way { name: "mesh", measure: as_a_mesh, most: MOST_IN_A_MESH },
];

pub(super) fn run(bench: &Bench<'_>) -> Result<Vec<Row>, BenchError> {
    let mut rows = Vec::new();
    for count in COUNTS.map(|count| bench.options.scaled(count)) {
        let swarm = Swarm::new(count);
        for way in WAYS.iter().filter(|way| count <= way.most) {
            let scene = format!("boxes:{}", way.name);
            let case = UpdateCase::Particles;
            let subject = Subject { case, scene, triangles: 0, instances: count };
            rows.extend((way.measure)(bench, &swarm, subject)?);
        }
    }
    Ok(rows)
}

fn one_box() -> FlatMesh {
    let mut shape = Shape::default();
    shape.add_box(Vec3::splat(-SIZE), Vec3::splat(SIZE));
    let primitive = shape.into_primitive(0);
    FlatMesh { positions: primitive.positions, indices: primitive.indices, light: None }
}

/// Each box is an instance of one.
fn as_instances(
    bench: &Bench<'_>,
    swarm: &Swarm,
    subject: Subject,
) -> Result<Vec<Row>, BenchError> {
    let mesh = one_box();
    let triangles = [TriangleMesh::new(&mesh.positions, &mesh.indices)];
    let blas = Arc::new(Blas::build(&triangles, &BuildOptions::default())?);
    let place = |at: Vec3| Instance::new(0, Affine3A::from_translation(at));
    let frames: Vec<Vec<_>> = (0..FRAMES).map(|i| swarm.at(i).map(place).collect()).collect();
    let mut contenders = instances::contenders(bench, &blas, &frames)?;
    let subject = Subject { triangles: mesh.indices.len(), ..subject };
    Ok(bench.rates(&subject, "Minst/s", &mut contenders)?.0)
}

/// Each box is a procedural primitive.
fn as_procedural(
    bench: &Bench<'_>,
    swarm: &Swarm,
    subject: Subject,
) -> Result<Vec<Row>, BenchError> {
    let half = Vec3::splat(SIZE);
    let around = |at: Vec3| Aabb { lower: at - half, upper: at + half };
    let frames: Vec<Vec<_>> = (0..FRAMES).map(|i| swarm.at(i).map(around).collect()).collect();
    let rebuild = |(name, options): (&str, BuildOptions<'static>)| {
        let frames = &frames;
        let step = move |frame: usize| {
            let begin = Instant::now();
            let boxes = Geometry::from(ProceduralBoxes::new(&frames[frame % FRAMES]));
            let blas = bench.pool.install(|| Blas::of_geometries(&[boxes], &options))?;
            let seconds = begin.elapsed().as_secs_f64();
            Ok(Step { seconds, sah_cost: Some(blas.stats().sah_cost) })
        };
        Contender { policy: format!("rebuild:{name}"), step: Box::new(step) }
    };
    let mut contenders = presets().map(rebuild);
    Ok(bench.rates(&subject, "Minst/s", &mut contenders)?.0)
}

/// All boxes are one mesh.
fn as_a_mesh(bench: &Bench<'_>, swarm: &Swarm, subject: Subject) -> Result<Vec<Row>, BenchError> {
    let one = one_box();
    let corners = one.positions.len() as u32;
    let indices: Vec<[u32; 3]> = (0..subject.instances as u32)
        .flat_map(|i| one.indices.iter().map(move |t| t.map(|v| v + i * corners)))
        .collect();
    let frame = |i: usize| -> Vec<Vec3> {
        swarm.at(i).flat_map(|at| one.positions.iter().map(move |&p| p + at)).collect()
    };
    let frames: Vec<_> = (0..FRAMES).map(frame).collect();
    let at = |frame: usize| [TriangleMesh::new(&frames[frame % FRAMES], &indices)];
    let [(name, options), _] = presets();
    let mut kept = bench.pool.install(|| Blas::build(&at(0), &options))?;
    let refit = |frame: usize| {
        let begin = Instant::now();
        let report = bench.pool.install(|| kept.refit(&at(frame)))?;
        let seconds = begin.elapsed().as_secs_f64();
        Ok(Step { seconds, sah_cost: Some(report.sah_after) })
    };
    let rebuild = |frame: usize| {
        let begin = Instant::now();
        let blas = bench.pool.install(|| Blas::build(&at(frame), &options))?;
        let seconds = begin.elapsed().as_secs_f64();
        Ok(Step { seconds, sah_cost: Some(blas.stats().sah_cost) })
    };
    let mut contenders = [
        Contender { policy: format!("refit:{name}"), step: Box::new(refit) },
        Contender { policy: format!("rebuild:{name}"), step: Box::new(rebuild) },
    ];
    let subject = Subject { triangles: indices.len(), ..subject };
    // Boxes a second.
    Ok(bench.rates(&subject, "Minst/s", &mut contenders)?.0)
}
