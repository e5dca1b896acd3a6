//! Four glossy plates under lights of different sizes: neither sampling the lights nor sampling the
//! reflection is good everywhere.
//!
//! Veach, Guibas: "Optimally Combining Sampling Techniques for Monte Carlo Rendering", SIGGRAPH
//! 1995, figure 2; plates and lights are where the published scene has them. The lights have equal
//! power, a fifth one above the camera fills in; the tints are ours.

use glam::Vec3;

use super::{Values, new_scene, view::view};
use crate::{
    Material, Scene,
    shapes::{self, Shape},
};

/// Plates from the farthest: (height, z) of the upper and lower edge, and GGX's α.
const PLATES: [([(f32, f32); 2], f32); 4] = [
    ([(-2.083_75, -0.526_323), (-2.706_51, 0.256_09)], 0.005),
    ([(-2.838_56, 0.476_536), (-3.288_25, 1.369_72)], 0.02),
    ([(-3.433_78, 1.745_64), (-3.730_96, 2.700_46)], 0.05),
    ([(-3.820_69, 3.082_21), (-3.996_15, 4.066_7)], 0.1),
];

/// Spheres at height 0: x, radius, tint.
const LIGHTS: [(f32, f32, Vec3); 4] = [
    (3.75, 0.033_333, Vec3::new(1.0, 0.62, 0.42)),
    (1.25, 0.1, Vec3::new(1.0, 0.88, 0.5)),
    (-1.25, 0.3, Vec3::new(0.62, 1.0, 0.66)),
    (-3.75, 0.9, Vec3::new(0.5, 0.7, 1.0)),
];

/// Luminance of a light of radius 1, cd/m²; it rises as the area falls.
const LUMINANCE: f32 = 100.0;

const REC709: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

pub(super) fn build(_: &Values) -> Scene {
    let mut scene = new_scene("veach-mis");
    let grey = scene.add_material("wall", Material::diffuse(Vec3::splat(0.4)));
    let mut room = Shape::default();
    // Floor and back wall.
    let (floor, back) = (-4.146_15, -2.0);
    room.add_quad([
        Vec3::new(-10.0, floor, 10.0),
        Vec3::new(10.0, floor, 10.0),
        Vec3::new(10.0, floor, back),
        Vec3::new(-10.0, floor, back),
    ]);
    room.add_quad([
        Vec3::new(-10.0, floor, back),
        Vec3::new(10.0, floor, back),
        Vec3::new(10.0, 10.0, back),
        Vec3::new(-10.0, 10.0, back),
    ]);
    scene.add_mesh("room", vec![room.into_primitive(grey)]);
    for (i, ([upper, lower], alpha)) in PLATES.into_iter().enumerate() {
        // The material's roughness is the square root of α.
        let metal = Material::metal(Vec3::splat(0.7), f32::sqrt(alpha));
        let metal = scene.add_material(&format!("plate {}", i + 1), metal);
        let mut plate = Shape::default();
        plate.add_quad([
            Vec3::new(-4.0, lower.0, lower.1),
            Vec3::new(4.0, lower.0, lower.1),
            Vec3::new(4.0, upper.0, upper.1),
            Vec3::new(-4.0, upper.0, upper.1),
        ]);
        scene.add_mesh(&format!("plate {}", i + 1), vec![plate.into_primitive(metal)]);
    }
    let mut light = |name: String, center: Vec3, radius: f32, levels: u32, radiance: Vec3| {
        let emitter = Material { flags: 0, ..Material::emitter(radiance) };
        let emitter = scene.add_material(&name, emitter);
        let sphere = shapes::sphere(center, radius, levels).into_primitive(emitter);
        scene.add_mesh(&name, vec![sphere]);
    };
    for (i, (x, radius, tint)) in LIGHTS.into_iter().enumerate() {
        let radiance = tint * (LUMINANCE / (tint.dot(REC709) * radius * radius));
        light(format!("light {}", i + 1), Vec3::new(x, 0.0, 0.0), radius, 3, radiance);
    }
    light("fill".to_owned(), Vec3::new(10.0, 10.0, 4.0), 0.5, 2, Vec3::splat(80_000.0));
    scene.views.push(view("front", Vec3::new(0.0, 2.0, 15.0), Vec3::new(0.0, -2.0, 2.5), 28.0));
    scene
}
