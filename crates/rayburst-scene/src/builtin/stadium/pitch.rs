//! The field: mown stripes, lines, goals, and blades of grass where the teapot stands.
//!
//! Measures after the Laws of the Game (IFAB): 105 m by 68 m, circle of 9.15 m, goals of 7.32 m.

use glam::Vec3;
use rayburst_math::hash::Rng;

use crate::shapes::{self, Shape, noise, trig};

const LENGTH: f32 = 105.0;
const WIDTH: f32 = 68.0;
const STRIPES: u32 = 20;
/// Lines lie this much above the grass, and are this wide.
const LIFT: f32 = 0.004;
const LINE: f32 = 0.12;

pub(super) struct Pitch {
    pub(super) surround: Shape,
    pub(super) light: Shape,
    pub(super) dark: Shape,
    pub(super) lines: Shape,
    pub(super) goals: Shape,
    pub(super) blades: Shape,
}

pub(super) fn build() -> Pitch {
    let mut surround = Shape::default();
    rectangle(&mut surround, -400.0, 400.0, -400.0, 400.0, -0.02);
    let (mut light, mut dark) = (Shape::default(), Shape::default());
    let margin = 2.5;
    let stripe = LENGTH / STRIPES as f32;
    for i in 0..STRIPES {
        let x = -0.5 * LENGTH + stripe * i as f32;
        let shape = if i % 2 == 0 { &mut light } else { &mut dark };
        let (first, last) = (i == 0, i + 1 == STRIPES);
        let from = if first { x - margin } else { x };
        let to = if last { x + stripe + margin } else { x + stripe };
        rectangle(shape, from, to, -0.5 * WIDTH - margin, 0.5 * WIDTH + margin, 0.0);
    }
    Pitch { surround, light, dark, lines: lines(), goals: goals(), blades: blades() }
}

fn rectangle(shape: &mut Shape, x0: f32, x1: f32, z0: f32, z1: f32, y: f32) {
    shape.add_quad([
        Vec3::new(x0, y, z1),
        Vec3::new(x1, y, z1),
        Vec3::new(x1, y, z0),
        Vec3::new(x0, y, z0),
    ]);
}

fn lines() -> Shape {
    let mut lines = Shape::default();
    let (half_length, half_width) = (0.5 * LENGTH, 0.5 * WIDTH);
    let mut frame = |x0: f32, x1: f32, z0: f32, z1: f32| {
        rectangle(&mut lines, x0, x1, z0, z0 + LINE, LIFT);
        rectangle(&mut lines, x0, x1, z1 - LINE, z1, LIFT);
        rectangle(&mut lines, x0, x0 + LINE, z0 + LINE, z1 - LINE, LIFT);
        rectangle(&mut lines, x1 - LINE, x1, z0 + LINE, z1 - LINE, LIFT);
    };
    frame(-half_length, half_length, -half_width, half_width);
    for (deep, half) in [(16.5, 20.16), (5.5, 9.16)] {
        frame(-half_length, -half_length + deep, -half, half);
        frame(half_length - deep, half_length, -half, half);
    }
    let half = 0.5 * LINE;
    rectangle(&mut lines, -half, half, -half_width + LINE, half_width - LINE, LIFT);
    let segments = 128;
    for i in 0..segments {
        let spoke = |i: u32, radius: f32| {
            let (sin, cos) = trig::turn(i, segments);
            Vec3::new(radius * cos, LIFT, -radius * sin)
        };
        let (inner, outer) = (9.15 - LINE, 9.15);
        lines.add_quad([
            spoke(i, inner),
            spoke(i, outer),
            spoke(i + 1, outer),
            spoke(i + 1, inner),
        ]);
    }
    lines
}

fn goals() -> Shape {
    let mut goals = Shape::default();
    for x in [-0.5 * LENGTH, 0.5 * LENGTH] {
        let post = |y: f32, z: f32| Vec3::new(x, y, z * 3.66);
        for line in [
            [post(0.0, -1.0), post(2.44, -1.0)],
            [post(0.0, 1.0), post(2.44, 1.0)],
            [post(2.44, -1.0), post(2.44, 1.0)],
        ] {
            shapes::tube(&mut goals, &line, |_| 0.06, 12);
        }
    }
    goals
}

/// Bent blades around the middle, denser where one looks closely.
fn blades() -> Shape {
    let mut blades = Shape::default();
    let mut rng = Rng::new(10_568);
    for _ in 0..90_000 {
        // Density falls with the square of the distance.
        let u = rng.f32();
        let radius = 0.02 + 3.2 * u * u * 0.5 + 1.1 * u * 0.9;
        let (sin, cos) = trig::sin_cos(rng.range(0.0, std::f32::consts::TAU));
        let root = Vec3::new(radius * cos, 0.0, radius * sin);
        // The middle line is painted on the grass: no blade stands through it.
        if root.x.abs() < 0.5 * LINE {
            continue;
        }
        let (sin, cos) = trig::sin_cos(rng.range(0.0, std::f32::consts::TAU));
        let lean = Vec3::new(sin, 0.0, cos) * rng.range(0.002, 0.016);
        let (sin, cos) = trig::sin_cos(rng.range(0.0, std::f32::consts::TAU));
        let wide = Vec3::new(sin, 0.0, cos) * rng.range(0.0011, 0.002);
        let patch = noise::gradient(glam::Vec2::new(root.x, root.z) * 6.0, 3);
        let tall = rng.range(0.018, 0.032) * (1.0 + 0.25 * patch);
        let middle = root + 0.35 * lean + Vec3::Y * (0.6 * tall);
        let tip = root + lean + Vec3::Y * tall;
        let base = blades.positions.len() as u32;
        blades.positions.extend([
            root - wide,
            root + wide,
            middle - 0.7 * wide,
            middle + 0.7 * wide,
            tip,
        ]);
        blades.indices.extend([[0, 1, 3], [0, 3, 2], [2, 3, 4]].map(|t| t.map(|i| base + i)));
    }
    blades
}
