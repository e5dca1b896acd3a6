//! A reflective hemisphere in a room of checkerboards: reflections that magnify and minify, for
//! texture filtering.

use glam::Vec3;

use super::{Values, checker::add_checker, new_scene, view::view};
use crate::{
    Material, Scene, TextureSlot,
    shapes::{self, Shape},
};

/// Half the width of the room and its height, metres.
const HALF: f32 = 3.0;
const HEIGHT: f32 = 3.6;
/// Half the width of the luminous panel in the ceiling: large, so that the light that the mirror
/// throws on the walls is soft.
const PANEL: f32 = 2.4;

pub(super) fn build(_: &Values) -> Scene {
    let mut scene = new_scene("hemisphere-room");
    // Corners by signs of x and z.
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x * HALF, y * HEIGHT, z * HALF);
    let sides = [
        (
            "floor",
            [[232, 229, 222], [38, 40, 44]],
            [corner(-1., 0., 1.), corner(1., 0., 1.), corner(1., 0., -1.), corner(-1., 0., -1.)],
        ),
        (
            "back wall",
            [[236, 228, 208], [122, 84, 52]],
            [corner(-1., 0., -1.), corner(1., 0., -1.), corner(1., 1., -1.), corner(-1., 1., -1.)],
        ),
        (
            "front wall",
            [[226, 232, 220], [74, 104, 66]],
            [corner(1., 0., 1.), corner(-1., 0., 1.), corner(-1., 1., 1.), corner(1., 1., 1.)],
        ),
        (
            "left wall",
            [[240, 222, 214], [168, 46, 38]],
            [corner(-1., 0., 1.), corner(-1., 0., -1.), corner(-1., 1., -1.), corner(-1., 1., 1.)],
        ),
        (
            "right wall",
            [[216, 226, 240], [38, 78, 150]],
            [corner(1., 0., -1.), corner(1., 0., 1.), corner(1., 1., 1.), corner(1., 1., -1.)],
        ),
    ];
    for (name, colors, corners) in sides {
        let texture = add_checker(&mut scene, colors);
        let material = Material {
            base_color_texture: TextureSlot::new(texture),
            ..Material::diffuse(Vec3::ONE)
        };
        let material = scene.add_material(name, material);
        let mut side = Shape::default();
        // Two squares a repeat: squares of 0.3 m.
        side.add_textured_quad(corners, 1.0 / 0.6);
        scene.add_mesh(name, vec![side.into_primitive(material)]);
    }

    let white = scene.add_material("ceiling", Material::diffuse(Vec3::splat(0.8)));
    let glow = Material { flags: 0, ..Material::emitter(Vec3::new(800.0, 780.0, 745.0)) };
    let glow = scene.add_material("panel", glow);
    let down = |half: f32| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, z)| Vec3::new(x * half, HEIGHT, z * half))
    };
    let (outer, inner) = (down(HALF), down(PANEL));
    let mut ceiling = Shape::default();
    for i in 0..4 {
        let j = (i + 1) % 4;
        ceiling.add_quad([outer[i], outer[j], inner[j], inner[i]]);
    }
    scene.add_mesh("ceiling", vec![ceiling.into_primitive(white)]);
    let mut panel = Shape::default();
    panel.add_quad(inner);
    scene.add_mesh("panel", vec![panel.into_primitive(glow)]);

    let mirror = scene.add_material("mirror", Material::mirror(Vec3::splat(0.92)));
    let dome = shapes::hemisphere(Vec3::ZERO, 1.25, 512);
    scene.add_mesh("hemisphere", vec![dome.into_primitive(mirror)]);
    scene.views.push(view("door", Vec3::new(0.9, 2.1, 2.85), Vec3::new(-0.1, 0.62, -0.3), 52.0));
    scene
}
