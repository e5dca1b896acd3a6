//! Ray generation shaders.

use glam::{UVec2, UVec3, Vec3};
use rayburst_accel::{BuildOptions, RayFlags};
use rayburst_math::Ray;
use rayburst_pipeline::{HitGroup, RwTexture, ShaderTable};

use crate::{
    dispatch_rays::nothing,
    harness::{once, structure},
    scenes::{scene_of, sheet, triangles},
};

#[test]
fn launch_index_is_each_of_the_grid() {
    let seen = RwTexture::<UVec3>::new(13, 9);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|launch| {
        seen.store(launch.launch_index().truncate(), launch.launch_index() + 1);
    });
    table.build(0).unwrap().dispatch_rays(&nothing(), generate, 13, 9, 1).unwrap();
    for y in 0..9 {
        for x in 0..13 {
            assert_eq!(seen.load(UVec2::new(x, y)), UVec3::new(x + 1, y + 1, 1));
        }
    }
}

#[test]
fn remaining_depth_is_what_was_declared() {
    for depth in [0, 1, 31] {
        let mut table = ShaderTable::new();
        let generate = table.ray_generation(|launch| assert_eq!(launch.remaining_depth(), depth));
        table.build(depth).unwrap().dispatch_rays(&nothing(), generate, 1, 1, 1).unwrap();
    }
}

#[test]
fn the_structure_is_the_dispatch_s() {
    let tlas = structure(
        &scene_of(vec![vec![triangles(vec![sheet(0.0)], true)]; 3]),
        &BuildOptions::default(),
    );
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|launch| {
        assert!(std::ptr::eq(launch.structure(), launch.structure()));
        assert_eq!(launch.structure().instances().len(), 3);
    });
    once(table, &tlas, generate);
}

/// A picture of a triangle through a pinhole, against the triangle by hand.
#[test]
fn a_picture() {
    const SIZE: u32 = 32;
    let corners = [Vec3::new(-0.5, -0.5, 0.0), Vec3::new(0.5, -0.5, 0.0), Vec3::new(0.0, 0.5, 0.0)];
    let triangle = corners.map(|corner| corner.as_dvec3());
    let scene = scene_of(vec![vec![triangles(vec![triangle], true)]]);
    let picture = RwTexture::<f32>::new(SIZE, SIZE);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<f32>("camera", 0, 1, 0);
    table.miss("black", |_, colour: &mut f32| *colour = 0.0);
    let group = HitGroup::triangles("white").closest_hit(|_, colour: &mut f32| *colour = 1.0);
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        let at = launch.launch_index().truncate();
        let place = (at.as_vec2() + 0.5) / SIZE as f32 * 2.0 - 1.0;
        let direction = Vec3::new(place.x, -place.y, -1.0);
        let (origin, mut colour) = (Vec3::new(0.0, 0.0, 1.0), f32::NAN);
        let ray = Ray::new(origin, direction);
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut colour);
        picture.store(at, colour);
    });
    let tlas = structure(&scene, &BuildOptions::default());
    table.build(1).unwrap().dispatch_rays(&tlas, generate, SIZE, SIZE, 1).unwrap();
    for (pixel, index) in picture.to_vec().into_iter().zip(0..) {
        let at = UVec2::new(index % SIZE, index / SIZE);
        let place = (at.as_dvec2() + 0.5) / f64::from(SIZE) * 2.0 - 1.0;
        let (x, y) = (place.x, -place.y);
        let inside = y > -0.5 && y < 0.5 - 2.0 * x.abs();
        assert_eq!(pixel, f32::from(u8::from(inside)), "{at}");
    }
}
