//! Instances equal the flattened mesh, whatever the transform.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Quat, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildError, BuildOptions, Instance, IsaLevel, Layout, Tlas, TraceOptions,
    TriangleMesh,
};
use rayburst_math::{Hit, Ray};

use crate::{
    meshes::{Mesh, Random, grid_box, ray_at, soup, sphere, with_isa},
    oracle::check_closest,
};

/// A transform of every kind: rigid, stretched, mirrored, sheared.
pub fn transform(random: &mut Random, kind: usize) -> Affine3A {
    let rotation = Quat::from_scaled_axis(3.0 * random.vector());
    let translation = random.vector();
    let scale = match kind % 4 {
        0 => Vec3::ONE,
        1 => Vec3::new(0.2, 1.5, 0.7),
        2 => Vec3::new(-1.0, 0.5, 1.0),
        _ => Vec3::splat(0.5),
    };
    let shear = match kind % 4 {
        3 => Mat3::from_cols(Vec3::X, Vec3::new(0.8, 1.0, 0.0), Vec3::new(-0.5, 0.3, 1.0)),
        _ => Mat3::IDENTITY,
    };
    Affine3A::from_mat3_translation(
        Mat3::from_quat(rotation) * shear * Mat3::from_diagonal(scale),
        translation,
    )
}

/// What is instanced, in both layouts, and the same as one mesh in the world.
pub fn scene(isa: IsaLevel) -> (Tlas, Mesh, Vec<u32>) {
    let parts = [soup(41, 60, 0.4), sphere(6)];
    let blases = parts.iter().zip(Layout::ALL).map(|(mesh, layout)| {
        let options = BuildOptions { layout, ..with_isa(isa) };
        Arc::new(Blas::build(&[mesh.geometry()], &options).unwrap())
    });
    let blases = blases.collect();
    let mut random = Random::new(42);
    let (mut instances, mut flat, mut firsts) = (vec![], Mesh::default(), vec![]);
    for i in 0..40 {
        let part = random.below(2);
        let to_world = transform(&mut random, i);
        instances.push(Instance::new(part as u32, to_world));
        firsts.push(flat.indices.len() as u32);
        flat = flat.merged(&parts[part].clone().map(|p| to_world.transform_point3(p)));
    }
    (Tlas::build(blases, &instances, &with_isa(isa)).unwrap(), flat, firsts)
}

#[test]
fn instances_are_hit_like_the_flattened_mesh() {
    for isa in IsaLevel::available() {
        let (tlas, flat, firsts) = scene(isa);
        let report = tlas.validate().unwrap();
        assert_eq!(report.primitives, 40);
        let blas = flat.blas(isa);
        let mut random = Random::new(43);
        let (mut same, mut hit_count) = (0, 0);
        for _ in 0..2000 {
            let ray = ray_at(&mut random, Vec3::ZERO, 1.5);
            let hit = tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
            let mut in_flat = hit;
            if hit.is_hit() {
                in_flat.primitive += firsts[hit.instance as usize];
                hit_count += 1;
            }
            // Rounding the transform costs a few roundings more than the oracle allows for.
            let tolerant = check_closest(&flat, &ray, &in_flat).is_ok();
            let other = blas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
            let near = (hit.t - other.t).abs() <= 1e-4 * other.t.abs();
            assert!(tolerant || near, "{}: {ray:?} {hit:?} {other:?}", isa.name());
            same += usize::from(in_flat.primitive == other.primitive);
            assert_eq!(tlas.any_hit(&ray, &TraceOptions::default(), &AcceptAll), hit.is_hit());
            let mut all = vec![];
            tlas.all_hits(&ray, &TraceOptions::default(), &AcceptAll, &mut all);
            assert_eq!(all.first().copied().unwrap_or(Hit::MISS), hit);
        }
        assert!(hit_count > 500 && same >= 1995, "{hit_count} hits, {same} the same");
    }
}

#[test]
fn an_identity_instance_changes_no_bit() {
    let mesh = soup(44, 500, 0.2);
    let blas = Arc::new(mesh.blas(IsaLevel::detect()));
    let instance = Instance::new(0, Affine3A::IDENTITY);
    let tlas = Tlas::build(vec![blas.clone()], &[instance], &BuildOptions::default()).unwrap();
    let mut random = Random::new(45);
    for _ in 0..1000 {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        assert_eq!(
            tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll),
            blas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll)
        );
    }
}

