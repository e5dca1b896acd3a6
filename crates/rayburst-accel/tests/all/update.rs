//! Instances that move: an update hits what a rebuild hits, and touches no BLAS.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Quat, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildError, BuildOptions, BuildQuality, Cull, Instance, InstanceFlags, Tlas,
    TraceOptions,
};
use rayburst_math::Ray;

use crate::meshes::{Random, ray_at, soup, sphere, with_quality};

const QUALITIES: [BuildQuality; 2] = [BuildQuality::Fast, BuildQuality::Balanced];

fn blases() -> Vec<Arc<Blas>> {
    let parts = [soup(201, 40, 0.4), sphere(5)];
    let build = |mesh: &crate::meshes::Mesh| {
        Arc::new(Blas::build(&[mesh.geometry()], &BuildOptions::default()).unwrap())
    };
    parts.iter().map(build).collect()
}

/// A transform of any kind: rigid, stretched, mirrored, sheared.
fn transform(random: &mut Random) -> Affine3A {
    let rotation = Mat3::from_quat(Quat::from_scaled_axis(3.0 * random.vector()));
    let shape = match random.below(4) {
        0 => Mat3::IDENTITY,
        1 => Mat3::from_diagonal(Vec3::new(0.3, 1.2, -0.7)),
        2 => Mat3::from_cols(Vec3::X, Vec3::new(0.8, 1.0, 0.0), Vec3::new(-0.5, 0.3, -0.6)),
        _ => Mat3::from_diagonal(Vec3::splat(0.5)),
    };
    Affine3A::from_mat3_translation(0.3 * rotation * shape, 2.0 * random.vector())
}

/// One of several ways in which an instance cannot be hit.
fn hidden(random: &mut Random) -> Affine3A {
    match random.below(3) {
        0 => Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)),
        1 => Affine3A::from_translation(Vec3::new(0.0, f32::NAN, 0.0)),
        _ => Affine3A::from_translation(Vec3::splat(1e30)),
    }
}

fn instances(random: &mut Random, count: usize) -> Vec<Instance> {
    (0..count).map(|i| Instance::new(i as u32 % 2, transform(random))).collect()
}

/// New transforms, masks and flags; some instances hide, all but one if `most` do.
fn moved(random: &mut Random, instances: &[Instance], most: bool) -> Vec<Instance> {
    let seen = random.below(instances.len());
    let of = |(i, old): (usize, &Instance)| {
        let hides = i != seen && (most || random.below(5) == 0);
        Instance {
            transform: if hides { hidden(random) } else { transform(random) },
            mask: [0xFF, 1, 2][random.below(3)],
            flags: InstanceFlags {
                cull_disable: random.below(2) == 0,
                front_clockwise: random.below(2) == 0,
                force_opaque: [None, Some(true), Some(false)][random.below(3)],
            },
            ..*old
        }
    };
    instances.iter().enumerate().map(of).collect()
}

/// Compares all answers to some rays; returns how many hit.
fn assert_same_hits(a: &Tlas, b: &Tlas, random: &mut Random, count: usize) -> usize {
    let rays: Vec<Ray> = (0..count).map(|_| ray_at(random, Vec3::ZERO, 2.0)).collect();
    let mut hits = 0;
    for (mask, cull) in [(0xFF, Cull::None), (1, Cull::Back)] {
        let options = TraceOptions { mask, cull, ..TraceOptions::default() };
        for ray in &rays {
            let [one, other] = [a, b].map(|tlas| tlas.closest_hit(ray, &options, &AcceptAll));
            assert_eq!(one, other, "{ray:?}");
            assert_eq!(a.any_hit(ray, &options, &AcceptAll), one.is_hit());
            hits += usize::from(one.is_hit());
        }
    }
    hits
}

