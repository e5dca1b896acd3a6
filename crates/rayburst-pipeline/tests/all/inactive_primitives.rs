//! Inactive primitives and instances: never hit, but counted.

use std::sync::{Arc, Mutex};

use glam::{Affine3A, Mat3, Vec3};
use rayburst_accel::{
    Blas, BuildOptions, BuildQuality, Geometry, Instance, ProceduralBoxes, RayFlags, Tlas,
    TriangleMesh,
};
use rayburst_math::{Aabb, Ray};
use rayburst_pipeline::{HitGroup, ShaderTable};

/// Which primitives a ray down the z axis passes, by geometry, instance and index; all are ignored.
pub fn passed(tlas: &Tlas, instances: usize) -> Vec<[u32; 3]> {
    let seen = Mutex::new(vec![]);
    {
        let mut table = ShaderTable::new();
        let ray_type = table.ray_type::<Vec<[u32; 3]>>("ray", 0, 1, 0);
        table.miss("miss", |_, _: &mut Vec<[u32; 3]>| {});
        let kinds: Vec<_> = tlas.blases().iter().flat_map(|blas| blas.geometries()).collect();
        for info in &kinds {
            match info.kind {
                rayburst_accel::GeometryKind::Triangles => table.hit(
                    &HitGroup::triangles("triangles").any_hit(|hit, seen: &mut Vec<[u32; 3]>| {
                        seen.push([
                            hit.instance_index(),
                            hit.geometry_index(),
                            hit.primitive_index(),
                        ]);
                        hit.ignore_hit()
                    }),
                    (),
                ),
                rayburst_accel::GeometryKind::Procedural => table.hit(
                    &HitGroup::<Vec<[u32; 3]>, ()>::procedural("boxes", |shader| {
                        shader.report_hit(1.0, 0, ());
                    })
                    .any_hit(|hit, seen| {
                        seen.push([
                            hit.instance_index(),
                            hit.geometry_index(),
                            hit.primitive_index(),
                        ]);
                        hit.ignore_hit()
                    }),
                    (),
                ),
            };
        }
        let generate = table.ray_generation(|launch| {
            let ray = Ray::new(Vec3::new(0.125, 0.0625, 50.0), -Vec3::Z);
            let mut seen = seen.lock().unwrap();
            let flags = RayFlags::FORCE_NON_OPAQUE;
            launch.trace_ray(ray_type, flags, 0xFF, &ray, &mut seen);
        });
        assert_eq!(tlas.instances().len(), instances);
        crate::harness::once(table, tlas, generate);
    }
    let mut seen = seen.into_inner().unwrap();
    seen.sort();
    seen
}

