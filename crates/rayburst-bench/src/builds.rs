//! `bench build`: how fast structures are built and fitted anew, how large and how good they are.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use rayburst_accel::{Blas, BuildOptions, TriangleMesh};

use crate::{
    BenchError, FlatMesh, Row,
    engine::Preset,
    error,
    machine::Machine,
    peers::embree::{Embree, Geometry, Quality, SceneConfig},
};

/// What to measure.
#[derive(Clone, Debug)]
pub struct BuildBench {
    /// Threads that build, ≥ 1.
    pub threads: usize,
    /// Timed runs of each builder, ≥ 1.
    pub repeats: usize,
    /// Least length of a timed run, seconds; short builds are repeated.
    pub seconds: f64,
    /// Embree's shared library.
    pub embree: Option<PathBuf>,
    /// Which presets.
    pub presets: Vec<Preset>,
}

/// What one build gives.
#[derive(Clone, Copy, Debug, Default)]
struct Built {
    time: Duration,
    /// Memory of the structure, if it was made anew.
    bytes: Option<f64>,
    sah_cost: Option<f32>,
    depth: Option<usize>,
}

/// Something that builds.
struct Contender<'a> {
    engine: String,
    builder: &'static str,
    /// Name of the peer that it is compared with.
    peer: Option<String>,
    build: Box<dyn FnMut() -> Result<Built, BenchError> + 'a>,
}

/// Measures one scene. Every row is also given to `report`.
pub fn bench_builds(
    name: &str,
    mesh: &FlatMesh,
    options: &BuildBench,
    report: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>, BenchError> {
    let pool = error::pool(options.threads)?;
    let embree = options.embree.as_ref().map(|path| Embree::load(path, options.threads));
    let geometries = match embree.transpose()? {
        // The mesh that is fitted anew has other flags than the one that is built.
        Some(embree) => Some([embree.geometry(mesh)?, embree.geometry(mesh)?]),
        None => None,
    };
    let mut contenders: Vec<Contender<'_>> =
        options.presets.iter().map(|preset| own(*preset, mesh, &pool)).collect();
    if let Some([built, refitted]) = &geometries {
        contenders.extend(Quality::ALL.map(|(_, quality)| embree_build(quality, built)));
        contenders.push(embree_refit(refitted)?);
    }
    contenders.push(own_refit(mesh, &pool)?);
    contenders.push(own_refit_changed(mesh, &pool)?);
    let measured = measure(&mut contenders, options)?;
    let rows = rows(name, mesh, &contenders, &measured, options);
    rows.iter().for_each(report);
    Ok(rows)
}

fn own<'a>(preset: Preset, mesh: &'a FlatMesh, pool: &'a rayon::ThreadPool) -> Contender<'a> {
    let build = move || {
        let triangles = [TriangleMesh::new(&mesh.positions, &mesh.indices)];
        let blas = pool.install(|| Blas::build(&triangles, &preset.options()))?;
        let stats = blas.stats();
        Ok(Built {
            time: Duration::from_secs_f64(stats.seconds),
            bytes: Some(stats.bytes as f64),
            sah_cost: Some(stats.sah_cost),
            depth: Some(stats.depth),
        })
    };
    Contender {
        engine: format!("rayburst:{}", preset.name),
        builder: preset.builder,
        peer: Some(embree_name(preset.embree)),
        build: Box::new(build),
    }
}

fn embree_name(quality: Quality) -> String {
    format!("embree:{}", quality.name())
}

fn embree_build(quality: Quality, geometry: &Geometry) -> Contender<'_> {
    let config = SceneConfig { quality, robust: false, compact: false };
    let build = move || {
        let (_scene, time, bytes) = geometry.build(config)?;
        Ok(Built { time, bytes: Some(bytes as f64), ..Built::default() })
    };
    Contender {
        engine: embree_name(quality),
        builder: quality.builder(),
        peer: None,
        build: Box::new(build),
    }
}

fn embree_refit(geometry: &Geometry) -> Result<Contender<'_>, BenchError> {
    let mut scene = geometry.build_refittable()?;
    let build = move || Ok(Built { time: scene.refit()?, ..Built::default() });
    Ok(Contender {
        engine: "embree:refit".into(),
        builder: "refit",
        peer: None,
        build: Box::new(build),
    })
}

/// Fits the default preset's structure to the same mesh again and again.
fn own_refit<'a>(
    mesh: &'a FlatMesh,
    pool: &'a rayon::ThreadPool,
) -> Result<Contender<'a>, BenchError> {
    let triangles = [TriangleMesh::new(&mesh.positions, &mesh.indices)];
    let mut blas = pool.install(|| Blas::build(&triangles, &BuildOptions::default()))?;
    let build = move || {
        let begin = Instant::now();
        pool.install(|| blas.refit(&triangles))?;
        Ok(Built { time: begin.elapsed(), ..Built::default() })
    };
    Ok(Contender {
        engine: "rayburst:refit".into(),
        builder: "refit",
        peer: Some("embree:refit".into()),
        build: Box::new(build),
    })
}

/// Of how many triangles one is fitted anew alone.
const UNCHANGED: usize = 100;

