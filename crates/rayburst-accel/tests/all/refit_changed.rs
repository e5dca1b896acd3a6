//! A refit of a few triangles hits what brute force and a rebuild hit, and touches little.

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, Blas, BuildError, BuildOptions, BuildQuality, Layout, TraceOptions, TriangleMesh,
};
use rayburst_math::{Hit, Ray};

use crate::{
    meshes::{Mesh, Random, all_builds, needles, ray_at, soup, sphere},
    oracle::check_closest,
};

fn build(mesh: &Mesh, options: &BuildOptions<'_>) -> Blas {
    Blas::build(&[mesh.geometry()], options).unwrap()
}

fn trace(blas: &Blas, seed: u64, count: usize) -> Vec<(Ray, Hit)> {
    let mut random = Random::new(seed);
    let rays: Vec<Ray> = (0..count).map(|_| ray_at(&mut random, Vec3::ZERO, 1.0)).collect();
    let mut hits = vec![Hit::MISS; count];
    blas.closest_hits(&rays, &mut hits, &TraceOptions::default(), &AcceptAll);
    rays.into_iter().zip(hits).collect()
}

/// Moves some triangles of a soup; returns which.
fn shake(mesh: &mut Mesh, random: &mut Random, count: usize, by: f32) -> Vec<(u32, u32)> {
    let mut moved = vec![];
    for _ in 0..count {
        let triangle = random.below(mesh.indices.len());
        let offset = by * random.vector();
        for corner in mesh.indices[triangle] {
            mesh.positions[corner as usize] += offset;
        }
        moved.push((0, triangle as u32));
    }
    moved
}

#[test]
fn random_moves_are_hit_as_brute_force_and_a_rebuild_say() {
    let wide = |options: &BuildOptions<'_>| options.layout == Layout::Wide;
    for options in all_builds().into_iter().filter(wide) {
        for (start, count) in [(soup(81, 1500, 0.1), 40), (soup(82, 700, 0.1), 700)] {
            let mut mesh = start.merged(&needles(83, 40));
            let mut random = Random::new(84);
            let mut blas = build(&mesh, &options);
            for round in 0..6 {
                let by = [0.01, 0.3, 1.0][round % 3];
                let moved = shake(&mut mesh, &mut random, count, by);
                let before = blas.stats();
                let report = blas.refit_changed(&[mesh.geometry()], &moved).unwrap();
                let proof = blas.validate().unwrap_or_else(|e| panic!("{options:?}: {e}"));
                assert_eq!(report.sah_before, before.sah_cost);
                assert_eq!(report.sah_after, blas.stats().sah_cost);
                assert!((proof.sah_cost - report.sah_after).abs() <= 1e-3 * proof.sah_cost);
                // A triangle changes the boxes from its leaves to the root at most.
                let leaves = before.references - before.primitives + moved.len();
                assert!(report.boxes_changed <= leaves * (before.depth + 1));
            }
            let rebuilt = build(&mesh, &options);
            assert!(blas.bounds().contains_box(&rebuilt.bounds()));
            let (own, other) = (trace(&blas, 85, 800), trace(&rebuilt, 85, 800));
            assert_eq!(own, other, "{options:?}");
            for (ray, hit) in &own[..200] {
                check_closest(&mesh, ray, hit).unwrap_or_else(|e| panic!("{options:?}: {e}"));
            }
            assert!(own.iter().filter(|(_, hit)| hit.is_hit()).count() > 50);
            for triangle in 0..mesh.indices.len() {
                assert_eq!(blas.triangle(0, triangle as u32), Some(mesh.triangle(triangle)));
            }
            // A whole refit makes the boxes tight again, but for those that spatial splits cut.
            let (grown, stats) = (blas.bounds().half_area(), blas.stats());
            let tight = blas.refit(&[mesh.geometry()]).unwrap();
            blas.validate().unwrap();
            assert_eq!(tight.bounds, rebuilt.bounds());
            let ratio = tight.bounds.half_area() / grown;
            assert!(
                tight.sah_after * ratio <= tight.sah_before * 1.0001
                    || stats.references > stats.primitives
            );
            assert_eq!(trace(&blas, 85, 800), own);
        }
    }
}

