//! Everything once on scenes of a few triangles: small enough for Miri, which runs these tests by
//! `cargo xtask miri` and finds undefined behaviour that no answer shows.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildError, BuildOptions, BuildQuality, Builder, Counters, Instance, IsaLevel,
    Layout, Tlas, TraceMode, TraceOptions, TriangleMesh,
};
use rayburst_math::{Hit, Ray};

use crate::meshes::{Mesh, Random, degenerate, filter, ray_at, soup};

/// Miri takes a thousand times as long.
const TRIANGLES: usize = if cfg!(miri) { 12 } else { 40 };
const RAYS: usize = if cfg!(miri) { 16 } else { 40 };

/// Rays that hit and miss, go backwards and nowhere.
fn rays(count: usize) -> Vec<Ray> {
    let mut random = Random::new(91);
    let ray = |i: usize| {
        let ray = ray_at(&mut random, Vec3::ZERO, 0.7);
        match i % 8 {
            0 => Ray { t_min: -1.0, ..ray },
            1 => Ray { direction: Vec3::ZERO, ..ray },
            2 => Ray { direction: Vec3::new(0.0, -0.0, 1.0), ..ray },
            _ => ray,
        }
    };
    (0..count).map(ray).collect()
}

/// All queries in all modes; returns how many hits there are.
macro_rules! check {
    ($structure:expr, $rays:expr) => {{
        let (structure, rays) = (&$structure, $rays);
        let sieve = filter(&|index: u32, _: &Ray, _: &Hit| !index.is_multiple_of(3));
        let single: Vec<Hit> = rays
            .iter()
            .map(|ray| structure.closest_hit(ray, &TraceOptions::default(), &AcceptAll))
            .collect();
        for mode in TraceMode::ALL {
            let options = TraceOptions { mode, ..TraceOptions::default() };
            let mut hits = vec![Hit::MISS; rays.len()];
            structure.closest_hits(rays, &mut hits, &options, &AcceptAll);
            assert_eq!(hits, single, "{mode:?}");
            let mut any = vec![false; rays.len()];
            let mut counts = vec![Counters::default(); rays.len()];
            structure.any_hits_counted(rays, &mut any, &mut counts, &options, &AcceptAll);
            assert!(any.iter().copied().eq(hits.iter().map(Hit::is_hit)));
            structure.closest_hits(rays, &mut hits, &options, &sieve);
            structure.any_hits(rays, &mut any, &options, &sieve);
            assert!(any.iter().copied().eq(hits.iter().map(Hit::is_hit)));
        }
        let all = structure.all_hits_batch(rays, &TraceOptions::default(), &AcceptAll);
        let first = |i| all.of(i).first().copied().unwrap_or(Hit::MISS);
        assert!((0..rays.len()).map(first).eq(single.iter().copied()));
        let nearest = structure.nearest_hits_batch(rays, 2, &TraceOptions::default(), &AcceptAll);
        assert!((0..rays.len()).all(|i| nearest.of(i) == &all.of(i)[..all.of(i).len().min(2)]));
        single.iter().filter(|hit| hit.is_hit()).count()
    }};
}

/// A few triangles of every kind, some of which can never be hit.
fn mesh() -> Mesh {
    let mut mesh = soup(92, TRIANGLES, 0.5).merged(&degenerate(93, 4));
    mesh.push([Vec3::NAN, Vec3::X, Vec3::Y]);
    mesh
}

#[test]
fn every_build_traces_and_refits() {
    let (mesh, rays) = (mesh(), rays(RAYS));
    for isa in IsaLevel::available() {
        for (builder, layout) in Builder::ALL.into_iter().flat_map(|b| Layout::ALL.map(|l| (b, l)))
        {
            let options = BuildOptions {
                layout,
                quality: BuildQuality::Fast,
                builder: Some(builder),
                isa: Some(isa),
                ..BuildOptions::default()
            };
            let geometry = TriangleMesh { opaque: false, ..mesh.geometry() };
            let mut blas = Blas::build(&[geometry], &options).unwrap();
            blas.validate().unwrap();
            assert!(check!(blas, &rays) > 0);
            assert!(
                blas.triangle(0, 0).is_some()
                    && blas.triangle(0, mesh.indices.len() as u32 - 1).is_none()
            );
            let moved = mesh.clone().map(|p| p + 0.1 * Vec3::X);
            if layout == Layout::Compressed {
                assert_eq!(blas.refit(&[moved.geometry()]), Err(BuildError::CompressedRefit));
                continue;
            }
            blas.refit(&[moved.geometry()]).unwrap();
            blas.validate().unwrap();
            assert!(check!(blas, &rays) > 0);
        }
    }
}

#[test]
fn instances_trace() {
    let (mesh, rays) = (mesh(), rays(RAYS));
    for isa in IsaLevel::available() {
        let blas = Arc::new(mesh.blas(isa));
        for count in [0, 1, 11] {
            let place = |i: i32| Affine3A::from_translation(Vec3::Y * 0.1 * i as f32);
            let instances: Vec<_> = (0..count).map(|i| Instance::new(0, place(i))).collect();
            let options = BuildOptions { isa: Some(isa), ..BuildOptions::default() };
            let tlas = Tlas::build(vec![blas.clone()], &instances, &options).unwrap();
            tlas.validate().unwrap();
            let hits = check!(tlas, &rays);
            assert_eq!(hits > 0, count > 0, "{hits} hits");
        }
    }
}

#[test]
fn nothing_is_hit_in_nothing() {
    for isa in IsaLevel::available() {
        let blas = Mesh::default().blas(isa);
        assert_eq!(check!(blas, &rays(9)), 0);
    }
}