#[test]
fn an_update_is_what_a_rebuild_would_be() {
    let blases = blases();
    let mut random = Random::new(202);
    let mut hits = 0;
    for quality in QUALITIES {
        let options = with_quality(quality);
        for count in [1, 2, 7, 100, 700] {
            let first = instances(&mut random, count);
            let mut tlas = Tlas::build(blases.clone(), &first, &options).unwrap();
            let sah_at_build = tlas.stats().sah_cost;
            for frame in 0..8 {
                let now = moved(&mut random, &first, frame == 5);
                let before = tlas.stats().sah_cost;
                let report = tlas.update(&now).unwrap();
                let rebuilt = Tlas::build(blases.clone(), &now, &options).unwrap();
                let proof = tlas.validate().unwrap();
                assert!((proof.sah_cost - report.sah_after).abs() <= 1e-4 * proof.sah_cost);
                assert_eq!((report.sah_before, report.sah_after), (before, tlas.stats().sah_cost));
                assert_eq!((report.bounds, tlas.bounds()), (rebuilt.bounds(), rebuilt.bounds()));
                let counts = [&tlas, &rebuilt].map(|tlas| {
                    let stats = tlas.stats();
                    (stats.primitives, stats.inactive, stats.references)
                });
                assert_eq!(counts[0], counts[1]);
                for i in 0..count as u32 {
                    assert_eq!(tlas.world_to_object(i), rebuilt.world_to_object(i));
                }
                hits += assert_same_hits(&tlas, &rebuilt, &mut random, 100);
            }
            let report = tlas.update(&first).unwrap();
            assert!((report.sah_after - sah_at_build).abs() <= 1e-5 * sah_at_build);
            assert_eq!(tlas.update(&first).unwrap().boxes_changed, 0);
            let rebuilt = Tlas::build(blases.clone(), &first, &options).unwrap();
            hits += assert_same_hits(&tlas, &rebuilt, &mut random, 100);
        }
    }
    assert!(hits > 2000, "{hits}");
}

#[test]
fn all_instances_may_vanish_and_come_back() {
    for quality in QUALITIES {
        let mut random = Random::new(203);
        let shown = instances(&mut random, 80);
        let mut tlas = Tlas::build(blases(), &shown, &with_quality(quality)).unwrap();
        let none: Vec<Instance> =
            shown.iter().map(|i| Instance { transform: hidden(&mut random), ..*i }).collect();
        let report = tlas.update(&none).unwrap();
        tlas.validate().unwrap();
        assert!(report.bounds.is_empty() && report.sah_after == 0.0);
        assert_eq!((tlas.stats().primitives, tlas.stats().inactive), (0, 80));
        let ray = Ray::new(Vec3::splat(-9.0), Vec3::ONE);
        assert!(!tlas.any_hit(&ray, &TraceOptions::default(), &AcceptAll));
        tlas.update(&shown).unwrap();
        let rebuilt = Tlas::build(blases(), &shown, &with_quality(quality)).unwrap();
        assert!(assert_same_hits(&tlas, &rebuilt, &mut random, 300) > 100);
    }
    let mut empty = Tlas::build(vec![], &[], &BuildOptions::default()).unwrap();
    assert!(empty.update(&[]).unwrap().bounds.is_empty());
}

#[test]
fn what_an_update_cannot_do_is_an_error_and_changes_nothing() {
    let mut random = Random::new(204);
    let mut first = instances(&mut random, 70);
    first[9].transform = Affine3A::from_scale(Vec3::ZERO);
    for quality in QUALITIES {
        let mut tlas = Tlas::build(blases(), &first, &with_quality(quality)).unwrap();
        let old = tlas.clone();
        let fewer = tlas.update(&first[1..]);
        assert_eq!(fewer.unwrap_err(), BuildError::InstancesDiffer { built: 70, given: 69 });
        let mut other = moved(&mut random, &first, false);
        other[9].transform = first[9].transform;
        other[4].blas = 1;
        let error = BuildError::OtherBlas { instance: 4, built: 0, given: 1 };
        assert_eq!(tlas.update(&other).unwrap_err(), error);
        other[4].blas = 0;
        other[9].transform = Affine3A::IDENTITY;
        let error = BuildError::InstanceReappeared { instance: 9 };
        assert_eq!(tlas.update(&other).unwrap_err(), error);
        assert_eq!(tlas.stats(), old.stats());
        assert!(assert_same_hits(&tlas, &old, &mut random, 200) > 50);
        other[9].transform = Affine3A::from_translation(Vec3::NAN);
        tlas.update(&other).unwrap();
        tlas.validate().unwrap();
    }
}

