//! `bench rays`: Mrays/s of every engine on every ray set of a scene.

use std::{path::PathBuf, time::Instant};

use rayburst_accel::{Blas, BuildError, BuildOptions, TriangleMesh};
use rayburst_math::Hit;
use rayburst_scene::Camera;
use rayon::prelude::*;

use crate::{
    Engine, FlatMesh, Query, RaySet, RaySetKind, Row,
    engine::Rayburst,
    peers::embree::{Embree, Quality},
    ray_sets::ray_sets,
};

/// What to measure.
#[derive(Clone, Debug)]
pub struct RayBench {
    /// Threads that trace, ≥ 1.
    pub threads: usize,
    /// Timed runs of each pair, ≥ 1.
    pub repeats: usize,
    /// Least length of a timed run, seconds.
    pub seconds: f64,
    /// Width and height of the primary rays, pixels.
    pub size: u32,
    /// Embree's shared library.
    pub embree: Option<PathBuf>,
    /// Which sets.
    pub sets: Vec<RaySetKind>,
}

impl Default for RayBench {
    fn default() -> Self {
        Self {
            threads: 1,
            repeats: 5,
            seconds: 0.5,
            size: 1024,
            embree: None,
            sets: RaySetKind::ALL.map(|(_, kind)| kind).to_vec(),
        }
    }
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// A peer's library cannot be used.
    #[error("cannot use the peer library {path}: {reason}")]
    Peer {
        /// The library.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The structure cannot be built.
    #[error("cannot build the acceleration structure: {0}")]
    Build(#[from] BuildError),
    /// There are no worker threads.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system says.
        reason: String,
    },
    /// Engines disagree, so their speeds cannot be compared.
    #[error("{scene}, {ray_set}: {engine} hits {hits} rays where {reference} hits {expected}")]
    Disagreement {
        /// Scene.
        scene: String,
        /// Ray set.
        ray_set: &'static str,
        /// The engine that differs.
        engine: String,
        /// Its number of hits.
        hits: usize,
        /// The engine it is compared with.
        reference: String,
        /// That one's number of hits.
        expected: usize,
    },
}

/// Rays a task: small enough to balance, large enough to be a batch.
const BATCH: usize = 4096;

/// Measures one scene. Every row is also given to `report` as soon as it exists.
pub fn bench_rays(
    name: &str,
    mesh: &FlatMesh,
    camera: &Camera,
    options: &RayBench,
    report: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>, BenchError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|e| BenchError::Threads { threads: options.threads, reason: e.to_string() })?;
    let triangles = TriangleMesh::new(&mesh.positions, &mesh.indices);
    let blas = Blas::build(&[triangles], &BuildOptions::default())?;
    let sets = ray_sets(mesh, &blas, camera, options.size);
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(Rayburst { blas, preset: "balanced" })];
    if let Some(path) = &options.embree {
        let embree = Embree::load(path, options.threads)?;
        engines.push(Box::new(embree.build(mesh, Quality::Medium, false)?));
        engines.push(Box::new(embree.build(mesh, Quality::High, false)?));
        engines.push(Box::new(embree.build(mesh, Quality::Medium, true)?));
    }
    let mut rows = Vec::new();
    for set in sets.iter().filter(|s| options.sets.contains(&s.kind) && !s.rays.is_empty()) {
        let measured = pool.install(|| measure(set, &engines, options));
        check_agreement(name, set, &engines, &measured)?;
        let median = |m: &Measured| m.rates[m.rates.len() / 2];
        let best_peer = engines
            .iter()
            .zip(&measured)
            .filter(|(engine, _)| engine.is_peer())
            .map(|(_, m)| median(m))
            .fold(0.0, f64::max);
        for (engine, m) in engines.iter().zip(&measured) {
            let row = Row {
                bench: "rays",
                scene: name.to_owned(),
                triangles: mesh.indices.len(),
                ray_set: Some(set.kind.name()),
                engine: Some(engine.name()),
                threads: options.threads,
                value: median(m),
                unit: "Mrays/s",
                ratio: (!engine.is_peer() && best_peer > 0.0).then(|| median(m) / best_peer),
                repeats: m.rates.len(),
                min: m.rates[0],
                max: m.rates[m.rates.len() - 1],
                rays: Some(set.rays.len()),
                hits: Some(m.hits),
            };
            report(&row);
            rows.push(row);
        }
    }
    Ok(rows)
}

struct Measured {
    /// Mrays/s of each timed run, ascending.
    rates: Vec<f64>,
    hits: usize,
}

/// Interleaves the engines: one timed run of each, again and again.
fn measure(set: &RaySet, engines: &[Box<dyn Engine>], options: &RayBench) -> Vec<Measured> {
    let query = if set.kind.is_any_hit() { Query::Any } else { Query::Closest };
    let mut hits = vec![Hit::MISS; set.rays.len()];
    let mut occluded = vec![false; set.rays.len()];
    let mut pass = |engine: &dyn Engine| {
        set.rays
            .par_chunks(BATCH)
            .zip(hits.par_chunks_mut(BATCH))
            .zip(occluded.par_chunks_mut(BATCH))
            .for_each(|((rays, hits), occluded)| engine.trace(query, rays, hits, occluded));
    };
    // Warm-up, which also says how many passes a timed run needs.
    let passes: Vec<usize> = engines
        .iter()
        .map(|engine| {
            pass(engine.as_ref());
            let start = Instant::now();
            pass(engine.as_ref());
            (options.seconds / start.elapsed().as_secs_f64().max(1e-6)).ceil().max(1.0) as usize
        })
        .collect();
    let mut rates = vec![Vec::with_capacity(options.repeats); engines.len()];
    for _ in 0..options.repeats {
        for ((engine, &passes), rates) in engines.iter().zip(&passes).zip(&mut rates) {
            let start = Instant::now();
            for _ in 0..passes {
                pass(engine.as_ref());
            }
            let seconds = start.elapsed().as_secs_f64();
            rates.push((set.rays.len() * passes) as f64 / seconds / 1e6);
        }
    }
    let counts: Vec<usize> = engines
        .iter()
        .map(|engine| {
            hits.fill(Hit::MISS);
            occluded.fill(false);
            let engine = engine.as_ref();
            set.rays
                .par_chunks(BATCH)
                .zip(hits.par_chunks_mut(BATCH))
                .zip(occluded.par_chunks_mut(BATCH))
                .for_each(|((rays, hits), occluded)| engine.trace(query, rays, hits, occluded));
            match query {
                Query::Closest => hits.iter().filter(|h| h.is_hit()).count(),
                Query::Any => occluded.iter().filter(|&&o| o).count(),
            }
        })
        .collect();
    rates
        .into_iter()
        .zip(counts)
        .map(|(mut rates, hits)| {
            rates.sort_by(f64::total_cmp);
            Measured { rates, hits }
        })
        .collect()
}

/// Hit counts may differ by rays through edges that a test without watertightness loses, and by
/// grazing rays: one in a thousand.
fn check_agreement(
    scene: &str,
    set: &RaySet,
    engines: &[Box<dyn Engine>],
    measured: &[Measured],
) -> Result<(), BenchError> {
    let tolerance = set.rays.len() / 1000 + 1;
    for (engine, m) in engines.iter().zip(measured).skip(1) {
        if m.hits.abs_diff(measured[0].hits) > tolerance {
            return Err(BenchError::Disagreement {
                scene: scene.to_owned(),
                ray_set: set.kind.name(),
                engine: engine.name(),
                hits: m.hits,
                reference: engines[0].name(),
                expected: measured[0].hits,
            });
        }
    }
    Ok(())
}