#[test]
fn closed_instances_stay_closed() {
    for isa in IsaLevel::available() {
        let meshes = [sphere(10), grid_box(3)];
        let mut random = Random::new(46);
        for kind in 0..24 {
            let mesh = &meshes[kind % 2];
            let mut to_world = transform(&mut random, kind);
            // Far from the origin, the transform's rounding is large beside the instance.
            let away = [0.0, 100.0, 1e4][kind % 3];
            to_world.translation += glam::Vec3A::new(away, -away, 0.5 * away);
            let blas = Arc::new(mesh.blas(isa));
            let instance = Instance::new(0, to_world);
            let tlas = Tlas::build(vec![blas], &[instance], &with_isa(isa)).unwrap();
            let origin = to_world.transform_point3(Vec3::ZERO);
            for _ in 0..300 {
                let [a, b, _] = mesh.triangle(random.below(mesh.indices.len()));
                let aim = a + (b - a) * [0.0, 0.5, random.unit()][random.below(3)];
                let ray = Ray::new(origin, to_world.transform_point3(aim) - origin);
                let hit = tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
                assert!(hit.is_hit(), "{}, {kind}: {ray:?}", isa.name());
            }
        }
    }
}

#[test]
fn t_is_in_units_of_the_world_direction() {
    let mesh = grid_box(1);
    let blas = Arc::new(mesh.blas(IsaLevel::detect()));
    let instance = Instance::new(0, Affine3A::from_scale(Vec3::new(1e-3, 4.0, -2.0)));
    let tlas = Tlas::build(vec![blas], &[instance], &BuildOptions::default()).unwrap();
    for length in [1e-6, 0.25, 1.0, 8.0, 1e9] {
        let ray = Ray::new(Vec3::new(0.0, 10.0, 0.0), -Vec3::Y * length);
        let t = tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll).t;
        assert!((t * length - 6.0).abs() < 1e-5, "{t} for {length}");
        let bounded = |t_max| Ray { t_max, ..ray };
        assert!(tlas.any_hit(&bounded(t), &TraceOptions::default(), &AcceptAll));
        assert!(!tlas.any_hit(&bounded(t.next_down()), &TraceOptions::default(), &AcceptAll));
    }
}

#[test]
fn instances_without_an_inverse_or_a_triangle_are_never_hit() {
    let blases = vec![
        Arc::new(sphere(4).blas(IsaLevel::detect())),
        Arc::new(Mesh::default().blas(IsaLevel::detect())),
    ];
    let instances = [
        Instance::new(0, Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))),
        Instance::new(0, Affine3A::from_translation(Vec3::splat(f32::NAN))),
        Instance::new(0, Affine3A::from_translation(Vec3::splat(1e30))),
        Instance::new(1, Affine3A::IDENTITY),
        Instance::new(0, Affine3A::from_translation(Vec3::X * 5.0)),
    ];
    let tlas = Tlas::build(blases, &instances, &BuildOptions::default()).unwrap();
    assert_eq!((tlas.stats().primitives, tlas.stats().inactive), (1, 4));
    tlas.validate().unwrap();
    let along = |x: f32| Ray::new(Vec3::new(x, 0.0, 10.0), -Vec3::Z);
    assert!(!tlas.any_hit(&along(0.0), &TraceOptions::default(), &AcceptAll));
    assert_eq!(tlas.closest_hit(&along(5.1), &TraceOptions::default(), &AcceptAll).instance, 4);
}

#[test]
fn an_empty_world_and_an_unknown_blas() {
    let tlas = Tlas::build(vec![], &[], &BuildOptions::default()).unwrap();
    tlas.validate().unwrap();
    assert!(tlas.bounds().is_empty());
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll), Hit::MISS);
    let error =
        Tlas::build(vec![], &[Instance::new(3, Affine3A::IDENTITY)], &BuildOptions::default());
    assert!(matches!(error, Err(BuildError::NoSuchBlas { instance: 0, blas: 3, blases: 0 })));
}

