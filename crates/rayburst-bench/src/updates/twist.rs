//! A mesh that twists further every frame: what policies save, and what they cost rays.

use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, Counters, MovingBlas, TraceOptions, TriangleMesh, UpdateAction,
    UpdatePolicy,
};
use rayburst_math::{Hit, Ray, hash::Rng};

use super::{Bench, Subject, UpdateCase, motion, timing::median};
use crate::{BenchError, FlatMesh, Row};

const TRIANGLES: usize = 200_000;
const FRAMES: usize = 40;
/// The angle between bottom and top in the last frame: one and a half turns.
const ANGLE: f32 = 3.0 * std::f32::consts::PI;
/// Rays of a frame.
const RAYS: usize = 4096;

/// A policy in the race.
struct Contender {
    name: String,
    policy: UpdatePolicy,
    /// What each run took, in all.
    runs: Vec<Run>,
}

/// What the frames of a run took.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    seconds: f64,
    longest: f64,
    rebuilds: usize,
    /// Nodes and leaves that rays visited.
    visits: u64,
}

pub(super) fn run(
    bench: &Bench<'_>,
    given: Option<(&str, &FlatMesh)>,
) -> Result<Vec<Row>, BenchError> {
    let own;
    let (scene, mesh) = match given {
        Some(given) => given,
        None => {
            own = motion::column(bench.options.scaled(TRIANGLES));
            ("column", &own)
        }
    };
    let options = BuildOptions::default();
    let first = [TriangleMesh::new(&mesh.positions, &mesh.indices)];
    let build = bench.pool.install(|| Blas::build(&first, &options))?.stats().seconds;
    let mut contenders = policies(build);
    for _ in 0..bench.options.repeats {
        race(bench, mesh, &options, &mut contenders)?;
    }
    let subject = Subject {
        case: UpdateCase::Twist,
        scene: scene.to_owned(),
        triangles: mesh.indices.len(),
        instances: 0,
    };
    Ok(rows(bench, &subject, &contenders))
}

/// The policies, that of all builds first, given the seconds of one.
fn policies(build: f64) -> Vec<Contender> {
    let growth = |limit| (format!("growth:{limit}"), UpdatePolicy::QualityGrowth { limit });
    let policies = [
        ("rebuild".to_owned(), UpdatePolicy::RebuildAlways),
        ("refit".to_owned(), UpdatePolicy::RefitAlways),
        ("every:10".to_owned(), UpdatePolicy::EveryFrames(10)),
        growth(1.1),
        growth(1.2),
        growth(1.3),
        growth(1.5),
        ("budget:0.25".to_owned(), UpdatePolicy::TimeBudget { seconds: 0.25 * build }),
    ];
    policies.into_iter().map(|(name, policy)| Contender { name, policy, runs: vec![] }).collect()
}

/// One run of all: frame by frame, in each all policies in turn.
fn race(
    bench: &Bench<'_>,
    mesh: &FlatMesh,
    options: &BuildOptions<'static>,
    contenders: &mut [Contender],
) -> Result<(), BenchError> {
    let first = [TriangleMesh::new(&mesh.positions, &mesh.indices)];
    let start = |contender: &Contender| MovingBlas::build(&first, options, contender.policy);
    let mut moving: Vec<MovingBlas<'_>> =
        bench.pool.install(|| contenders.iter().map(start).collect::<Result<_, _>>())?;
    let mut runs = vec![Run::default(); contenders.len()];
    for frame in 1..=FRAMES {
        let positions = motion::twisted(mesh, ANGLE * frame as f32 / FRAMES as f32);
        let now = [TriangleMesh::new(&positions, &mesh.indices)];
        let rays = rays(&positions, frame);
        for (moving, run) in moving.iter_mut().zip(&mut runs) {
            let report = bench.pool.install(|| moving.update(&now))?;
            run.seconds += report.seconds;
            run.longest = run.longest.max(report.seconds);
            run.rebuilds += usize::from(report.action != UpdateAction::Refit);
            run.visits += visits(moving.blas(), &rays);
        }
    }
    for (contender, run) in contenders.iter_mut().zip(runs) {
        contender.runs.push(run);
    }
    Ok(())
}

/// Rays between places around the mesh.
fn rays(positions: &[glam::Vec3], frame: usize) -> Vec<Ray> {
    let mesh = FlatMesh { positions: positions.to_vec(), ..FlatMesh::default() };
    let bounds = mesh.bounds();
    let (centre, half) = (bounds.centre(), 0.6 * (bounds.upper - bounds.lower));
    let mut rng = Rng::new(frame as u64);
    let mut place = || centre + half * (2.0 * rng.vec3() - 1.0);
    let mut between = || {
        let (from, to) = (place(), place());
        Ray::new(from, to - from)
    };
    (0..RAYS).map(|_| between()).collect()
}

fn visits(blas: &Blas, rays: &[Ray]) -> u64 {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut counts = vec![Counters::default(); rays.len()];
    blas.closest_hits_counted(rays, &mut hits, &mut counts, &TraceOptions::default(), &AcceptAll);
    counts.iter().map(|count| u64::from(count.nodes + count.leaves)).sum()
}

/// Of each policy the time of a frame, and time and visits beside those of the first one.
fn rows(bench: &Bench<'_>, subject: &Subject, contenders: &[Contender]) -> Vec<Row> {
    let mut rows = Vec::new();
    let reference = &contenders[0];
    for contender in contenders {
        let runs = &contender.runs;
        let times: Vec<f64> = runs.iter().map(|run| 1e3 * run.seconds / FRAMES as f64).collect();
        let longest: Vec<f64> = runs.iter().map(|run| 1e3 * run.longest).collect();
        let rebuilds: Vec<f64> = runs.iter().map(|run| run.rebuilds as f64).collect();
        let row = Row {
            frames: Some(FRAMES),
            rebuilds: Some(median(&rebuilds) as usize),
            longest: Some(median(&longest)),
            repeats: runs.len(),
            ..bench.row(subject, &contender.name)
        };
        let figure = |values: &[f64], row: Row| Row {
            value: median(values),
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            max: values.iter().copied().fold(0.0, f64::max),
            ..row
        };
        rows.push(figure(&times, Row { unit: "ms", ..row.clone() }));
        let beside = |of: fn(&Run) -> f64| -> Vec<f64> {
            runs.iter().zip(&reference.runs).map(|(a, b)| of(a) / of(b)).collect()
        };
        let ratio = |what| Row {
            unit: "ratio",
            ratio_of: Some(what),
            peer: Some(reference.name.clone()),
            ..row.clone()
        };
        rows.push(figure(&beside(|run| run.seconds), ratio("time")));
        rows.push(figure(&beside(|run| run.visits.max(1) as f64), ratio("visits")));
    }
    rows
}
