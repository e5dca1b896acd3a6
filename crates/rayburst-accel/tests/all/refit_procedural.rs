//! A refit of boxes meets what a rebuild meets, and refuses what it cannot do.

use std::{ops::ControlFlow, sync::Arc};

use glam::{Affine3A, Vec3, Vec3Swizzles};
use rayburst_accel::{
    AcceptAll, Blas, BuildError, BuildOptions, BuildQuality, Geometry, GeometryKind, Instance,
    Layout, MovingBlas, ProceduralBoxes, ProceduralCandidate, RebuildReason, Tlas, TraceOptions,
    TriangleMesh, UpdateAction, UpdatePolicy,
};
use rayburst_math::{Aabb, Ray};

use crate::{
    meshes::{QUALITIES, Random, ray_at, soup},
    mixed::{Part, blas, random_boxes, sphere_hits, spheres},
};

const ANY: TraceOptions = TraceOptions::DEFAULT;
/// A box that is never met.
const NOWHERE: Aabb = Aabb::EMPTY;

/// All candidates of a ray, sorted.
fn candidates(blas: &Blas, ray: &Ray) -> Vec<(u32, u32, bool)> {
    let mut found = vec![];
    let mut visit = |c: &ProceduralCandidate, t_max| {
        found.push((c.geometry, c.primitive, c.opaque));
        ControlFlow::Continue(t_max)
    };
    blas.procedural_candidates(ray, &ANY, &mut visit);
    found.sort_unstable();
    found
}

/// The nearest sphere in the boxes of a ray.
fn nearest(blas: &Blas, boxes: &[&[Aabb]], ray: &Ray) -> Option<(f32, u32, u32)> {
    let mut best: Option<(f32, u32, u32)> = None;
    let mut visit = |c: &ProceduralCandidate, t_max: f32| {
        let bounds = boxes[c.geometry as usize][c.primitive as usize];
        let hits = sphere_hits(&bounds, ray).into_iter().flatten();
        let t = hits.filter(|&t| t >= ray.t_min && t <= t_max).fold(f32::INFINITY, f32::min);
        let hit = (t, c.geometry, c.primitive);
        if t < f32::INFINITY && best.is_none_or(|best| hit < best) {
            best = Some(hit);
        }
        ControlFlow::Continue(best.map_or(t_max, |best| best.0))
    };
    blas.procedural_candidates(ray, &ANY, &mut visit);
    best
}

/// Compares two structures; gives how many candidates there were.
fn assert_same(a: &Blas, b: &Blas) -> usize {
    let mut random = Random::new(281);
    let mut count = 0;
    for _ in 0..500 {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.2);
        let found = candidates(a, &ray);
        assert_eq!(found, candidates(b, &ray), "{ray:?}");
        let (a, b) = (a.closest_hit(&ray, &ANY, &AcceptAll), b.closest_hit(&ray, &ANY, &AcceptAll));
        assert_eq!(a, b, "{ray:?}");
        count += found.len();
    }
    count
}

fn moved(boxes: &[Aabb], frame: f32) -> Vec<Aabb> {
    let place = |p: Vec3| {
        let angle = frame * 0.3 * p.y;
        let (sin, cos) = angle.sin_cos();
        Vec3::new(cos * p.x - sin * p.z, p.y, sin * p.x + cos * p.z)
    };
    let move_one = |b: &Aabb| {
        // What can never be met stays so.
        let size = b.lower.abs().max(b.upper.abs()).max_element();
        if size.is_nan() || size >= 10.0 {
            return *b;
        }
        let centre = 0.5 * (b.lower + b.upper);
        let by = place(centre) - centre;
        Aabb { lower: b.lower + by, upper: b.upper + by }
    };
    boxes.iter().map(move_one).collect()
}

fn of_quality(quality: BuildQuality) -> BuildOptions<'static> {
    BuildOptions { quality, ..BuildOptions::default() }
}

