//! What lies between the buildings: pavements, road paint, trees, cars, parks.

use glam::Vec3;
use rayburst_math::hash::Rng;

use super::{City, LOT, STREET, Stuff};
use crate::shapes::{self, trig};

/// Height of the pavement above the road.
pub(super) const KERB: f32 = 0.15;

/// Adds the pavement of a block, its trees, and the cars and paint on the streets at two of its
/// sides.
pub(super) fn add_around(city: &mut City, corner: Vec3, size: Vec3, rng: &mut Rng) {
    let walk = 3.0;
    let out = Vec3::new(walk, 0.0, walk);
    city.add(Stuff::Pavement, corner - out, size + 2.0 * out + Vec3::Y * KERB);
    for (far, at) in [
        (size.z, 1.2),
        (size.z, size.x * 0.36),
        (size.z, size.x * 0.7),
        (0.0, 1.2),
        (0.0, size.x * 0.5),
    ] {
        let beside = if far > 0.0 { far + 1.6 } else { -1.6 };
        add_tree(city, corner + Vec3::new(at + rng.range(0.0, 6.0), KERB, beside), rng);
    }
    for along in [0.25, 0.75] {
        for beside in [-1.6, size.x + 1.6] {
            add_tree(
                city,
                corner + Vec3::new(beside, KERB, size.z * along + rng.range(-4.0, 4.0)),
                rng,
            );
        }
    }
    // The streets to the south and to the east.
    let dash = |i: u32, length: f32, count: u32| length * (i as f32 + 0.25) / count as f32;
    for i in 0..6 {
        let south = Vec3::new(dash(i, size.x, 6), 0.0, size.z + 0.5 * STREET - 0.08);
        city.add(Stuff::Paint, corner + south, Vec3::new(4.0, 0.01, 0.16));
        let east = Vec3::new(size.x + 0.5 * STREET - 0.08, 0.0, dash(i, size.z, 6));
        city.add(Stuff::Paint, corner + east, Vec3::new(0.16, 0.01, 4.0));
    }
    for lane in [-2.6, 2.6] {
        for i in 0..4 {
            if rng.below(3) == 0 {
                continue;
            }
            let along = (i as f32 + rng.range(0.1, 0.8)) / 4.0;
            let south = Vec3::new(size.x * along, 0.0, size.z + 0.5 * STREET + lane);
            add_car(city, corner + south, true, rng);
            let east = Vec3::new(size.x + 0.5 * STREET + lane, 0.0, size.z * along);
            add_car(city, corner + east, false, rng);
        }
    }
}

/// Adds a lawn with trees in place of a building.
pub(super) fn add_park(city: &mut City, lot: Vec3, rng: &mut Rng) {
    let lawn = Vec3::new(LOT - 3.0, 0.1, LOT - 3.0);
    city.add(Stuff::Leaves, lot + Vec3::new(1.5, 0.0, 1.5), lawn);
    for _ in 0..9 {
        let at = Vec3::new(rng.range(3.0, LOT - 3.0), 0.1, rng.range(3.0, LOT - 3.0));
        add_tree(city, lot + at, rng);
    }
}

fn add_tree(city: &mut City, foot: Vec3, rng: &mut Rng) {
    let tall = rng.range(2.2, 3.6);
    let crown = rng.range(1.3, 2.2);
    city.add(Stuff::Trunk, foot - Vec3::new(0.14, 0.0, 0.14), Vec3::new(0.28, tall, 0.28));
    let turn = trig::rotation_y(rng.range(0.0, 6.0));
    let mut leaves = shapes::sphere(Vec3::ZERO, crown, 1);
    leaves.normals.clear();
    for p in &mut leaves.positions {
        *p *= rng.range(0.78, 1.12);
    }
    let leaves = leaves.placed(1.0, turn, foot + Vec3::Y * (tall + 0.6 * crown));
    city.shape(Stuff::Leaves).append(&leaves);
}

fn add_car(city: &mut City, middle: Vec3, along_x: bool, rng: &mut Rng) {
    let paint = [Stuff::CarRed, Stuff::CarWhite, Stuff::CarBlue, Stuff::CarBlack, Stuff::CarWhite]
        [rng.below(5) as usize];
    let mut part = |stuff: Stuff, from: Vec3, size: Vec3| {
        let turned = |v: Vec3| if along_x { v } else { Vec3::new(v.z, v.y, v.x) };
        city.add(stuff, middle + turned(from), turned(size));
    };
    part(paint, Vec3::new(-2.1, 0.35, -0.9), Vec3::new(4.2, 0.55, 1.8));
    part(Stuff::Glass, Vec3::new(-1.2, 0.9, -0.8), Vec3::new(2.3, 0.42, 1.6));
    part(paint, Vec3::new(-1.1, 1.32, -0.8), Vec3::new(2.1, 0.08, 1.6));
    for (x, z) in [(-1.4, -0.92), (1.4, -0.92), (-1.4, 0.72), (1.4, 0.72)] {
        part(Stuff::CarBlack, Vec3::new(x - 0.32, 0.0, z), Vec3::new(0.64, 0.62, 0.2));
    }
}