#[test]
fn many_instances_share_one_blas() {
    let blas = Arc::new(sphere(8).blas(IsaLevel::detect()));
    let instances: Vec<Instance> = (0..10_000)
        .map(|i| {
            let (x, z) = ((i % 100) as f32, (i / 100) as f32);
            Instance::new(0, Affine3A::from_translation(3.0 * Vec3::new(x, 0.0, z)))
        })
        .collect();
    let tlas = Tlas::build(vec![blas], &instances, &BuildOptions::default()).unwrap();
    tlas.validate().unwrap();
    assert!(tlas.stats().bytes < 10_000 * 300, "{:?}", tlas.stats());
    for i in (0..10_000).step_by(37) {
        let above = tlas.object_to_world(i).transform_point3(Vec3::new(0.1, 9.0, 0.1));
        let ray = Ray::new(above, -Vec3::Y);
        let hit = tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        assert_eq!(hit.instance, i);
    }
}

#[test]
fn a_geometry_transform_equals_transformed_positions() {
    let mesh = soup(47, 300, 0.3);
    let mut random = Random::new(48);
    for kind in 0..4 {
        let baked = transform(&mut random, kind);
        let moved = mesh.clone().map(|p| baked.transform_point3(p));
        let with = TriangleMesh { transform: Some(baked), ..mesh.geometry() };
        let (with, without) = (
            Blas::build(&[with], &BuildOptions::default()).unwrap(),
            moved.blas(with_isa(IsaLevel::detect()).isa.unwrap()),
        );
        assert_eq!(with.triangle(0, 7), Some(moved.triangle(7)));
        for _ in 0..300 {
            let ray = ray_at(&mut random, Vec3::ZERO, 1.5);
            let hit = with.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
            assert_eq!(hit, without.closest_hit(&ray, &TraceOptions::default(), &AcceptAll));
        }
    }
}

#[test]
fn no_hit_is_lost_on_the_way_to_an_instance() {
    // One instance is entered without a look at its box, one of two after the boxes were met; rays
    // at the rim of thin boxes far from the origin need the margin for the transform's rounding.
    let mut flat = Mesh::default();
    flat.push([Vec3::new(-1.0, 0.0, -1.0), Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, -1.0)]);
    flat.push([Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, -1.0), Vec3::new(-1.0, 0.0, 1.0)]);
    for isa in IsaLevel::available() {
        let blas = Arc::new(flat.blas(isa));
        let mut random = Random::new(49);
        let mut hit_count = 0;
        for kind in 0..200 {
            let mut to_world = transform(&mut random, kind);
            if kind % 2 == 0 {
                // The mesh stays flat in the plane of x and z; the inverse is large beside it.
                let skew = 30.0 * random.vector() + Vec3::Y;
                let columns = Mat3::from_cols(1.3 * Vec3::X, skew, 0.7 * Vec3::Z);
                to_world = Affine3A::from_mat3_translation(columns, random.vector());
            }
            to_world.translation *= [1.0, 1e2, 1e4][kind % 3];
            let near = Instance::new(0, to_world);
            let mut away = near;
            away.mask = 0;
            away.transform.translation += glam::Vec3A::splat(50.0);
            let build = |instances: &[Instance]| {
                Tlas::build(vec![blas.clone()], instances, &with_isa(isa)).unwrap()
            };
            let (sole, both) = (build(&[near]), build(&[near, away]));
            for i in 0..100 {
                let rim = [
                    Vec3::new(1.0, 0.0, random.unit()),
                    Vec3::new(-random.unit(), 0.0, -1.0),
                    Vec3::new(-1.0, 0.0, 1.0),
                ][i % 3];
                // Just outside, where only rounding makes a hit of it.
                let beyond = [0.0, 1e-6, 1e-5, 1e-4, 1e-3][random.below(5)] * random.unit();
                let target = to_world.transform_point3(rim * (1.0 + beyond));
                let distance = [1.0, 100.0, 1e4][i % 2];
                // Every other ray along an axis: through the box at its very edge.
                let direction = match i % 4 {
                    0 | 1 => random.vector(),
                    2 => Vec3::X,
                    _ => -Vec3::Y,
                };
                let ray = Ray::new(target - distance * direction, direction);
                let hit = sole.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
                hit_count += usize::from(hit.is_hit());
                assert_eq!(
                    both.closest_hit(&ray, &TraceOptions::default(), &AcceptAll),
                    hit,
                    "{}, {kind}: {ray:?}",
                    isa.name()
                );
            }
        }
        assert!(hit_count > 1000, "{hit_count}");
    }
}