#[test]
fn a_refit_of_boxes_meets_what_a_rebuild_meets() {
    for quality in QUALITIES {
        for (first, second) in [(2000, 500), (40, 1), (1, 0), (0, 0)] {
            let parts = |frame| {
                [
                    Part::Boxes(moved(&random_boxes(270, first, 0.2), frame), true),
                    Part::Boxes(moved(&random_boxes(271, second, 0.4), frame), false),
                ]
            };
            let (before, after) = (parts(0.0), parts(2.0));
            let [Part::Boxes(a, _), Part::Boxes(b, _)] = &after else { panic!("boxes") };
            let mut refitted = blas(&before, &of_quality(quality));
            let old = refitted.stats();
            let given = [ProceduralBoxes::new(a), ProceduralBoxes::new(b)];
            let report = refitted.refit_procedural(&given).unwrap();
            let rebuilt = blas(&after, &of_quality(quality));
            let met = assert_same(&refitted, &rebuilt);
            assert!(met > 20 || first <= 1, "{met}");
            let proof = refitted.validate().unwrap();
            assert_eq!(proof.primitives, rebuilt.stats().primitives);
            assert_eq!((report.bounds, refitted.bounds()), (rebuilt.bounds(), rebuilt.bounds()));
            assert_eq!(report.sah_before, old.sah_cost);
            assert_eq!(report.sah_after, refitted.stats().sah_cost);
            assert!((proof.sah_cost - report.sah_after).abs() <= 1e-4 * proof.sah_cost);
            assert_eq!(refitted.geometries(), rebuilt.geometries());
            assert_eq!(refitted.refit_procedural(&given).unwrap().boxes_changed, 0);
        }
    }
}

#[test]
fn spheres_that_move_are_hit_where_they_are() {
    let before = [spheres(272, 700, 0.05), spheres(273, 300, 0.1)];
    let options = BuildOptions::default();
    let mut refitted = blas(&before.clone().map(|boxes| Part::Boxes(boxes, true)), &options);
    for frame in 1..6 {
        let now = before.each_ref().map(|boxes| moved(boxes, frame as f32));
        let given = now.each_ref().map(|boxes| ProceduralBoxes::new(boxes));
        let report = refitted.refit_procedural(&given).unwrap();
        assert!(report.boxes_changed > 500);
        let rebuilt = blas(&now.clone().map(|boxes| Part::Boxes(boxes, true)), &options);
        let boxes = now.each_ref().map(|boxes| &boxes[..]);
        let (mut random, mut hits) = (Random::new(274), 0);
        for _ in 0..500 {
            let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
            let hit = nearest(&refitted, &boxes, &ray);
            assert_eq!(hit, nearest(&rebuilt, &boxes, &ray), "{ray:?}");
            hits += usize::from(hit.is_some());
        }
        assert!(hits > 100, "{hits}");
    }
}

#[test]
fn boxes_vanish_and_come_back() {
    let whole = spheres(275, 300, 0.2);
    let mut refitted = blas(&[Part::Boxes(whole.clone(), true)], &BuildOptions::default());
    let nan = Vec3::splat(f32::NAN);
    let nothings = [
        NOWHERE,
        Aabb { lower: nan, upper: Vec3::ONE },
        Aabb { lower: Vec3::ONE, upper: Vec3::NEG_ONE },
        Aabb { lower: Vec3::splat(-2e18), upper: Vec3::ONE },
        Aabb { lower: Vec3::ZERO, upper: Vec3::splat(f32::INFINITY) },
    ];
    let broken = whole.iter().zip(0..).map(|(b, i)| if i < 250 { nothings[i % 5] } else { *b });
    let broken: Vec<_> = broken.collect();
    refitted.refit_procedural(&[ProceduralBoxes::new(&broken)]).unwrap();
    refitted.validate().unwrap();
    assert_eq!((refitted.stats().primitives, refitted.stats().inactive), (50, 250));
    let rebuilt = blas(&[Part::Boxes(broken, true)], &BuildOptions::default());
    assert_eq!(refitted.bounds(), rebuilt.bounds());
    assert!(assert_same(&refitted, &rebuilt) > 20);
    // Points can be met.
    let points: Vec<_> = whole.iter().map(|b| Aabb::of_point(b.lower)).collect();
    refitted.refit_procedural(&[ProceduralBoxes::new(&points)]).unwrap();
    assert_eq!(refitted.stats().primitives, 300);
    assert_same(&refitted, &blas(&[Part::Boxes(points, true)], &BuildOptions::default()));
    // None is left.
    let none = vec![NOWHERE; 300];
    let report = refitted.refit_procedural(&[ProceduralBoxes::new(&none)]).unwrap();
    assert!(report.bounds.is_empty() && report.sah_after == 0.0 && refitted.bounds().is_empty());
    refitted.validate().unwrap();
    assert_eq!(
        assert_same(&refitted, &blas(&[Part::Boxes(none, true)], &BuildOptions::default())),
        0
    );
    refitted.refit_procedural(&[ProceduralBoxes::new(&whole)]).unwrap();
    let rebuilt = blas(&[Part::Boxes(whole, true)], &BuildOptions::default());
    assert_eq!(refitted.stats().primitives, 300);
    assert!(assert_same(&refitted, &rebuilt) > 100);
}

