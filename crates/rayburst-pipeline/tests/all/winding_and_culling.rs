//! Which side of a triangle is its front: that of the instance's space, whatever the instance's transform
//! mirrors; and what the culling flags leave.

use std::sync::Arc;

use glam::{Affine3A, DAffine3, DVec3, Mat3, Quat, Vec3};
use rayburst_accel::{AcceptAll, Blas, BuildOptions, Instance, RayFlags, Tlas, TriangleMesh};
use rayburst_math::{HitKind, Ray};

use crate::{
    harness::verify,
    model::{self, Scene, Table, flag, kind},
    scenes::{ONE_TYPE, Random, clear, down, rays, sheet, some_triangles, transform, triangles},
};

fn mirrored(x: f32, y: f32, z: f32) -> DAffine3 {
    transform(Mat3::from_diagonal(Vec3::new(x, y, z)), Vec3::ZERO)
}

fn sheared_mirror() -> DAffine3 {
    let shear = Mat3::from_cols(Vec3::X, Vec3::new(0.5, -1.5, 0.0), Vec3::new(0.0, 0.25, 1.0));
    transform(Mat3::from_quat(Quat::from_rotation_x(0.4)) * shear, Vec3::new(0.25, 0.0, 0.5))
}

fn check(transform: DAffine3, cull: u32, cull_disable: bool, front_clockwise: bool) {
    let mut random = Random(11);
    let instance =
        model::Instance { cull_disable, front_clockwise, ..model::Instance::new(0, transform) };
    // A sheet alone: the answer is known by hand.
    let blases = vec![vec![triangles(vec![sheet(0.0)], true)]];
    let scene = Scene { blases, instances: vec![instance.clone()] };
    let table = Table::fit(&scene, &ONE_TYPE, |_| model::Policy::Absent);
    for side in [5.0, -5.0] {
        let direction = DVec3::new(0.0, 0.0, -side);
        let ray = model::Ray { direction, flags: cull, ..down(side) };
        let local = transform.inverse().transform_vector3(direction);
        let is_front = (local.z < 0.0) != front_clockwise;
        let culled = if is_front { flag::CULL_FRONT } else { flag::CULL_BACK };
        let is_hit = cull_disable || cull & culled == 0;
        let ray = clear(&scene, &table, ray);
        let stop = ray.1.stops[0].map(|stop| ray.1.candidates[stop].event.kind);
        assert_eq!(stop, is_hit.then_some(if is_front { kind::FRONT } else { kind::BACK }));
        let tally = verify(&scene, &table, &[ray]);
        assert_eq!((tally.closest_hits, tally.misses), (usize::from(is_hit), usize::from(!is_hit)));
    }
    // Many triangles, opaque and not.
    let geometries = vec![
        triangles(some_triangles(&mut random, 12), true),
        triangles(some_triangles(&mut random, 12), false),
    ];
    let scene = Scene { blases: vec![geometries], instances: vec![instance] };
    let table = Table::fit(&scene, &ONE_TYPE, |_| model::Policy::IgnoreFront);
    let tally = verify(&scene, &table, &rays(&scene, &table, 40, cull, 5));
    let all = cull == flag::CULL_BACK | flag::CULL_FRONT && !cull_disable;
    assert_eq!((tally.closest_hits > 0, tally.any_hits > 0), (!all, !all));
}

/// Tests of every cull mode and instance flag under a transform.
macro_rules! under {
    ($($name:ident = $transform:expr;)*) => {
        $(
            mod $name {
                use super::*;
                under!(@cull cull_none = 0, $transform);
                under!(@cull cull_back = flag::CULL_BACK, $transform);
                under!(@cull cull_front = flag::CULL_FRONT, $transform);
                under!(@cull cull_both = flag::CULL_BACK | flag::CULL_FRONT, $transform);
            }
        )*
    };
    (@cull $name:ident = $cull:expr, $transform:expr) => {
        mod $name {
            use super::*;

            #[test]
            fn plain() {
                check($transform, $cull, false, false);
            }

            #[test]
            fn cull_disable() {
                check($transform, $cull, true, false);
            }

            #[test]
            fn front_clockwise() {
                check($transform, $cull, false, true);
            }

            #[test]
            fn cull_disable_and_front_clockwise() {
                check($transform, $cull, true, true);
            }
        }
    };
}

under! {
    no_mirror = DAffine3::IDENTITY;
    mirror_x = mirrored(-1.0, 1.0, 1.0);
    mirror_y = mirrored(1.0, -2.0, 1.0);
    mirror_z = mirrored(1.0, 1.0, -0.5);
    mirror_all = mirrored(-1.0, -1.0, -1.0);
    half_turn = mirrored(-1.0, 1.0, -1.0);
    mirror_with_shear = sheared_mirror();
}

/// A geometry's transform moves the corners before the build: a mirror there turns the winding.
#[test]
fn mirror_of_a_geometry_turns_the_winding() {
    let corners = sheet(0.0).map(|corner| corner.as_vec3());
    for (scale, kind) in [(1.0, HitKind::TRIANGLE_FRONT), (-1.0, HitKind::TRIANGLE_BACK)] {
        let matrix = Affine3A::from_scale(Vec3::new(scale, 1.0, 1.0));
        let mesh =
            TriangleMesh { transform: Some(matrix), ..TriangleMesh::new(&corners, &[[0, 1, 2]]) };
        let options = BuildOptions::default();
        let blas = Arc::new(Blas::build(&[mesh], &options).unwrap());
        let instances = [Instance::new(0, Affine3A::IDENTITY)];
        let tlas = Tlas::build(vec![blas], &instances, &options).unwrap();
        let ray = Ray::new(Vec3::new(0.125, 0.0, 3.0), -Vec3::Z);
        let hit = tlas.closest_hit(&ray, &RayFlags::empty().options(0xFF), &AcceptAll);
        assert_eq!(hit.kind, kind);
    }
}