#[test]
fn moving_instances_touches_no_blas() {
    let blases = blases();
    let bytes = || format!("{blases:?}");
    let before = bytes();
    let mut random = Random::new(205);
    let first = instances(&mut random, 50);
    let mut tlas = Tlas::build(blases.clone(), &first, &BuildOptions::default()).unwrap();
    for _ in 0..5 {
        tlas.update(&moved(&mut random, &first, false)).unwrap();
    }
    assert!(tlas.blases().iter().zip(&blases).all(|(own, given)| Arc::ptr_eq(own, given)));
    assert!(before.len() > 10_000 && bytes() == before);
}

#[test]
fn ten_thousand_instances_take_the_memory_of_one_mesh() {
    let mesh = sphere(60);
    let blas = Arc::new(Blas::build(&[mesh.geometry()], &BuildOptions::default()).unwrap());
    let place = |i: usize| {
        let (x, z) = ((i % 100) as f32, (i / 100) as f32);
        Instance::new(0, Affine3A::from_translation(3.0 * Vec3::new(x, 0.0, z)))
    };
    let all: Vec<Instance> = (0..10_000).map(place).collect();
    for quality in QUALITIES {
        let mut tlas = Tlas::build(vec![blas.clone()], &all, &with_quality(quality)).unwrap();
        let bytes = tlas.stats().bytes;
        // An instance as given and as rays need it, and its part of the nodes.
        assert!(bytes < 10_000 * 300, "{bytes}");
        assert!(bytes + blas.stats().bytes < 10_000 * blas.stats().bytes / 1000);
        let [only] = tlas.blases() else { panic!("one BLAS") };
        assert!(Arc::ptr_eq(only, &blas));
        tlas.update(&all).unwrap();
        assert_eq!(tlas.stats().bytes, bytes);
    }
}

#[test]
fn the_fast_tree_hits_what_the_other_one_hits() {
    let blases = blases();
    let mut random = Random::new(206);
    // Many, many in one place, some never hit.
    let mut many = instances(&mut random, 3000);
    for i in 0..3000 {
        match i % 10 {
            3 => many[i].transform = many[0].transform,
            7 => many[i].transform = hidden(&mut random),
            _ => many[i].transform.translation *= [1.0, 1.0, 40.0][i % 3],
        }
    }
    let same = vec![many[0]; 500];
    for instances in [&many[..], &many[..70], &same] {
        let [fast, balanced] = QUALITIES.map(|quality| {
            let tlas = Tlas::build(blases.clone(), instances, &with_quality(quality)).unwrap();
            let proof = tlas.validate().unwrap();
            assert!((proof.sah_cost - tlas.stats().sah_cost).abs() <= 1e-4 * proof.sah_cost);
            assert_eq!(proof.depth, tlas.stats().depth);
            assert_eq!(proof.nodes, tlas.stats().nodes);
            tlas
        });
        assert_eq!(fast.bounds(), balanced.bounds());
        assert!(assert_same_hits(&fast, &balanced, &mut random, 3000) > 20);
    }
}

#[test]
fn neither_a_build_nor_an_update_depends_on_threads() {
    let blases = blases();
    let mut random = Random::new(207);
    let first = instances(&mut random, 20_000);
    let second = moved(&mut random, &first, false);
    for quality in QUALITIES {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let options = with_quality(quality);
                let mut tlas = Tlas::build(blases.clone(), &first, &options).unwrap();
                let built = tlas.validate().unwrap();
                let report = tlas.update(&second).unwrap();
                (built, report, tlas.validate().unwrap())
            })
        };
        let one = run(1);
        assert!(one == run(2) && one == run(7));
    }
}
