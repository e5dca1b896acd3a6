//! The triangle that was hit, and normals in the world, under transforms of all sorts.

use std::sync::{Arc, Mutex};

use glam::{Affine3A, DVec3, Mat3, Vec3};
use rayburst_accel::{
    Blas, BuildOptions, Geometry, Instance, ProceduralBoxes, RayFlags, Tlas, TriangleMesh,
};
use rayburst_math::{Aabb, Ray};
use rayburst_pipeline::{HitGroup, ShaderTable};

use crate::{harness::once, scenes::transforms};

/// A tetrahedron whose corners wind counter-clockwise from outside.
const CORNERS: [Vec3; 4] = [
    Vec3::new(-1.0, -0.8, -0.7),
    Vec3::new(1.1, -0.9, -0.5),
    Vec3::new(0.1, -0.7, 1.2),
    Vec3::new(0.2, 1.3, 0.1),
];
const FACES: [[u32; 3]; 4] = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];

fn structure(transform: Affine3A) -> Tlas {
    let options = BuildOptions::default();
    let boxes = [Aabb { lower: Vec3::new(-0.3, 4.0, -0.3), upper: Vec3::new(0.3, 4.5, 0.3) }];
    let geometries: [Geometry<'_>; 2] =
        [TriangleMesh::new(&CORNERS, &FACES).into(), ProceduralBoxes::new(&boxes).into()];
    let blas = Blas::of_geometries(&geometries, &options).unwrap();
    Tlas::build(vec![Arc::new(blas)], &[Instance::new(0, transform)], &options).unwrap()
}

fn all_transforms() -> Vec<Affine3A> {
    let of_model = transforms()
        .map(|t| Affine3A::from_mat3_translation(t.matrix3.as_mat3(), t.translation.as_vec3()));
    let stretched = Mat3::from_diagonal(Vec3::new(4.0, 0.25, -1.5));
    let mut all = of_model.to_vec();
    all.push(Affine3A::from_mat3_translation(stretched, Vec3::new(0.5, 2.0, -1.0)));
    all
}

#[test]
fn the_triangle_of_a_hit_and_its_normal_in_the_world() {
    for transform in all_transforms() {
        let tlas = structure(transform);
        for (face, corners) in FACES.iter().zip(0u32..) {
            let corners = (face.map(|i| CORNERS[i as usize]), corners);
            let (object, primitive) = corners;
            let world = object.map(|p| transform.transform_point3(p).as_dvec3());
            let centre = (world[0] + world[1] + world[2]) / 3.0;
            let inside = transform.transform_point3(Vec3::new(0.1, -0.2, 0.0)).as_dvec3();
            // Away from the solid, whatever the transform does to the winding.
            let mut normal = (world[1] - world[0]).cross(world[2] - world[0]).normalize();
            if normal.dot(centre - inside) < 0.0 {
                normal = -normal;
            }
            let from = centre + 2.0 * normal + 0.1 * DVec3::new(0.3, -0.2, 0.4);
            let ray = Ray::new(from.as_vec3(), (centre - from).as_vec3());
            let seen = Mutex::new(None);
            let mut table = ShaderTable::new();
            let ray_type = table.ray_type::<()>("ray", 0, 1, 0);
            table.miss("none", |_, (): &mut ()| panic!("the face is hit"));
            let group = HitGroup::triangles("faces").closest_hit(|hit, (): &mut ()| {
                let triangle = hit.triangle().expect("a triangle");
                let [a, b, c] = triangle;
                let normal = hit.normal_to_world((b - a).cross(c - a));
                let nothing = [Vec3::ZERO, Vec3::NAN].map(|n| hit.normal_to_world(n));
                assert_eq!(nothing, [Vec3::ZERO; 2]);
                *seen.lock().unwrap() = Some((hit.primitive_index(), triangle, normal));
            });
            table.hit(&group, ());
            table.no_hit();
            let generate = table.ray_generation(|launch| {
                launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut ());
            });
            once(table, &tlas, generate);
            let seen = seen.lock().unwrap().take().expect("the closest hit shader runs");
            assert_eq!((seen.0, seen.1), (primitive, object));
            // On the outside, at right angles to the edges, and not what the transform itself makes of it.
            let difference = (seen.2.as_dvec3() - normal).length();
            assert!(difference < 1e-4, "{difference} at {transform:?}");
        }
    }
}

#[test]
fn procedural_primitives_have_no_triangle() {
    let tlas = structure(Affine3A::IDENTITY);
    let seen = Mutex::new(0);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<()>("ray", 0, 1, 0);
    table.no_miss();
    table.no_hit();
    let group = HitGroup::procedural("box", |shader| {
        shader.report_hit(1.0, 0, ());
    });
    let group = group.closest_hit(|hit, (): &mut ()| {
        assert_eq!(hit.triangle(), None);
        assert_eq!(hit.normal_to_world(2.0 * Vec3::Y), Vec3::Y);
        *seen.lock().unwrap() += 1;
    });
    table.hit(&group, ());
    let ray = Ray::new(Vec3::new(0.0, 6.0, 0.0), -Vec3::Y);
    let generate = table.ray_generation(|launch| {
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut ());
    });
    once(table, &tlas, generate);
    assert_eq!(*seen.lock().unwrap(), 1);
}
