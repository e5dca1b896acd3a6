//! A glass and a mirror sphere above a checkerboard.
//!
//! After Whitted: "An Improved Illumination Model for Shaded Display", CACM 1980, figure 7: the
//! picture that began recursive ray tracing. Placement is by eye.

use glam::Vec3;

use super::{Values, checker::add_checker, gradient::Gradient, new_scene, view::view};
use crate::{
    Light, LightKind, Material, Scene, TextureSlot,
    shapes::{self, Shape},
};

pub(super) fn build(_: &Values) -> Scene {
    let mut scene = new_scene("spheres");
    let sky = Gradient {
        zenith: Vec3::new(30.0, 70.0, 190.0),
        horizon: Vec3::new(130.0, 190.0, 300.0),
        ground: Vec3::new(60.0, 75.0, 100.0),
    };
    scene.environment = Some(sky.environment());

    let texture = add_checker(&mut scene, [[226, 190, 38], [176, 30, 24]]);
    let checker = scene.add_material(
        "checkerboard",
        Material { base_color_texture: TextureSlot::new(texture), ..Material::diffuse(Vec3::ONE) },
    );
    let mut floor = Shape::default();
    floor.add_textured_quad(
        [
            Vec3::new(-10.0, 0.0, 8.0),
            Vec3::new(10.0, 0.0, 8.0),
            Vec3::new(10.0, 0.0, -22.0),
            Vec3::new(-10.0, 0.0, -22.0),
        ],
        0.5,
    );
    scene.add_mesh("floor", vec![floor.into_primitive(checker)]);

    let glass = scene.add_material("glass", Material::glass(1.5));
    let mirror = scene.add_material("mirror", Material::mirror(Vec3::splat(0.9)));
    for (name, center, radius, material) in [
        ("glass sphere", Vec3::new(-0.35, 1.75, 0.6), 0.95, glass),
        ("mirror sphere", Vec3::new(1.15, 1.15, -1.25), 0.95, mirror),
    ] {
        let sphere = shapes::sphere(center, radius, 7);
        scene.add_mesh(name, vec![sphere.into_primitive(material)]);
    }
    scene.world_lights.push(Light {
        intensity: Vec3::new(70_000.0, 66_000.0, 60_000.0),
        kind: LightKind::Point { position: Vec3::new(-4.5, 8.5, 5.0) },
    });
    scene.views.push(view("front", Vec3::new(0.1, 2.0, 6.2), Vec3::new(0.35, 1.35, 0.0), 36.0));
    scene
}
