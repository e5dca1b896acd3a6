//! A teapot in a stadium: a small thing of many triangles in a large thing of many more.
//!
//! The phrase is Eric Haines's for the case that defeats uniform grids ("Spline Surface Rendering,
//! and What's Wrong with Octrees", Ray Tracing News, 1988): a cell that suits the stadium holds the
//! whole teapot.

mod pitch;
mod stands;

use glam::Vec3;

use super::{Parameter, ParameterKind, Values, new_scene, outdoors::add_daylight, view::view};
use crate::{
    Material, Scene,
    shapes::{self, Shape, trig},
};

pub(super) const PARAMETERS: &[Parameter] = &[Parameter {
    name: "rows",
    meaning: "rows of seats, some 900 seats of 24 triangles each",
    kind: ParameterKind::Number { default: 24.0, min: 1.0, max: 80.0 },
}];

pub(super) fn build(values: &Values) -> Scene {
    let rows = values.get("rows").round() as u32;
    let mut scene = new_scene("stadium");
    let mut add = |name: &str, shape: Shape, material: Material| {
        let material = scene.add_material(name, material);
        scene.add_mesh(name, vec![shape.into_primitive(material)]);
    };

    let stands = stands::build(rows);
    add("concrete", stands.concrete, Material::diffuse(Vec3::new(0.42, 0.41, 0.39)));
    add("roof", stands.roof, Material::diffuse(Vec3::new(0.68, 0.69, 0.70)));
    let colors = [
        ("blue seats", Vec3::new(0.025, 0.085, 0.33)),
        ("white seats", Vec3::new(0.68, 0.69, 0.70)),
        ("red seats", Vec3::new(0.42, 0.03, 0.028)),
    ];
    for (shape, (name, color)) in stands.seats.into_iter().zip(colors) {
        if !shape.indices.is_empty() {
            add(name, shape, Material::diffuse(color));
        }
    }

    let pitch = pitch::build();
    add("surround", pitch.surround, Material::diffuse(Vec3::new(0.20, 0.095, 0.06)));
    add("light grass", pitch.light, Material::diffuse(Vec3::new(0.115, 0.235, 0.04)));
    add("dark grass", pitch.dark, Material::diffuse(Vec3::new(0.07, 0.165, 0.028)));
    add("lines", pitch.lines, Material::diffuse(Vec3::new(0.75, 0.76, 0.74)));
    add("goals", pitch.goals, Material::plastic(Vec3::new(0.75, 0.75, 0.74), 0.4));
    add("blades", pitch.blades, Material::diffuse(Vec3::new(0.16, 0.31, 0.05)));

    // Newell's unit in metres: a pot as tall as the real one, 0.2 m.
    let pot = shapes::teapot(32).placed(0.065, trig::rotation_y(1.15), Vec3::Y * 0.004);
    add("teapot", pot, Material::plastic(Vec3::new(0.52, 0.085, 0.03), 0.2));

    add_daylight(&mut scene, Vec3::new(0.62, 0.60, 0.50));
    let close = Vec3::new(0.74, 0.21, 0.13);
    scene.views.push(view("teapot", close, Vec3::new(0.0, 0.135, 0.012), 40.0));
    let tribune = Vec3::new(22.0, 8.6, 51.0);
    scene.views.push(view("tribune", tribune, Vec3::new(-8.0, 0.5, 0.0), 52.0));
    scene
}