#[test]
fn growing_stops_at_the_first_box_that_need_not() {
    let mesh = soup(86, 4000, 0.05);
    let mut blas = build(&mesh, &BuildOptions::default());
    let everything: Vec<_> = (0..4000).map(|i| (0, i)).collect();
    // Nothing moved, and nothing grew.
    let report = blas.refit_changed(&[mesh.geometry()], &everything).unwrap();
    assert_eq!((report.boxes_changed, report.sah_after), (0, report.sah_before));
    assert_eq!(blas.refit_changed(&[mesh.geometry()], &[]).unwrap().boxes_changed, 0);
    // Smaller triangles are in the old boxes.
    let mut smaller = mesh.clone();
    for i in 0..4000 {
        let [a, b, c] = mesh.triangle(i);
        smaller.positions[3 * i + 1] = a + 0.5 * (b - a);
        smaller.positions[3 * i + 2] = a + 0.5 * (c - a);
    }
    let report = blas.refit_changed(&[smaller.geometry()], &everything).unwrap();
    assert_eq!(report.boxes_changed, 0);
    assert_eq!(trace(&blas, 87, 500), trace(&build(&smaller, &BuildOptions::default()), 87, 500));
    // One that goes far away changes each box above it, and the bounds.
    let mut blas = build(&mesh, &BuildOptions::default());
    let mut far = mesh.clone();
    (0..3).for_each(|corner| far.positions[3 * 99 + corner] += Vec3::splat(50.0));
    let report = blas.refit_changed(&[far.geometry()], &[(0, 99), (0, 99)]).unwrap();
    assert!((3..=blas.stats().depth + 1).contains(&report.boxes_changed), "{report:?}");
    assert!(report.bounds == blas.bounds() && report.bounds.upper.x > 40.0);
    // Moves by next to nothing stop far below the root.
    let (mut blas, mut near) = (build(&mesh, &BuildOptions::default()), mesh.clone());
    let moved = shake(&mut near, &mut Random::new(88), 100, 1e-4);
    let report = blas.refit_changed(&[near.geometry()], &moved).unwrap();
    assert!((30..=250).contains(&report.boxes_changed), "{report:?}");
}

#[test]
fn changed_triangles_vanish_and_come_back() {
    for quality in [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::Best] {
        let options = BuildOptions { quality, ..BuildOptions::default() };
        let mesh = soup(89, 500, 0.3).merged(&needles(90, 30));
        let mut blas = build(&mesh, &options);
        let mut broken = mesh.clone();
        let some: Vec<(u32, u32)> = (0..400).map(|i| (0, i)).collect();
        for i in 0..400 {
            broken.positions[3 * i] = [Vec3::NAN, broken.positions[3 * i + 1]][i % 2];
        }
        for _ in 0..2 {
            blas.refit_changed(&[broken.geometry()], &some).unwrap();
            blas.validate().unwrap();
            assert_eq!((blas.stats().primitives, blas.stats().inactive), (130, 400));
            assert_eq!(blas.triangle(0, 0), None);
        }
        assert_eq!(trace(&blas, 91, 500), trace(&build(&broken, &options), 91, 500));
        // After all boxes were made tight they grow again.
        blas.refit(&[broken.geometry()]).unwrap();
        blas.refit_changed(&[mesh.geometry()], &some).unwrap();
        blas.validate().unwrap();
        assert_eq!((blas.stats().primitives, blas.stats().inactive), (530, 0));
        assert_eq!(trace(&blas, 91, 500), trace(&build(&mesh, &options), 91, 500));
        // None is left, then all are back.
        let all: Vec<(u32, u32)> = (0..530).map(|i| (0, i)).collect();
        let nothing = mesh.clone().map(|_| Vec3::ONE);
        blas.refit_changed(&[nothing.geometry()], &all).unwrap();
        blas.validate().unwrap();
        assert!(blas.stats().primitives == 0 && trace(&blas, 91, 99).iter().all(|h| !h.1.is_hit()));
        assert!(blas.refit(&[nothing.geometry()]).unwrap().bounds.is_empty());
        blas.refit_changed(&[mesh.geometry()], &all).unwrap();
        blas.validate().unwrap();
        assert_eq!(trace(&blas, 91, 500), trace(&build(&mesh, &options), 91, 500));
    }
}

