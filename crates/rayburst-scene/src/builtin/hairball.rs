//! A ball of curly hair: long thin triangles in every direction, the hard case for boxes.
//!
//! In the spirit of Laine, Karras: "Efficient Sparse Voxel Octrees", I3D 2010, whose hairball became
//! a common benchmark; the strands here are our own.

use glam::{Mat3, Vec3};
use rayburst_math::{Frame, hash::Rng};

use super::{Parameter, ParameterKind, Values, new_scene, outdoors::add_daylight, view::view};
use crate::{
    Material, Scene,
    shapes::{self, Shape, trig},
};

pub(super) const PARAMETERS: &[Parameter] = &[Parameter {
    name: "triangles",
    meaning: "number of triangles, about",
    kind: ParameterKind::Number { default: 1_400_000.0, min: 1000.0, max: 50_000_000.0 },
}];

/// Points along a strand, sides around it.
const POINTS: u32 = 64;
const SIDES: u32 = 3;

/// Radii of the ball's core and of its outside, metres.
const CORE: f32 = 0.55;
const OUTSIDE: f32 = 1.0;

const COLORS: [(&str, Vec3); 3] = [
    ("copper hair", Vec3::new(0.42, 0.13, 0.045)),
    ("blond hair", Vec3::new(0.62, 0.36, 0.14)),
    ("dark hair", Vec3::new(0.17, 0.055, 0.03)),
];

pub(super) fn build(values: &Values) -> Scene {
    let strands = (values.get("triangles") / f64::from(2 * SIDES * POINTS)).round().max(1.0) as u32;
    let mut scene = new_scene("hairball");
    let mut shapes = vec![Shape::default(); COLORS.len()];
    // Fewer strands are thicker, so that the ball stays a ball.
    let radius = 0.0042 * (3600.0 / strands as f32).sqrt().clamp(0.2, 3.0);
    let mut line = Vec::with_capacity(POINTS as usize);
    for i in 0..strands {
        let mut rng = Rng::new(u64::from(i) + 0x4A12);
        let color = [0, 0, 1, 0, 2][rng.below(5) as usize];
        grow(i, strands, &mut rng, &mut line);
        let taper = |k: usize| radius * (1.0 - 0.75 * (k as f32 / POINTS as f32));
        shapes::tube(&mut shapes[color], &line, taper, SIDES);
    }
    for (shape, (name, color)) in shapes.into_iter().zip(COLORS) {
        let material = scene.add_material(name, Material::plastic(color, 0.4));
        if !shape.indices.is_empty() {
            scene.add_mesh(name, vec![shape.into_primitive(material)]);
        }
    }

    let stone = scene.add_material("floor", Material::diffuse(Vec3::new(0.42, 0.43, 0.45)));
    let mut floor = Shape::default();
    let (half, y) = (30.0, -OUTSIDE - 0.06);
    floor.add_quad([
        Vec3::new(-half, y, half),
        Vec3::new(half, y, half),
        Vec3::new(half, y, -half),
        Vec3::new(-half, y, -half),
    ]);
    scene.add_mesh("floor", vec![floor.into_primitive(stone)]);
    add_daylight(&mut scene, Vec3::new(-0.6, 0.75, 0.6));
    scene.views.push(view("front", Vec3::new(0.0, 0.7, 4.9), Vec3::new(0.04, -0.09, 0.0), 34.0));
    scene
}

/// The line of strand `index`: it leaves the core, curls around an axis of its own and is drawn back
/// into the shell.
fn grow(index: u32, strands: u32, rng: &mut Rng, line: &mut Vec<Vec3>) {
    // Roots on a spherical Fibonacci lattice (Swinbank, Purser 2006): even for any number.
    let z = 1.0 - (2.0 * index as f32 + 1.0) / strands as f32;
    let golden = 0.618_034;
    let (sin, cos) = trig::sin_cos((index as f32 * golden).fract() * std::f32::consts::TAU);
    let r = (1.0 - z * z).max(0.0).sqrt();
    let root = Vec3::new(r * cos, z, r * sin);

    let frame = Frame::from_normal(root);
    let (sin, cos) = trig::sin_cos(rng.range(0.0, std::f32::consts::TAU));
    let drift = frame.to_world(Vec3::new(cos, sin, 0.0));
    let curl = rng.range(0.16, 0.34) * if rng.below(2) == 0 { 1.0 } else { -1.0 };
    let (sin, cos) = trig::sin_cos(curl);
    let axis = (drift + 0.45 * (rng.vec3() - Vec3::splat(0.5))).normalize();
    let spin = rotation(axis, sin, cos);
    let step = rng.range(0.028, 0.04);
    let mut position = root * CORE;
    let mut direction = (root + 0.35 * drift).normalize();
    line.clear();
    for _ in 0..POINTS {
        line.push(position);
        // Held between the core and the outside; between them it drifts along.
        let distance = position.length();
        let outward = position / distance;
        let pull = (distance - 0.5 * (CORE + OUTSIDE)) / (0.5 * (OUTSIDE - CORE));
        direction = spin * direction - outward * (0.11 * pull * pull * pull);
        direction = (direction + drift * 0.035).normalize();
        position += direction * step;
    }
}

/// The rotation about a unit axis (Rodrigues).
fn rotation(axis: Vec3, sin: f32, cos: f32) -> Mat3 {
    let column = |v: Vec3| v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos));
    Mat3::from_cols(column(Vec3::X), column(Vec3::Y), column(Vec3::Z))
}
