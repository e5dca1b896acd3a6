//! Spatial splits: answers, budget, and what they are for.

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, Blas, BuildControl, BuildError, BuildOptions, BuildQuality, Builder, TraceOptions,
};
use rayburst_math::{Hit, Ray};

use crate::{
    meshes::{Mesh, Random, degenerate, grid_box, needles, ray_at, soup, with_quality},
    oracle::check_closest,
};

const OPTIONS: TraceOptions = TraceOptions::DEFAULT;

fn best(mesh: &Mesh, budget: f32) -> Blas {
    let options =
        BuildOptions { reference_budget: Some(budget), ..with_quality(BuildQuality::Best) };
    Blas::build(&[mesh.geometry()], &options).unwrap()
}

/// Large triangles through many small ones.
fn mixed(scale: f32) -> Mesh {
    soup(71, 2000, 0.05).merged(&soup(72, 60, 1.0)).map(|p| scale * p)
}

/// Long thin triangles through many small ones.
fn cables(seed: u64, cables: usize, leaves: usize) -> Mesh {
    needles(seed, cables).merged(&soup(seed + 1, leaves, 0.01))
}

#[test]
fn split_triangles_are_hit_as_brute_force_says() {
    let far = Vec3::new(1e4, -1e4, 1e4);
    let flat = soup(73, 1500, 0.6).map(|p| p * Vec3::new(1.0, 0.0, 1.0));
    let cases = [
        ("cables", cables(70, 100, 2000), Vec3::ZERO, 1.0),
        ("mixed", mixed(1.0), Vec3::ZERO, 1.0),
        ("minute", mixed(1e-19), Vec3::ZERO, 1e-19),
        ("huge", mixed(1e15), Vec3::ZERO, 1e15),
        ("far", mixed(1.0).map(|p| p + far), far, 1.0),
        ("boxes", grid_box(5).merged(&needles(74, 60)), Vec3::ZERO, 1.0),
        ("degenerate", degenerate(75, 2000).merged(&mixed(1.0)), Vec3::ZERO, 1.0),
        ("flat", flat, Vec3::ZERO, 1.0),
    ];
    for (name, mesh, centre, radius) in cases {
        let blas = best(&mesh, 4.0);
        let report = blas.validate().unwrap_or_else(|defect| panic!("{name}: {defect}"));
        assert!(report.references > report.primitives, "{name}: nothing was split");
        let mut random = Random::new(76);
        for _ in 0..600 {
            let ray = ray_at(&mut random, centre, radius);
            let hit = blas.closest_hit(&ray, &OPTIONS, &AcceptAll);
            check_closest(&mesh, &ray, &hit).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(blas.any_hit(&ray, &OPTIONS, &AcceptAll), hit.is_hit(), "{name}");
        }
        for triangle in 0..mesh.indices.len() {
            if let Some(corners) = blas.triangle(0, triangle as u32) {
                assert_eq!(corners, mesh.triangle(triangle), "{name}");
            }
        }
    }
}

#[test]
fn the_budget_is_kept() {
    let mesh = cables(77, 150, 2850);
    let references = [0.0, 1.0, 1.1, 1.5, 2.0, 3.0, f32::INFINITY, f32::NAN].map(|budget| {
        let stats = best(&mesh, budget).stats();
        if budget.is_finite() {
            assert!(stats.references as f32 <= budget.max(1.0) * 3000.0, "{budget}: {stats:?}");
        }
        stats.references
    });
    assert_eq!(references[..2], [3000, 3000]);
    // More budget is used, and without an end the planes themselves set one.
    assert!(references[1..6].is_sorted_by(|a, b| a < b), "{references:?}");
    assert!(references[6] <= 16 * 3000, "{references:?}");
}

#[test]
fn long_thin_triangles_cost_fewer_visits() {
    let mesh = cables(78, 500, 20_000);
    let visits = |blas: &Blas| {
        let mut random = Random::new(79);
        let rays: Vec<Ray> = (0..4000).map(|_| ray_at(&mut random, Vec3::ZERO, 1.0)).collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counts = vec![Default::default(); rays.len()];
        blas.closest_hits_counted(&rays, &mut hits, &mut counts, &OPTIONS, &AcceptAll);
        counts.iter().map(|c: &rayburst_accel::Counters| u64::from(c.nodes + c.leaves)).sum()
    };
    let balanced: u64 = visits(&mesh.blas(rayburst_accel::IsaLevel::detect()));
    let split: u64 = visits(&best(&mesh, 2.0));
    assert!(split * 10 < balanced * 9, "{split} against {balanced}");
}

#[test]
fn the_builder_may_be_chosen() {
    let mesh = needles(80, 2000);
    let references = |quality, builder| {
        let options = BuildOptions { builder: Some(builder), ..with_quality(quality) };
        Blas::build(&[mesh.geometry()], &options).unwrap().stats().references
    };
    assert_eq!(references(BuildQuality::Best, Builder::BinnedSah), 2000);
    assert!(references(BuildQuality::Balanced, Builder::SpatialSplits) > 2000);
}

#[test]
fn builds_tell_their_progress_and_can_be_cancelled() {
    let mesh = soup(81, 200_000, 0.02);
    for quality in [BuildQuality::Balanced, BuildQuality::Best] {
        let control = BuildControl::new();
        let options = BuildOptions { control: Some(&control), ..with_quality(quality) };
        assert_eq!(control.progress(), 0.0);
        std::thread::scope(|scope| {
            let build = scope.spawn(|| Blas::build(&[mesh.geometry()], &options).unwrap());
            let mut last = 0.0;
            while !build.is_finished() {
                let progress = control.progress();
                assert!((last..=1.0).contains(&progress), "{progress} after {last}");
                last = progress;
                std::thread::yield_now();
            }
        });
        assert_eq!(control.progress(), 1.0);
        let other = &BuildControl::new();
        std::thread::scope(|scope| {
            let options = BuildOptions { control: Some(other), ..with_quality(quality) };
            let mesh = mesh.geometry();
            let build = scope.spawn(move || Blas::build(&[mesh], &options).map(drop));
            while other.progress() == 0.0 && !build.is_finished() {
                std::thread::yield_now();
            }
            other.cancel();
            let result = build.join().unwrap();
            assert!(matches!(result, Ok(()) | Err(BuildError::Cancelled)), "{result:?}");
        });
        control.cancel();
        let cancelled = Blas::build(&[mesh.geometry()], &options).map(drop);
        assert_eq!(cancelled, Err(BuildError::Cancelled));
    }
}