pub fn tlas_of(geometries: &[Geometry<'_>], quality: BuildQuality) -> Tlas {
    let options = BuildOptions { quality, ..BuildOptions::default() };
    let blas = Arc::new(Blas::of_geometries(geometries, &options).unwrap());
    Tlas::build(vec![blas], &[Instance::new(0, Affine3A::IDENTITY)], &options).unwrap()
}

const QUALITIES: [BuildQuality; 3] =
    [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::Best];

/// Corners of a large triangle at a height.
pub fn corners(z: f32) -> [Vec3; 3] {
    crate::scenes::sheet(f64::from(z)).map(|corner| corner.as_vec3())
}

/// Three triangles, of which the second has a coordinate like that.
fn check_triangle(corner: usize, axis: usize, value: f32) {
    let mut positions = [corners(2.0), corners(1.0), corners(0.0)].concat();
    positions[3 + corner][axis] = value;
    let mesh = TriangleMesh::new(&positions, &[[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
    for quality in QUALITIES {
        let tlas = tlas_of(&[mesh.into()], quality);
        assert_eq!(passed(&tlas, 1), [[0, 0, 0], [0, 0, 2]], "the index goes on counting");
    }
}

macro_rules! triangles {
    ($($name:ident = ($corner:literal, $axis:literal, $value:expr);)*) => {
        $(
            #[test]
            fn $name() {
                check_triangle($corner, $axis, $value);
            }
        )*
    };
}

triangles! {
    nan_in_x_of_the_first_vertex = (0, 0, f32::NAN);
    nan_in_x_of_the_second_vertex = (1, 0, f32::NAN);
    nan_in_x_of_the_third_vertex = (2, 0, f32::NAN);
    nan_in_y_of_the_first_vertex = (0, 1, f32::NAN);
    nan_in_y_of_the_second_vertex = (1, 1, f32::NAN);
    nan_in_z_of_the_third_vertex = (2, 2, f32::NAN);
    infinite_vertex = (1, 0, f32::INFINITY);
    vertex_of_minus_infinity = (2, 1, f32::NEG_INFINITY);
    vertex_too_far_away = (0, 2, f32::MAX);
}

#[test]
fn vertices_that_only_inactive_triangles_use() {
    let mut positions = corners(0.0).to_vec();
    positions.push(Vec3::NAN);
    let mesh = TriangleMesh::new(&positions, &[[0, 1, 3], [0, 1, 2], [3, 3, 3]]);
    for quality in QUALITIES {
        assert_eq!(passed(&tlas_of(&[mesh.into()], quality), 1), [[0, 0, 1]]);
    }
}

fn check_box(bounds: Aabb) {
    let good =
        |z: f32| Aabb { lower: Vec3::new(-1.0, -1.0, z), upper: Vec3::new(1.0, 1.0, z + 0.5) };
    let boxes = [good(2.0), bounds, good(0.0)];
    for quality in QUALITIES {
        let tlas = tlas_of(&[ProceduralBoxes::new(&boxes).into()], quality);
        assert_eq!(passed(&tlas, 1), [[0, 0, 0], [0, 0, 2]]);
        assert_eq!(tlas.blases()[0].stats().inactive, 1);
    }
}

macro_rules! boxes {
    ($($name:ident = $lower:expr, $upper:expr;)*) => {
        $(
            #[test]
            fn $name() {
                check_box(Aabb { lower: Vec3::from_array($lower), upper: Vec3::from_array($upper) });
            }
        )*
    };
}

const NAN: f32 = f32::NAN;

boxes! {
    box_of_nan_in_the_lower_x = [NAN, -1.0, -1.0], [1.0, 1.0, 1.0];
    box_of_nan_in_the_lower_z = [-1.0, -1.0, NAN], [1.0, 1.0, 1.0];
    box_of_nan_in_the_upper_y = [-1.0, -1.0, -1.0], [1.0, NAN, 1.0];
    box_of_nan = [NAN; 3], [NAN; 3];
    box_inside_out = [1.0, 1.0, 1.0], [-1.0, -1.0, -1.0];
    box_inside_out_in_one_axis = [-1.0, -1.0, 1.0], [1.0, 1.0, -1.0];
    infinite_box = [f32::NEG_INFINITY; 3], [f32::INFINITY; 3];
    empty_box = [f32::INFINITY; 3], [f32::NEG_INFINITY; 3];
}

#[test]
fn nothing_but_inactive_primitives() {
    let positions = [Vec3::NAN; 3];
    let boxes = [Aabb::EMPTY; 2];
    let geometries = [
        TriangleMesh::new(&positions, &[[0, 1, 2], [0, 1, 2]]).into(),
        ProceduralBoxes::new(&boxes).into(),
    ];
    for quality in QUALITIES {
        assert_eq!(passed(&tlas_of(&geometries, quality), 1), [[0u32; 3]; 0]);
    }
}

#[test]
fn empty_geometries_count() {
    let positions = corners(0.0);
    let boxes = [Aabb { lower: Vec3::NEG_ONE, upper: Vec3::ONE }];
    let geometries = [
        TriangleMesh::new(&[], &[]).into(),
        TriangleMesh::new(&positions, &[[0, 1, 2]]).into(),
        ProceduralBoxes::new(&[]).into(),
        ProceduralBoxes::new(&boxes).into(),
    ];
    for quality in QUALITIES {
        assert_eq!(passed(&tlas_of(&geometries, quality), 1), [[0, 1, 0], [0, 3, 0]]);
    }
}

#[test]
fn structures_without_geometry() {
    let tlas = tlas_of(&[], BuildQuality::Balanced);
    assert_eq!(passed(&tlas, 1), [[0u32; 3]; 0]);
    let tlas = Tlas::build(vec![], &[], &BuildOptions::default()).unwrap();
    assert_eq!(passed(&tlas, 0), [[0u32; 3]; 0]);
}

/// Three instances, of which the second has such a transform.
fn check_instance(transform: Affine3A) {
    let positions = corners(0.0);
    let boxes = [Aabb { lower: Vec3::NEG_ONE, upper: Vec3::ONE }];
    let geometries =
        [TriangleMesh::new(&positions, &[[0, 1, 2]]).into(), ProceduralBoxes::new(&boxes).into()];
    let options = BuildOptions::default();
    let blas = Arc::new(Blas::of_geometries(&geometries, &options).unwrap());
    let up = Affine3A::from_translation(Vec3::Z);
    let instances =
        [Affine3A::IDENTITY, transform, up].map(|transform| Instance::new(0, transform));
    let tlas = Tlas::build(vec![blas], &instances, &options).unwrap();
    assert_eq!(passed(&tlas, 3), [[0, 0, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]]);
}

macro_rules! instances {
    ($($name:ident = $matrix:expr, $translation:expr;)*) => {
        $(
            #[test]
            fn $name() {
                check_instance(Affine3A::from_mat3_translation($matrix, $translation));
            }
        )*
    };
}

instances! {
    instance_of_zero = Mat3::ZERO, Vec3::ZERO;
    instance_without_an_inverse = Mat3::from_diagonal(Vec3::new(1.0, 0.0, 1.0)), Vec3::ZERO;
    instance_of_nan = Mat3::from_diagonal(Vec3::new(1.0, f32::NAN, 1.0)), Vec3::ZERO;
    instance_of_infinite_scale = Mat3::from_diagonal(Vec3::splat(f32::INFINITY)), Vec3::ZERO;
    instance_at_nan = Mat3::IDENTITY, Vec3::NAN;
    instance_at_infinity = Mat3::IDENTITY, Vec3::splat(f32::INFINITY);
}
