//! Meshes that move: policies choose between refit and rebuild, and hits do not depend on it.

use std::sync::Arc;

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, Blas, BuildControl, BuildError, BuildOptions, Layout, MovingBlas, RebuildReason,
    TraceOptions, TriangleMesh, UpdateAction, UpdatePolicy, UpdateReport,
};
use rayburst_math::Ray;

use crate::meshes::{Mesh, QUALITIES, Random, ray_at, soup, sphere, with_quality};

/// A frame of a mesh that twists about an axis.
fn twisted(mesh: &Mesh, frame: usize) -> Mesh {
    let angle = 0.35 * frame as f32;
    mesh.clone().map(|p| {
        let (sin, cos) = (angle * p.y).sin_cos();
        Vec3::new(cos * p.x - sin * p.z, p.y, sin * p.x + cos * p.z)
    })
}

fn assert_same_hits(a: &Blas, b: &Blas) -> usize {
    let mut random = Random::new(211);
    let mut hits = 0;
    for _ in 0..300 {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        let hit = a.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        assert_eq!(hit, b.closest_hit(&ray, &TraceOptions::default(), &AcceptAll), "{ray:?}");
        hits += usize::from(hit.is_hit());
    }
    hits
}

/// What a policy does with some frames of a mesh that twists; hits are compared with a build's.
fn run(mesh: &Mesh, options: &BuildOptions<'_>, policy: UpdatePolicy) -> Vec<UpdateReport> {
    let mut moving = MovingBlas::build(&[mesh.geometry()], options, policy).unwrap();
    let mut hits = 0;
    let reports = (1..=12).map(|frame| {
        let now = twisted(mesh, frame);
        let report = moving.update(&[now.geometry()]).unwrap();
        moving.blas().validate().unwrap();
        assert_eq!(report.sah_cost, moving.blas().stats().sah_cost);
        let anew = Blas::build(&[now.geometry()], options).unwrap();
        assert_eq!(moving.blas().bounds(), anew.bounds());
        hits += assert_same_hits(moving.blas(), &anew);
        report
    });
    let reports = reports.collect();
    assert!(hits > 300, "{hits}");
    reports
}

fn actions(reports: &[UpdateReport]) -> Vec<UpdateAction> {
    reports.iter().map(|report| report.action).collect()
}

const fn rebuilt(reason: RebuildReason) -> UpdateAction {
    UpdateAction::Rebuild(reason)
}

#[test]
fn schedules_are_kept() {
    let mesh = soup(212, 2000, 0.08);
    for quality in QUALITIES {
        let options = with_quality(quality);
        let scheduled = rebuilt(RebuildReason::Scheduled);
        let all = run(&mesh, &options, UpdatePolicy::RebuildAlways);
        assert_eq!(actions(&all), [scheduled; 12]);
        assert!(all.iter().all(|r| r.sah_cost == r.sah_at_build && r.growth == 1.0));
        let none = run(&mesh, &options, UpdatePolicy::RefitAlways);
        assert_eq!(actions(&none), [UpdateAction::Refit; 12]);
        let worst = none.last().unwrap();
        assert!(worst.growth > 1.5 && worst.sah_cost == worst.growth * worst.sah_at_build);
        let some = run(&mesh, &options, UpdatePolicy::EveryFrames(4));
        let four = [UpdateAction::Refit, UpdateAction::Refit, UpdateAction::Refit, scheduled];
        assert_eq!(actions(&some), [four; 3].concat());
    }
}

#[test]
fn quality_never_falls_below_the_limit() {
    let mesh = soup(213, 2000, 0.08);
    for limit in [1.1, 1.3, 2.0] {
        let policy = UpdatePolicy::QualityGrowth { limit };
        let reports = run(&mesh, &BuildOptions::default(), policy);
        let mut rebuilds = 0;
        for report in &reports {
            assert!(report.sah_cost <= limit * report.sah_at_build, "{report:?}");
            let expected = if report.growth > limit {
                rebuilds += 1;
                rebuilt(RebuildReason::Quality)
            } else {
                UpdateAction::Refit
            };
            assert_eq!(report.action, expected);
        }
        assert!((1..12).contains(&rebuilds), "{rebuilds} at {limit}");
    }
}

#[test]
fn a_budget_decides_about_time_alone() {
    let mesh = soup(214, 2000, 0.08);
    let run = |seconds| run(&mesh, &BuildOptions::default(), UpdatePolicy::TimeBudget { seconds });
    assert_eq!(actions(&run(0.0)), [UpdateAction::Refit; 12]);
    for report in run(1e6) {
        let expected =
            if report.growth > 1.05 { rebuilt(RebuildReason::Budget) } else { UpdateAction::Refit };
        assert_eq!(report.action, expected);
    }
}