/// Tells the default preset's structure again and again that some triangles changed, all over the mesh;
/// the rate is that of all triangles.
fn own_refit_changed<'a>(
    mesh: &'a FlatMesh,
    pool: &'a rayon::ThreadPool,
) -> Result<Contender<'a>, BenchError> {
    let triangles = [TriangleMesh::new(&mesh.positions, &mesh.indices)];
    let mut blas = pool.install(|| Blas::build(&triangles, &BuildOptions::default()))?;
    let changed: Vec<(u32, u32)> =
        (0..mesh.indices.len() as u32).step_by(UNCHANGED).map(|primitive| (0, primitive)).collect();
    let build = move || {
        let begin = Instant::now();
        pool.install(|| blas.refit_changed(&triangles, &changed))?;
        Ok(Built { time: begin.elapsed(), ..Built::default() })
    };
    Ok(Contender {
        engine: "rayburst:refit-changed".into(),
        builder: "1 % refit",
        // No peer does this; the rate is to be compared with that of a whole refit.
        peer: None,
        build: Box::new(build),
    })
}

struct Measured {
    /// Seconds of one build in each timed run, ascending.
    seconds: Vec<f64>,
    built: Built,
}

/// Interleaves the builders: one timed run of each, again and again.
fn measure(
    contenders: &mut [Contender<'_>],
    options: &BuildBench,
) -> Result<Vec<Measured>, BenchError> {
    let mut measured = Vec::new();
    for contender in &mut *contenders {
        // The warm-up.
        let built = (contender.build)()?;
        measured.push(Measured { seconds: Vec::with_capacity(options.repeats), built });
    }
    for _ in 0..options.repeats {
        for (contender, m) in contenders.iter_mut().zip(&mut measured) {
            let (mut seconds, mut builds) = (0.0, 0);
            while builds == 0 || seconds < options.seconds {
                seconds += (contender.build)()?.time.as_secs_f64().max(1e-9);
                builds += 1;
            }
            m.seconds.push(seconds / f64::from(builds));
        }
    }
    for m in &mut measured {
        m.seconds.sort_by(f64::total_cmp);
    }
    Ok(measured)
}

fn rows(
    name: &str,
    mesh: &FlatMesh,
    contenders: &[Contender<'_>],
    measured: &[Measured],
    options: &BuildBench,
) -> Vec<Row> {
    let machine = Machine::here();
    let triangles = mesh.indices.len();
    let rate = |seconds: f64| triangles as f64 / seconds / 1e6;
    let median = |m: &Measured| rate(m.seconds[m.seconds.len() / 2]);
    let size = |m: &Measured| m.built.bytes.map(|bytes| bytes / triangles.max(1) as f64);
    let mut rows = Vec::new();
    for (contender, m) in contenders.iter().zip(measured) {
        let peer = contender.peer.as_ref().and_then(|peer| {
            contenders.iter().zip(measured).find(|(other, _)| other.engine == *peer)
        });
        let speed = Row {
            bench: "build",
            scene: name.to_owned(),
            triangles,
            engine: Some(contender.engine.clone()),
            builder: Some(contender.builder),
            threads: options.threads,
            value: median(m),
            unit: "Mtri/s",
            ratio: peer.map(|(_, peer)| median(m) / median(peer)),
            peer: peer.map(|(other, _)| other.engine.clone()),
            repeats: m.seconds.len(),
            min: rate(m.seconds[m.seconds.len() - 1]),
            max: rate(m.seconds[0]),
            sah_cost: m.built.sah_cost,
            depth: m.built.depth,
            machine: machine.clone(),
            ..Row::default()
        };
        let memory = size(m).map(|value| Row {
            value,
            unit: "B/tri",
            ratio: peer.and_then(|(_, peer)| Some(value / size(peer)?)),
            min: value,
            max: value,
            ..speed.clone()
        });
        rows.push(speed);
        rows.extend(memory);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contender(engine: &str, peer: Option<&str>) -> Contender<'static> {
        let milliseconds = if engine.starts_with("embree") { 20 } else { 10 };
        let build = move || {
            Ok(Built {
                time: Duration::from_millis(milliseconds),
                bytes: Some(100.0 * milliseconds as f64),
                ..Built::default()
            })
        };
        let peer = peer.map(str::to_owned);
        Contender { engine: engine.into(), builder: "test", peer, build: Box::new(build) }
    }

    #[test]
    fn rates_and_ratios_follow_from_times_and_bytes() {
        let mesh = FlatMesh { indices: vec![[0; 3]; 1000], ..FlatMesh::default() };
        let options =
            BuildBench { threads: 1, repeats: 3, seconds: 0.05, embree: None, presets: Vec::new() };
        let mut contenders = [
            contender("rayburst:fast", Some("embree:low")),
            contender("rayburst:best", Some("embree:high")),
            contender("embree:low", None),
        ];
        let measured = measure(&mut contenders, &options).unwrap();
        let rows = rows("a", &mesh, &contenders, &measured, &options);
        let found: Vec<_> = rows.iter().map(|r| (r.engine.as_deref().unwrap(), r.unit)).collect();
        let units = ["Mtri/s", "B/tri"];
        assert_eq!(found[..2], units.map(|unit| ("rayburst:fast", unit)));
        assert_eq!(found[4..], units.map(|unit| ("embree:low", unit)));
        assert!((rows[0].value - 0.1).abs() < 1e-9 && (rows[1].value - 1.0).abs() < 1e-9);
        assert!((rows[0].ratio.unwrap() - 2.0).abs() < 1e-9);
        assert!((rows[1].ratio.unwrap() - 0.5).abs() < 1e-9);
        assert_eq!(rows[0].peer.as_deref(), Some("embree:low"));
        assert_eq!((rows[2].ratio, &rows[2].peer), (None, &None), "its peer was not measured");
        assert_eq!((rows[4].ratio, rows[4].repeats), (None, 3));
    }
}