#[test]
fn boxes_alone_and_triangles_alone_and_both_are_refitted() {
    let parts = |boxes: f32, triangles: bool| {
        let mesh = soup(276, 300, 0.2);
        let mesh = if triangles { mesh.map(|p| p.yzx() * 1.25 + 0.25) } else { mesh };
        [
            Part::Boxes(moved(&spheres(277, 200, 0.2), boxes), false),
            Part::Triangles(mesh, true),
            Part::Boxes(moved(&spheres(278, 100, 0.1), boxes), true),
        ]
    };
    for layout in Layout::ALL {
        let options = BuildOptions { layout, ..BuildOptions::default() };
        let mut refitted = blas(&parts(0.0, false), &options);
        let alone = parts(2.0, false);
        let boxes = alone.each_ref().map(|part| match part {
            Part::Boxes(boxes, _) => ProceduralBoxes::new(boxes),
            Part::Triangles(..) => ProceduralBoxes::new(&[]),
        });
        refitted.refit_procedural(&boxes).unwrap();
        refitted.validate().unwrap();
        assert!(assert_same(&refitted, &blas(&alone, &options)) > 100);
        let both = parts(3.0, true);
        let given = both.each_ref().map(Part::geometry);
        let sum = refitted.stats().sah_cost;
        match refitted.refit_geometries(&given) {
            Err(error) => {
                assert_eq!((error, layout), (BuildError::CompressedRefit, Layout::Compressed))
            }
            Ok(report) => {
                assert_eq!(report.sah_before, sum);
                assert_eq!(report.sah_after, refitted.stats().sah_cost);
                assert_eq!(report.bounds, refitted.bounds());
                assert!(assert_same(&refitted, &blas(&both, &options)) > 100);
            }
        }
    }
}

#[test]
fn what_a_refit_of_boxes_cannot_do_is_an_error_and_changes_nothing() {
    let mut boxes = spheres(279, 50, 0.3);
    let whole = boxes.clone();
    boxes[20] = NOWHERE;
    let triangles = soup(280, 20, 0.3);
    let parts = [Part::Triangles(triangles.clone(), true), Part::Boxes(boxes.clone(), true)];
    let mut refitted = blas(&parts, &BuildOptions::default());
    let old = refitted.clone();
    let none = ProceduralBoxes::new(&[]);
    let mut refuse = |given: &[ProceduralBoxes<'_>], expected: BuildError, says: &str| {
        let error = refitted.refit_procedural(given).unwrap_err();
        assert_eq!(error, expected);
        assert!(error.to_string().contains(says), "{error}");
        assert_eq!((refitted.stats(), refitted.bounds()), (old.stats(), old.bounds()));
        assert_same(&refitted, &old);
    };
    let reappeared = BuildError::BoxReappeared { geometry: 1, primitive: 20 };
    refuse(&[none, ProceduralBoxes::new(&whole)], reappeared, "primitive 20 of geometry 1");
    let fewer = BuildError::BoxesDiffer { geometry: 1, built: 50, given: 49 };
    refuse(&[none, ProceduralBoxes::new(&boxes[1..])], fewer, "49 boxes in geometry 1");
    let swapped = BuildError::BoxesDiffer { geometry: 0, built: 0, given: 50 };
    refuse(&[ProceduralBoxes::new(&boxes), none], swapped, "50 boxes in geometry 0");
    refuse(&[none], BuildError::GeometriesDiffer { built: 2, given: 1 }, "1 geometries");
    let (mesh, boxes) = (triangles.geometry(), ProceduralBoxes::new(&boxes));
    let error = refitted.refit_geometries(&[boxes.into(), mesh.into()]).unwrap_err();
    let (built, given) = (GeometryKind::Triangles, GeometryKind::Procedural);
    assert_eq!(error, BuildError::KindsDiffer { geometry: 0, built, given });
    // Wrong triangles leave the boxes where they were, too.
    let far: Vec<_> = moved(boxes.boxes, 3.0);
    let short = TriangleMesh { positions: &triangles.positions[..3], ..mesh };
    let error = refitted.refit_geometries(&[short.into(), ProceduralBoxes::new(&far).into()]);
    assert!(matches!(error, Err(BuildError::IndexOutOfRange { .. })));
    assert_eq!((refitted.stats(), refitted.bounds()), (old.stats(), old.bounds()));
    assert_same(&refitted, &old);
    let mut empty = Blas::of_geometries(&[], &BuildOptions::default()).unwrap();
    assert!(empty.refit_procedural(&[]).unwrap().bounds.is_empty());
    assert!(empty.refit_geometries(&[]).unwrap().bounds.is_empty());
}