#[test]
fn what_a_refit_cannot_do_is_built() {
    let policy = UpdatePolicy::RefitAlways;
    let mesh = soup(215, 200, 0.2);
    let mut hole = mesh.clone();
    hole.positions[3] = Vec3::NAN;
    let mut moving =
        MovingBlas::build(&[hole.geometry()], &BuildOptions::default(), policy).unwrap();
    let mut update = |geometries: &[TriangleMesh<'_>]| {
        let action = moving.update(geometries).unwrap().action;
        let anew = Blas::build(geometries, &BuildOptions::default()).unwrap();
        assert_eq!(moving.blas().stats().primitives, anew.stats().primitives);
        assert!(assert_same_hits(moving.blas(), &anew) > 0);
        action
    };
    assert_eq!(update(&[mesh.geometry()]), rebuilt(RebuildReason::Reappeared));
    assert_eq!(update(&[hole.geometry()]), UpdateAction::Refit);
    assert_eq!(update(&[mesh.geometry()]), UpdateAction::Refit);
    let topology = rebuilt(RebuildReason::Topology);
    let other = sphere(5);
    assert_eq!(update(&[mesh.geometry(), other.geometry()]), topology);
    assert_eq!(update(&[other.geometry(), mesh.geometry()]), topology);
    let clear = TriangleMesh { opaque: false, ..other.geometry() };
    assert_eq!(update(&[clear, mesh.geometry()]), topology);
    assert_eq!(update(&[clear, mesh.geometry()]), UpdateAction::Refit);
    let compressed = BuildOptions { layout: Layout::Compressed, ..BuildOptions::default() };
    let mut moving = MovingBlas::build(&[mesh.geometry()], &compressed, policy).unwrap();
    let report = moving.update(&[mesh.geometry()]).unwrap();
    assert_eq!(report.action, rebuilt(RebuildReason::Compressed));
}

#[test]
fn triangles_come_and_go_every_frame() {
    let mut moving =
        MovingBlas::build(&[], &BuildOptions::default(), UpdatePolicy::default()).unwrap();
    for frame in 0..10 {
        let mesh = soup(216 + frame, [0, 1, 50, 400, 7][frame as usize % 5], 0.3);
        let report = moving.update(&[mesh.geometry()]).unwrap();
        assert_eq!(report.action, rebuilt(RebuildReason::Topology), "{frame}");
        let anew = Blas::build(&[mesh.geometry()], &BuildOptions::default()).unwrap();
        assert_same_hits(moving.blas(), &anew);
    }
}

#[test]
fn structures_in_use_are_left_alone() {
    let mesh = soup(217, 500, 0.2);
    let policy = UpdatePolicy::RefitAlways;
    let mut moving =
        MovingBlas::build(&[mesh.geometry()], &BuildOptions::default(), policy).unwrap();
    let place = Arc::as_ptr(moving.blas());
    moving.update(&[twisted(&mesh, 1).geometry()]).unwrap();
    assert_eq!(Arc::as_ptr(moving.blas()), place, "in place");
    let (held, copy) = (moving.blas().clone(), Blas::clone(moving.blas()));
    moving.update(&[twisted(&mesh, 5).geometry()]).unwrap();
    assert!(!Arc::ptr_eq(moving.blas(), &held));
    assert_same_hits(&held, &copy);
    let anew = Blas::build(&[twisted(&mesh, 5).geometry()], &BuildOptions::default()).unwrap();
    assert!(assert_same_hits(moving.blas(), &anew) > 20);
}

#[test]
fn an_error_leaves_the_last_frame() {
    let mesh = soup(218, 300, 0.2);
    let control = BuildControl::new();
    let options = BuildOptions { control: Some(&control), ..BuildOptions::default() };
    for policy in [UpdatePolicy::RefitAlways, UpdatePolicy::RebuildAlways] {
        let mut moving = MovingBlas::build(&[mesh.geometry()], &options, policy).unwrap();
        let old = moving.blas().clone();
        let short = TriangleMesh { positions: &mesh.positions[..800], ..mesh.geometry() };
        let error = moving.update(&[short]).unwrap_err();
        assert!(matches!(error, BuildError::IndexOutOfRange { geometry: 0, .. }));
        assert!(assert_same_hits(moving.blas(), &old) > 20);
    }
    let policy = UpdatePolicy::RebuildAlways;
    let mut moving = MovingBlas::build(&[mesh.geometry()], &options, policy).unwrap();
    let old = moving.blas().clone();
    control.cancel();
    let error = moving.update(&[twisted(&mesh, 3).geometry()]).unwrap_err();
    assert_eq!(error, BuildError::Cancelled);
    assert!(Arc::ptr_eq(moving.blas(), &old));
    let ray = Ray::new(Vec3::splat(-3.0), Vec3::ONE);
    moving.blas().any_hit(&ray, &TraceOptions::default(), &AcceptAll);
}
