//! `bench rays`: Mrays/s of every engine on every ray set of a scene.

use std::{collections::HashMap, path::PathBuf, sync::Arc, time::Instant};

use rayburst_accel::{Blas, TriangleMesh};
use rayburst_math::Hit;
use rayburst_scene::Camera;
use rayon::prelude::*;

use crate::{
    BenchError, Engine, EngineSpec, FlatMesh, Query, RaySet, RaySetKind, Row,
    engine::{Mode, Preset, Rayburst},
    error,
    machine::Machine,
    peers::embree::{Embree, EmbreeEngine},
    ray_sets::ray_sets,
    standing::{Rate, standings},
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
    /// Which engines.
    pub engines: Vec<EngineSpec>,
    /// Which sets.
    pub sets: Vec<RaySetKind>,
}

impl Default for RayBench {
    fn default() -> Self {
        let presets = Preset::USUAL.iter();
        Self {
            threads: 1,
            repeats: 5,
            seconds: 0.5,
            size: 1024,
            embree: None,
            engines: presets.map(|p| EngineSpec::Rayburst(*p, Mode::Auto)).collect(),
            sets: RaySetKind::ALL.map(|(_, kind)| kind).to_vec(),
        }
    }
}

/// Measures one scene. Every row is also given to `report` as soon as it exists.
pub fn bench_rays(
    name: &str,
    mesh: &FlatMesh,
    camera: &Camera,
    options: &RayBench,
    report: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>, BenchError> {
    let pool = error::pool(options.threads)?;
    let triangles = [TriangleMesh::new(&mesh.positions, &mesh.indices)];
    // The rays do not depend on how the structure was built.
    let reference = Blas::build(&triangles, &Preset::USUAL[0].options())?;
    let sets = pool.install(|| ray_sets(mesh, &reference, camera, options.size));
    drop(reference);
    let engines = build(mesh, options)?;
    let machine = Machine::here();
    let mut rows = Vec::new();
    for set in sets.iter().filter(|s| options.sets.contains(&s.kind) && !s.rays.is_empty()) {
        let measured = pool.install(|| measure(set, &engines, options));
        check_agreement(name, set, &engines, &measured)?;
        let rates: Vec<Rate> = engines
            .iter()
            .zip(&measured)
            .map(|(engine, m)| Rate {
                rate: m.median(),
                is_peer: engine.is_peer(),
                is_single: engine.takes_single_rays(),
            })
            .collect();
        for ((engine, m), standing) in engines.iter().zip(&measured).zip(standings(&rates)) {
            let row = Row {
                bench: "rays",
                scene: name.to_owned(),
                triangles: mesh.indices.len(),
                ray_set: Some(set.kind.name()),
                engine: Some(engine.name()),
                threads: options.threads,
                value: m.median(),
                unit: "Mrays/s",
                ratio: standing.ratio,
                peer: standing.against.map(|index| engines[index].name()),
                single_ratio: standing.single_ratio,
                best_peer: standing.is_best_peer,
                repeats: m.rates.len(),
                min: m.rates[0],
                max: m.rates[m.rates.len() - 1],
                rays: Some(set.rays.len()),
                hits: Some(m.hits),
                nodes: m.visits.map(|v| v.nodes),
                leaves: m.visits.map(|v| v.leaves),
                packet_share: m.visits.map(|v| v.packet_share),
                in_flight: m.visits.map(|v| v.in_flight),
                machine: machine.clone(),
                ..Row::default()
            };
            report(&row);
            rows.push(row);
        }
    }
    Ok(rows)
}

/// Builds what the engines need; those that differ only in how they trace share a structure.
fn build(mesh: &FlatMesh, options: &RayBench) -> Result<Vec<Box<dyn Engine>>, BenchError> {
    let mut engines: Vec<Box<dyn Engine>> = Vec::new();
    let mut own = HashMap::new();
    let mut geometry = None;
    let mut scenes = HashMap::new();
    for spec in &options.engines {
        match *spec {
            EngineSpec::Rayburst(preset, mode) => {
                let blas = match own.get(preset.name) {
                    Some(blas) => Arc::clone(blas),
                    None => {
                        let triangles = TriangleMesh::new(&mesh.positions, &mesh.indices);
                        let blas = Arc::new(Blas::build(&[triangles], &preset.options())?);
                        own.insert(preset.name, blas.clone());
                        blas
                    }
                };
                engines.push(Box::new(Rayburst { blas, preset, mode }));
            }
            EngineSpec::Embree(config) => {
                let geometry = match &mut geometry {
                    Some(geometry) => geometry,
                    None => {
                        let path = options
                            .embree
                            .as_ref()
                            .ok_or_else(|| BenchError::NoLibrary { engine: config.to_string() })?;
                        let embree = Embree::load(path, options.threads)?;
                        geometry.insert(embree.geometry(mesh)?)
                    }
                };
                let scene = match scenes.get(&config.scene) {
                    Some(scene) => Arc::clone(scene),
                    None => {
                        let scene = Arc::new(geometry.build(config.scene)?.0);
                        scenes.insert(config.scene, scene.clone());
                        scene
                    }
                };
                engines.push(Box::new(EmbreeEngine::new(scene, config)));
            }
            #[cfg(feature = "peers")]
            EngineSpec::Obvhs => engines.push(Box::new(crate::peers::obvhs::Obvhs::build(mesh))),
        }
    }
    Ok(engines)
}

struct Measured {
    /// Mrays/s of each timed run, ascending.
    rates: Vec<f64>,
    hits: usize,
    visits: Option<Visits>,
}

impl Measured {
    fn median(&self) -> f64 {
        self.rates[self.rates.len() / 2]
    }
}

/// What the rays of a set visit, on average.
#[derive(Clone, Copy)]
struct Visits {
    nodes: f64,
    leaves: f64,
    packet_share: f64,
    in_flight: f64,
}

impl Visits {
    /// Traces all rays once more, counting.
    fn count(engine: &dyn Engine, query: Query, set: &RaySet) -> Option<Self> {
        let (mut nodes, mut leaves, mut bundled, mut in_flight) = (0.0, 0.0, 0.0, 0.0);
        for rays in set.rays.chunks(engine.batch()) {
            for counters in engine.count(query, rays)? {
                nodes += f64::from(counters.nodes);
                leaves += f64::from(counters.leaves);
                bundled += f64::from(counters.packet_nodes);
                in_flight += f64::from(counters.in_flight);
            }
        }
        let rays = set.rays.len().max(1) as f64;
        Some(Self {
            nodes: nodes / rays,
            leaves: leaves / rays,
            packet_share: bundled / nodes.max(1.0),
            in_flight: in_flight / (nodes + leaves).max(1.0),
        })
    }
}

/// Where the answers go.
struct Answers {
    hits: Vec<Hit>,
    occluded: Vec<bool>,
}

impl Answers {
    /// Traces all rays once, in tasks on the pool.
    fn trace(&mut self, engine: &dyn Engine, query: Query, set: &RaySet) {
        let batch = engine.batch();
        set.rays
            .par_chunks(batch)
            .zip(self.hits.par_chunks_mut(batch))
            .zip(self.occluded.par_chunks_mut(batch))
            .for_each(|((rays, hits), occluded)| engine.trace(query, rays, hits, occluded));
    }

    /// How many rays an engine hits.
    fn count(&mut self, engine: &dyn Engine, query: Query, set: &RaySet) -> usize {
        self.hits.fill(Hit::MISS);
        self.occluded.fill(false);
        self.trace(engine, query, set);
        match query {
            Query::Closest => self.hits.iter().filter(|h| h.is_hit()).count(),
            Query::Any => self.occluded.iter().filter(|&&o| o).count(),
        }
    }
}

/// Interleaves the engines: one timed run of each, again and again.
fn measure(set: &RaySet, engines: &[Box<dyn Engine>], options: &RayBench) -> Vec<Measured> {
    let query = if set.kind.is_any_hit() { Query::Any } else { Query::Closest };
    let count = set.rays.len();
    let mut answers = Answers { hits: vec![Hit::MISS; count], occluded: vec![false; count] };
    // Counting is the warm-up, and touches all memory.
    let mut measured: Vec<Measured> = engines
        .iter()
        .map(|engine| Measured {
            rates: Vec::with_capacity(options.repeats),
            hits: answers.count(engine.as_ref(), query, set),
            visits: Visits::count(engine.as_ref(), query, set),
        })
        .collect();
    for _ in 0..options.repeats {
        for (engine, m) in engines.iter().zip(&mut measured) {
            let start = Instant::now();
            let mut passes = 0;
            let seconds = loop {
                answers.trace(engine.as_ref(), query, set);
                passes += 1;
                let seconds = start.elapsed().as_secs_f64();
                if seconds >= options.seconds {
                    break seconds;
                }
            };
            m.rates.push((count * passes) as f64 / seconds.max(1e-9) / 1e6);
        }
    }
    for m in &mut measured {
        m.rates.sort_by(f64::total_cmp);
    }
    measured
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
