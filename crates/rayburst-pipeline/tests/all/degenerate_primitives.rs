//! Degenerate primitives: triangles without area are never hit, boxes without extent are met.

use glam::{Affine3A, Vec3};
use rayburst_accel::{BuildQuality, ProceduralBoxes, TriangleMesh};
use rayburst_math::Aabb;

use crate::inactive_primitives::{corners, passed, tlas_of};

const QUALITIES: [BuildQuality; 3] =
    [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::Best];

/// A degenerate triangle between two good ones.
fn check_triangle(degenerate: [Vec3; 3]) {
    let positions = [corners(2.0), degenerate, corners(0.0)].concat();
    let mesh = TriangleMesh::new(&positions, &[[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
    for quality in QUALITIES {
        assert_eq!(passed(&tlas_of(&[mesh.into()], quality), 1), [[0, 0, 0], [0, 0, 2]]);
    }
}

/// The ray's x and y.
const X: f32 = 0.125;
const Y: f32 = 0.0625;

#[test]
fn triangle_of_one_point() {
    check_triangle([Vec3::new(X, Y, 1.0); 3]);
}

#[test]
fn triangle_of_two_points() {
    let (a, b) = (Vec3::new(-1.0, Y, 1.0), Vec3::new(1.0, Y, 1.0));
    check_triangle([a, b, b]);
    check_triangle([a, b, a]);
    check_triangle([a, a, b]);
}

#[test]
fn triangle_of_points_on_a_line() {
    check_triangle([-1.0, 1.0, 3.0].map(|x| Vec3::new(x, Y, 1.0)));
}

#[test]
fn triangle_along_the_ray() {
    check_triangle([0.5, 1.0, 1.5].map(|z| Vec3::new(X, Y, z)));
}

#[test]
fn triangle_with_one_index_twice() {
    let positions = corners(0.0);
    let mesh = TriangleMesh::new(&positions, &[[0, 1, 1], [0, 1, 2], [2, 2, 2]]);
    for quality in QUALITIES {
        assert_eq!(passed(&tlas_of(&[mesh.into()], quality), 1), [[0, 0, 1]]);
    }
}

#[test]
fn triangle_flattened_by_its_geometry() {
    let positions = corners(0.0);
    let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
    let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]]);
    let geometries = [TriangleMesh { transform: Some(flat), ..mesh }.into(), mesh.into()];
    assert_eq!(passed(&tlas_of(&geometries, BuildQuality::Balanced), 1), [[0, 1, 0]]);
}

/// A box without extent in some axes, through which the ray goes.
fn check_box(half: Vec3) {
    let centre = Vec3::new(X, Y, 1.0);
    let boxes = [Aabb { lower: centre - half, upper: centre + half }];
    for quality in QUALITIES {
        let tlas = tlas_of(&[ProceduralBoxes::new(&boxes).into()], quality);
        assert_eq!(passed(&tlas, 1), [[0, 0, 0]]);
        assert_eq!(tlas.blases()[0].stats().inactive, 0);
    }
}

macro_rules! boxes {
    ($($name:ident = $x:literal, $y:literal, $z:literal;)*) => {
        $(
            #[test]
            fn $name() {
                check_box(Vec3::new($x, $y, $z));
            }
        )*
    };
}

boxes! {
    box_flat_in_x = 0.0, 1.0, 1.0;
    box_flat_in_y = 1.0, 0.0, 1.0;
    box_flat_in_z = 1.0, 1.0, 0.0;
    box_of_a_line_along_the_ray = 0.0, 0.0, 1.0;
    box_of_a_line_across_the_ray = 1.0, 0.0, 0.0;
    box_of_a_point = 0.0, 0.0, 0.0;
}