/// Boxes that move apart make the tree worse, and the report says by how much.
#[test]
fn the_policy_covers_boxes() {
    fn geometry(boxes: &[Aabb]) -> Geometry<'_> {
        ProceduralBoxes::new(boxes).into()
    }
    let start = spheres(282, 1000, 0.05);
    let options = BuildOptions::default();
    for (limit, least) in [(1.2, 2), (1e9, 0)] {
        let policy = UpdatePolicy::QualityGrowth { limit };
        let mut moving = MovingBlas::of_geometries(&[geometry(&start)], &options, policy).unwrap();
        let (mut rebuilds, mut worst) = (0, 1.0f32);
        for frame in 1..12 {
            let now = moved(&start, frame as f32);
            let report = moving.update_geometries(&[geometry(&now)]).unwrap();
            let rebuilt = UpdateAction::Rebuild(RebuildReason::Quality);
            assert_eq!(report.action == rebuilt, report.growth > limit, "{report:?}");
            assert!(report.sah_cost <= limit * report.sah_at_build);
            rebuilds += usize::from(report.action == rebuilt);
            worst = worst.max(report.growth);
            let anew = Blas::of_geometries(&[geometry(&now)], &options).unwrap();
            assert!(assert_same(moving.blas(), &anew) > 100);
        }
        assert!(rebuilds >= least && (rebuilds > 0) == (least > 0), "{rebuilds}");
        assert!(worst > 1.2, "{worst}");
    }
    let policy = UpdatePolicy::RefitAlways;
    let mut hole = start.clone();
    hole[7] = NOWHERE;
    let compressed = BuildOptions { layout: Layout::Compressed, ..options };
    let mut moving = MovingBlas::of_geometries(&[geometry(&hole)], &compressed, policy).unwrap();
    let mut update =
        |boxes: ProceduralBoxes<'_>| moving.update_geometries(&[boxes.into()]).unwrap().action;
    assert_eq!(update(ProceduralBoxes::new(&hole)), UpdateAction::Refit);
    let rebuilt = UpdateAction::Rebuild;
    assert_eq!(update(ProceduralBoxes::new(&start)), rebuilt(RebuildReason::Reappeared));
    assert_eq!(update(ProceduralBoxes::new(&start[1..])), rebuilt(RebuildReason::Topology));
    let clear = ProceduralBoxes { opaque: false, ..ProceduralBoxes::new(&start[1..]) };
    assert_eq!(update(clear), rebuilt(RebuildReason::Topology));
    assert_eq!(update(clear), UpdateAction::Refit);
}

/// Instances over a refitted structure meet what instances over a new one meet.
#[test]
fn instances_of_refitted_boxes() {
    let (start, now) = (spheres(283, 100, 0.1), moved(&spheres(283, 100, 0.1), 3.0));
    let options = BuildOptions::default();
    let mut refitted = blas(&[Part::Boxes(start, true)], &options);
    refitted.refit_procedural(&[ProceduralBoxes::new(&now)]).unwrap();
    let rebuilt = blas(&[Part::Boxes(now, true)], &options);
    let instances = [0.0, 2.5].map(|x| Instance::new(0, Affine3A::from_translation(Vec3::X * x)));
    let tlas = |blas| Tlas::build(vec![Arc::new(blas)], &instances, &options).unwrap();
    let (a, b) = (tlas(refitted), tlas(rebuilt));
    a.validate().unwrap();
    let (mut random, mut count) = (Random::new(284), 0);
    for _ in 0..300 {
        let ray = ray_at(&mut random, Vec3::X, 2.0);
        let found = |tlas: &Tlas| {
            let mut found = vec![];
            let mut visit = |c: &ProceduralCandidate, t_max| {
                found.push((c.instance, c.geometry, c.primitive));
                ControlFlow::Continue(t_max)
            };
            tlas.procedural_candidates(&ray, &ANY, &mut visit);
            found.sort_unstable();
            found
        };
        assert_eq!(found(&a), found(&b));
        count += found(&a).len();
    }
    assert!(count > 100, "{count}");
}