#[test]
fn what_cannot_change_is_an_error_and_changes_nothing() {
    let mut mesh = soup(92, 50, 0.3);
    mesh.push([Vec3::ZERO; 3]);
    let mut blas = build(&mesh, &BuildOptions::default());
    let mut moved = mesh.clone().map(|p| p + Vec3::X);
    let last = moved.positions.len() - 1;
    moved.positions[last] = Vec3::Y;
    moved.positions[last - 1] = Vec3::Z;
    let old = blas.clone();
    let mut refit = |geometries: &[TriangleMesh<'_>], changed: &[(u32, u32)]| {
        let error = blas.refit_changed(geometries, changed).unwrap_err();
        assert_eq!(blas.stats(), old.stats());
        assert_eq!(trace(&blas, 93, 300), trace(&old, 93, 300));
        error
    };
    let whole = [moved.geometry()];
    let reappeared = BuildError::Reappeared { geometry: 0, primitive: 50 };
    assert_eq!(refit(&whole, &[(0, 3), (0, 50)]), reappeared);
    let none = BuildError::NoSuchTriangle { geometry: 0, primitive: 51 };
    assert_eq!(refit(&whole, &[(0, 3), (0, 51)]), none);
    let none = BuildError::NoSuchTriangle { geometry: 1, primitive: 0 };
    assert_eq!(refit(&whole, &[(0, 3), (1, 0)]), none);
    let none = BuildError::NoSuchTriangle { geometry: 0, primitive: u32::MAX };
    assert_eq!(refit(&whole, &[(0, u32::MAX)]), none);
    let short = TriangleMesh { positions: &moved.positions[..100], ..moved.geometry() };
    assert!(matches!(
        refit(&[short], &[(0, 3), (0, 40)]),
        BuildError::IndexOutOfRange { geometry: 0, primitive: 40, index: 120, vertices: 100 }
    ));
    assert_eq!(refit(&[], &[]), BuildError::GeometriesDiffer { built: 1, given: 0 });
    let fewer = TriangleMesh { indices: &moved.indices[..9], ..moved.geometry() };
    let differ = BuildError::TrianglesDiffer { geometry: 0, built: 51, given: 9 };
    assert_eq!(refit(&[fewer], &[]), differ);
    let options = BuildOptions { layout: Layout::Compressed, ..BuildOptions::default() };
    let mut compressed = build(&mesh, &options);
    let error = compressed.refit_changed(&[moved.geometry()], &[(0, 3)]);
    assert_eq!(error, Err(BuildError::CompressedRefit));
    // What still cannot be hit is no error.
    blas.refit_changed(&[mesh.geometry()], &[(0, 50)]).unwrap();
    let mut empty = Blas::build(&[], &BuildOptions::default()).unwrap();
    assert!(empty.refit_changed(&[], &[]).unwrap().bounds.is_empty());
}

#[test]
fn geometries_and_transforms_are_kept() {
    let (a, before) = (sphere(8), soup(94, 300, 0.2));
    let after = before.clone().map(|p| 0.9 * p);
    let shift = glam::Affine3A::from_translation(Vec3::new(0.1, 0.2, 0.3));
    let (old, new) = (before.geometry(), after.geometry());
    let (old, new) = (
        TriangleMesh { transform: Some(shift), ..old },
        TriangleMesh { transform: Some(shift), ..new },
    );
    let options = BuildOptions::default();
    let mut blas = Blas::build(&[a.geometry(), old], &options).unwrap();
    let changed: Vec<(u32, u32)> = (0..300).map(|i| (1, i)).collect();
    blas.refit_changed(&[a.geometry(), new], &changed).unwrap();
    blas.validate().unwrap();
    let rebuilt = Blas::build(&[a.geometry(), new], &options).unwrap();
    assert_eq!(trace(&blas, 95, 900), trace(&rebuilt, 95, 900));
}
