//! `trace` and `instructions`: how many instructions a ray takes, as valgrind counts them.
//!
//! `instructions` runs `trace` under valgrind, once without and once with tracing, for each
//! instruction set that valgrind knows, mode, query and set of rays; the difference is the tracing.

use std::{process::Command, sync::Arc};

use clap::{Args, ValueEnum};
use glam::{Affine3A, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, BuildQuality, Instance, IsaLevel, Tlas, TraceMode, TraceOptions,
    TriangleMesh,
};
use rayburst_math::{Hit, Ray, hash::Rng};
use rayburst_verify::{
    builds::{Query, traces},
    meshes::noisy_sphere,
};

/// Rays in a batch.
const RAYS: usize = 4096;

/// Kinds of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Set {
    /// From a pinhole, in tiles of 8 × 8.
    Coherent,
    /// From anywhere to anywhere.
    Incoherent,
}

#[derive(Args)]
pub(super) struct Options {
    /// Which of the modes, counted in the order of their list; traces nothing without
    #[arg(long)]
    trace: Option<usize>,
    /// The rays
    #[arg(long, default_value = "incoherent")]
    set: Set,
    /// So many instances of the scene
    #[arg(long)]
    instances: Option<u16>,
}

/// A scene of 20480 triangles.
fn blas(isa: Option<IsaLevel>) -> Result<Blas, String> {
    let mesh = noisy_sphere(5, 0.25);
    let geometry = TriangleMesh::new(&mesh.positions, &mesh.indices);
    let options = BuildOptions { quality: BuildQuality::Best, isa, ..BuildOptions::default() };
    Blas::build(&[geometry], &options).map_err(|e| e.to_string())
}

/// The scene several times, one beside the other.
fn tlas(blas: &Arc<Blas>, count: u16) -> Result<Tlas, String> {
    let place = |i: u16| Affine3A::from_translation(Vec3::X * 0.1 * f32::from(i));
    let instances: Vec<_> = (0..count).map(|i| Instance::new(0, place(i))).collect();
    let options = BuildOptions::default();
    Tlas::build(vec![blas.clone()], &instances, &options).map_err(|e| e.to_string())
}

fn rays(set: Set) -> Vec<Ray> {
    let mut rng = Rng::new(1);
    let ray = |i: usize| match set {
        Set::Coherent => {
            let (tile, pixel) = (i / 64, i % 64);
            let x = (8 * (tile % 8) + pixel % 8) as f32 / 64.0 - 0.5;
            let y = (8 * (tile / 8) + pixel / 8) as f32 / 64.0 - 0.5;
            Ray::new(Vec3::new(0.1, 0.2, 3.0), Vec3::new(x, y, -1.5))
        }
        Set::Incoherent => {
            let mut point = || 2.0 * rng.vec3() - 1.0;
            let (origin, target) = (1.5 * point(), point());
            Ray::new(origin, target - origin)
        }
    };
    (0..RAYS).map(ray).collect()
}

/// What valgrind runs.
pub(super) fn run(options: &Options) -> Result<(), String> {
    // One thread: the same instructions every time.
    let pool = super::pool(Some(1))?;
    let blas = Arc::new(pool.install(|| blas(None))?);
    let tlas = options.instances.map(|count| pool.install(|| tlas(&blas, count)));
    let rays = rays(options.set);
    let (mut hits, mut any) = (vec![Hit::MISS; RAYS], vec![false; RAYS]);
    if let Some(number) = options.trace {
        let traces = traces();
        let &(mode, query) = traces.get(number).ok_or("no such mode")?;
        let options = TraceOptions { mode, ..TraceOptions::default() };
        let tlas = tlas.transpose()?;
        match (query, &tlas) {
            (Query::Closest, None) => blas.closest_hits(&rays, &mut hits, &options, &AcceptAll),
            (Query::Any, None) => blas.any_hits(&rays, &mut any, &options, &AcceptAll),
            (Query::Closest, Some(tlas)) => {
                tlas.closest_hits(&rays, &mut hits, &options, &AcceptAll);
            }
            (Query::Any, Some(tlas)) => tlas.any_hits(&rays, &mut any, &options, &AcceptAll),
        }
    }
    std::hint::black_box((hits, any));
    Ok(())
}

/// Instructions that valgrind counts in a run of `trace`.
fn count(isa: &str, arguments: &[&str]) -> Result<u64, String> {
    let program = std::env::current_exe().map_err(|e| format!("cannot find this program: {e}"))?;
    let output = Command::new("valgrind")
        .args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"])
        .arg(program)
        .arg("trace")
        .args(arguments)
        .env("RAYBURST_ISA", isa)
        .output()
        .map_err(|e| format!("cannot run valgrind, which counts the instructions: {e}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let line = said.lines().find(|line| line.contains("I ") && line.contains("refs:"));
    let digits = |line: &str| {
        let number = line.rsplit(':').next().unwrap_or_default();
        number.chars().filter(char::is_ascii_digit).collect::<String>().parse().ok()
    };
    match line.and_then(digits) {
        Some(count) if output.status.success() => Ok(count),
        _ => Err(format!("valgrind counted nothing under {isa}:\n{said}")),
    }
}

/// The table, in Markdown.
#[expect(clippy::print_stdout, reason = "the result of the command")]
pub(super) fn instructions() -> Result<(), String> {
    // Valgrind knows no AVX-512.
    let isas = IsaLevel::available().into_iter().map(IsaLevel::name).filter(|&n| n != "avx512");
    println!("| instruction set | mode | query | coherent | incoherent |");
    println!("| --- | --- | --- | --: | --: |");
    for isa in isas {
        let mut before = [0; 2];
        let sets = ["coherent", "incoherent"];
        for (before, set) in before.iter_mut().zip(sets) {
            *before = count(isa, &["--set", set])?;
        }
        for (number, (mode, query)) in traces().into_iter().enumerate() {
            let mut per_ray = [0; 2];
            for ((per_ray, before), set) in per_ray.iter_mut().zip(before).zip(sets) {
                let all = count(isa, &["--set", set, "--trace", &number.to_string()])?;
                *per_ray = all.saturating_sub(before) / RAYS as u64;
            }
            let mode: TraceMode = mode;
            println!("| {isa} | {mode:?} | {query:?} | {} | {} |", per_ray[0], per_ray[1]);
        }
    }
    Ok(())
}
