//! A refit hits what a rebuild hits, and refuses what it cannot do.

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, Blas, BuildError, BuildOptions, BuildQuality, TraceOptions, TriangleMesh,
};
use rayburst_math::Ray;

use crate::meshes::{Mesh, Random, ray_at, soup, sphere};

const ANY: TraceOptions = TraceOptions::DEFAULT;

fn build(mesh: &Mesh, quality: BuildQuality) -> Blas {
    let options = BuildOptions { quality, ..BuildOptions::default() };
    Blas::build(&[mesh.geometry()], &options).unwrap()
}

fn assert_same_hits(a: &Blas, b: &Blas) -> usize {
    let mut random = Random::new(71);
    let rays: Vec<Ray> = (0..2000).map(|_| ray_at(&mut random, Vec3::ZERO, 1.0)).collect();
    for ray in &rays {
        let (a, b) = (a.closest_hit(ray, &ANY, &AcceptAll), b.closest_hit(ray, &ANY, &AcceptAll));
        assert_eq!(a, b, "{ray:?}");
    }
    rays.iter().filter(|ray| a.any_hit(ray, &ANY, &AcceptAll)).count()
}

fn twist(p: Vec3) -> Vec3 {
    let (sin, cos) = (1.5 * p.y).sin_cos();
    Vec3::new(cos * p.x - sin * p.z, 0.8 * p.y, sin * p.x + cos * p.z)
}

#[test]
fn a_refit_hits_what_a_rebuild_hits() {
    for quality in [BuildQuality::Fast, BuildQuality::Balanced] {
        for mesh in [soup(70, 30_000, 0.03), sphere(24), soup(72, 3, 1.0), soup(73, 60, 0.3)] {
            let moved = mesh.clone().map(twist);
            let mut blas = build(&mesh, quality);
            let (before, bounds) = (blas.stats(), blas.bounds());
            let report = blas.refit(&[moved.geometry()]).unwrap();
            let proof = blas.validate().unwrap();
            assert!((proof.sah_cost - report.sah_after).abs() <= 1e-4 * proof.sah_cost);
            assert_eq!(report.sah_before, before.sah_cost);
            assert!(report.boxes_changed > 0 && report.bounds == blas.bounds());
            let rebuilt = build(&moved, quality);
            assert_eq!(report.bounds, rebuilt.bounds());
            assert!(assert_same_hits(&blas, &rebuilt) > 20);
            assert_eq!(blas.triangle(0, 1), Some(moved.triangle(1)));
            // Back again all boxes are those of the build.
            let back = blas.refit(&[mesh.geometry()]).unwrap();
            assert_eq!(back.bounds, bounds);
            assert!((back.sah_after - before.sah_cost).abs() <= 1e-5 * before.sah_cost);
            assert_eq!(blas.refit(&[mesh.geometry()]).unwrap().boxes_changed, 0);
        }
    }
}

#[test]
fn triangles_vanish_and_come_back() {
    let mesh = soup(74, 500, 0.3);
    let mut blas = build(&mesh, BuildQuality::Balanced);
    let mut broken = mesh.clone();
    for i in 0..400 {
        // All corners of some, whole leaves among them.
        broken.positions[3 * i] = [Vec3::NAN, broken.positions[3 * i + 1]][i % 2];
    }
    blas.refit(&[broken.geometry()]).unwrap();
    blas.validate().unwrap();
    assert_eq!((blas.stats().primitives, blas.stats().inactive), (100, 400));
    assert_eq!((blas.triangle(0, 0), blas.triangle(0, 1)), (None, None));
    assert!(assert_same_hits(&blas, &build(&broken, BuildQuality::Balanced)) > 100);
    // None is left.
    let nothing = mesh.clone().map(|_| Vec3::ONE);
    let report = blas.refit(&[nothing.geometry()]).unwrap();
    blas.validate().unwrap();
    assert!(report.bounds.is_empty() && report.sah_after == 0.0);
    assert_eq!(assert_same_hits(&blas, &build(&nothing, BuildQuality::Balanced)), 0);
    blas.refit(&[mesh.geometry()]).unwrap();
    assert_eq!((blas.stats().primitives, blas.stats().inactive), (500, 0));
    assert!(assert_same_hits(&blas, &build(&mesh, BuildQuality::Balanced)) > 100);
}

#[test]
fn what_a_refit_cannot_do_is_an_error_and_changes_nothing() {
    let mut mesh = soup(75, 50, 0.3);
    mesh.push([Vec3::ZERO; 3]);
    let mut blas = build(&mesh, BuildQuality::Balanced);
    let old = blas.clone();
    let mut whole = mesh.clone();
    let last = whole.positions.len() - 1;
    whole.positions[last] = Vec3::X;
    whole.positions[last - 1] = Vec3::Y;
    assert_eq!(
        blas.refit(&[whole.geometry()]).unwrap_err(),
        BuildError::Reappeared { geometry: 0, primitive: 50 }
    );
    let fewer = TriangleMesh { indices: &mesh.indices[..50], ..mesh.geometry() };
    assert_eq!(
        blas.refit(&[fewer]).unwrap_err(),
        BuildError::TrianglesDiffer { geometry: 0, built: 51, given: 50 }
    );
    assert_eq!(blas.refit(&[]).unwrap_err(), BuildError::GeometriesDiffer { built: 1, given: 0 });
    let short = TriangleMesh { positions: &mesh.positions[..100], ..mesh.geometry() };
    assert!(matches!(
        blas.refit(&[short]).unwrap_err(),
        BuildError::IndexOutOfRange { geometry: 0, primitive: 33, .. }
    ));
    assert_eq!(blas.stats(), old.stats());
    assert_same_hits(&blas, &old);
    let mut empty = Blas::build(&[], &BuildOptions::default()).unwrap();
    assert!(empty.refit(&[]).unwrap().bounds.is_empty());
    empty.validate().unwrap();
}

#[test]
fn a_refit_does_not_depend_on_threads() {
    let mesh = soup(76, 40_000, 0.02);
    let moved = mesh.clone().map(twist);
    let refit = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut blas = build(&mesh, BuildQuality::Fast);
            let report = blas.refit(&[moved.geometry()]).unwrap();
            (report, blas.validate().unwrap())
        })
    };
    let one = refit(1);
    assert!(one == refit(2) && one == refit(7));
}
