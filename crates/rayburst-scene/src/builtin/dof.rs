//! Teapots in a row before small lights: what a thin lens keeps sharp and what it blurs.

use glam::Vec3;

use super::{
    Parameter, ParameterKind, Values, new_scene,
    view::{view, with_lens},
};
use crate::{
    Environment, Material, Scene,
    shapes::{self, Shape, trig},
};
use rayburst_math::hash::Rng;

pub(super) const PARAMETERS: &[Parameter] = &[Parameter {
    name: "aperture",
    meaning: "diameter of the lens in millimetres; 0 is a pinhole",
    kind: ParameterKind::Number { default: 50.0, min: 0.0, max: 500.0 },
}];

/// Linear colours of the glazes, from the nearest teapot on.
const GLAZES: [Vec3; 5] = [
    Vec3::new(0.02, 0.12, 0.30),
    Vec3::new(0.55, 0.06, 0.03),
    Vec3::new(0.72, 0.40, 0.05),
    Vec3::new(0.05, 0.28, 0.20),
    Vec3::new(0.62, 0.60, 0.55),
];

pub(super) fn build(values: &Values) -> Scene {
    let mut scene = new_scene("dof");
    scene.environment = Some(Environment::Constant(Vec3::new(4.0, 6.0, 11.0)));

    let table = scene.add_material("table", Material::plastic(Vec3::new(0.11, 0.055, 0.03), 0.3));
    let mut top = Shape::default();
    let (half, far) = (12.0, -24.0);
    top.add_quad([
        Vec3::new(-half, 0.0, 2.0),
        Vec3::new(half, 0.0, 2.0),
        Vec3::new(half, 0.0, far),
        Vec3::new(-half, 0.0, far),
    ]);
    scene.add_mesh("table", vec![top.into_primitive(table)]);

    // Newell's unit in metres: a pot of 0.2 m.
    let scale = 0.065;
    let mut second = Vec3::ZERO;
    for (i, color) in GLAZES.into_iter().enumerate() {
        let step = i as f32;
        let place = Vec3::new(-0.34 + 0.27 * step, 0.0, 0.12 - 0.5 * step);
        if i == 1 {
            second = place + Vec3::new(0.0, 0.1, 0.12);
        }
        let glaze = scene.add_material(&format!("glaze {}", i + 1), Material::plastic(color, 0.12));
        let pot = shapes::teapot(24).placed(scale, trig::rotation_y(-0.45 + 0.15 * step), place);
        scene.add_mesh(&format!("teapot {}", i + 1), vec![pot.into_primitive(glaze)]);
    }

    // A soft box above, out of the picture.
    let soft_box = Material { flags: 0, ..Material::emitter(Vec3::new(1500.0, 1350.0, 1150.0)) };
    let soft_box = scene.add_material("soft box", soft_box);
    let mut panel = Shape::default();
    panel.add_quad([
        Vec3::new(-1.4, 2.4, -2.4),
        Vec3::new(0.6, 2.4, -2.4),
        Vec3::new(0.6, 2.4, 0.4),
        Vec3::new(-1.4, 2.4, 0.4),
    ]);
    scene.add_mesh("soft box", vec![panel.into_primitive(soft_box)]);

    let tints = [
        Vec3::new(1.0, 0.62, 0.28),
        Vec3::new(1.0, 0.82, 0.5),
        Vec3::new(0.95, 0.35, 0.22),
        Vec3::new(0.45, 0.7, 1.0),
    ];
    let mut bulbs = vec![Shape::default(); tints.len()];
    let mut rng = Rng::new(26_24);
    for i in 0..44 {
        let center = Vec3::new(rng.range(-3.0, 4.6), rng.range(0.2, 2.2), rng.range(-8.0, -5.5));
        let bulb = shapes::sphere(center, rng.range(0.06, 0.09), 2);
        bulbs[i % tints.len()].append(&bulb);
    }
    for (i, (shape, tint)) in bulbs.into_iter().zip(tints).enumerate() {
        let glow = Material { flags: 0, ..Material::emitter(tint * 700.0) };
        let glow = scene.add_material(&format!("bulbs {}", i + 1), glow);
        scene.add_mesh(&format!("bulbs {}", i + 1), vec![shape.into_primitive(glow)]);
    }

    let table_level =
        view("table", Vec3::new(-0.42, 0.30, 1.05), Vec3::new(0.03, 0.14, -0.5), 31.0);
    let aperture = values.get("aperture") as f32 * 0.001;
    scene.views.push(with_lens(table_level, aperture, second));
    scene
}
