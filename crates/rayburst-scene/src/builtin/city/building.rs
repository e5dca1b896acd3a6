//! Buildings: slabs and ribbons of glass, punched windows, towers with setbacks.

use glam::Vec3;
use rayburst_math::hash::Rng;

use super::{City, LOT, Stuff};

const FLOOR: f32 = 3.4;

/// Adds a building on a lot; `downtown` in (0, 1] raises it.
pub(super) fn add(city: &mut City, lot: Vec3, downtown: f32, rng: &mut Rng) {
    let (width, depth) = (rng.range(15.0, LOT - 4.0), rng.range(14.0, LOT - 4.0));
    let margin = 0.5 * (Vec3::new(LOT, 0.0, LOT) - Vec3::new(width, 0.0, depth));
    let corner = lot + margin;
    let size = Vec3::new(width, 0.0, depth);
    let draw = rng.f32();
    let floors = 3 + (draw * draw * draw * 44.0 * downtown) as u32 + rng.below(5);
    let walls =
        [Stuff::Concrete, Stuff::Limestone, Stuff::Brick, Stuff::Terracotta][rng.below(4) as usize];
    if floors > 22 {
        tower(city, corner, size, floors, walls, rng);
    } else if floors > 8 || rng.below(3) == 0 {
        ribbons(city, corner, size, floors, walls);
        roof(city, corner + Vec3::Y * (floors as f32 * FLOOR), size, walls, rng);
    } else {
        windows(city, corner, size, floors, walls);
        roof(city, corner + Vec3::Y * (floors as f32 * FLOOR), size, walls, rng);
    }
}

/// Storeys of glass set back between slabs; each shares its faces with the next.
fn ribbons(city: &mut City, corner: Vec3, size: Vec3, floors: u32, walls: Stuff) {
    let inset = Vec3::new(0.35, 0.0, 0.35);
    for floor in 0..floors {
        let base = corner + Vec3::Y * (floor as f32 * FLOOR);
        let tall = if floor == 0 { 2.8 } else { 1.9 };
        city.add(Stuff::Glass, base + inset, size - 2.0 * inset + Vec3::Y * tall);
        city.add(walls, base + Vec3::Y * tall, size + Vec3::Y * (FLOOR - tall));
    }
}

/// A solid body with windows and their sills in rows.
fn windows(city: &mut City, corner: Vec3, size: Vec3, floors: u32, walls: Stuff) {
    let height = floors as f32 * FLOOR;
    city.add(walls, corner, size + Vec3::Y * height);
    let trim = if walls == Stuff::Limestone { Stuff::Concrete } else { Stuff::Limestone };
    city.add(trim, corner + Vec3::new(-0.15, 3.1, -0.15), size + Vec3::new(0.3, 0.3, 0.3));
    let (wide, tall, out) = (1.5, 1.9, 0.06);
    let mut row = |along_x: bool, far: bool| {
        let length = if along_x { size.x } else { size.z };
        let count = (length / 3.2) as u32;
        let gap = length / count as f32;
        for floor in 0..floors {
            for i in 0..count {
                let at = gap * (i as f32 + 0.5) - 0.5 * wide;
                let up = floor as f32 * FLOOR + if floor == 0 { 0.5 } else { 0.9 };
                let side = |away: f32| match (along_x, far) {
                    (true, false) => Vec3::new(at, up, -away),
                    (true, true) => Vec3::new(at, up, size.z),
                    (false, false) => Vec3::new(-away, up, at),
                    (false, true) => Vec3::new(size.x, up, at),
                };
                let oriented = |wide: f32, tall: f32, out: f32| {
                    if along_x { Vec3::new(wide, tall, out) } else { Vec3::new(out, tall, wide) }
                };
                city.add(Stuff::Glass, corner + side(out), oriented(wide, tall, out));
                let below = Vec3::Y * -0.14;
                city.add(trim, corner + side(0.18) + below, oriented(wide, 0.14, 0.18));
            }
        }
    };
    for (along_x, far) in [(true, false), (true, true), (false, false), (false, true)] {
        row(along_x, far);
    }
}

/// Tiers that step back as they rise, with fins from bottom to top of each.
fn tower(city: &mut City, corner: Vec3, size: Vec3, floors: u32, walls: Stuff, rng: &mut Rng) {
    let tiers = 2 + rng.below(2);
    let (mut corner, mut size) = (corner, size);
    let mut left = floors;
    for tier in 0..tiers {
        let storeys = if tier + 1 == tiers { left } else { left / 2 };
        left -= storeys;
        let height = storeys as f32 * FLOOR;
        let inset = Vec3::new(0.3, 0.0, 0.3);
        city.add(Stuff::Glass, corner + inset, size - 2.0 * inset + Vec3::Y * height);
        for floor in 0..=storeys {
            let base = corner + 0.5 * inset + Vec3::Y * (floor as f32 * FLOOR);
            city.add(walls, base, size - inset + Vec3::Y * 0.6);
        }
        for (length, along_x) in [(size.x, true), (size.z, false)] {
            let count = (length / 2.6) as u32;
            for i in 0..=count {
                let at = (length - 0.35) * i as f32 / count as f32;
                let tall = Vec3::new(0.35, height + 0.6, 0.35);
                let (near, far) = if along_x {
                    (Vec3::new(at, 0.0, 0.0), Vec3::new(at, 0.0, size.z - 0.35))
                } else {
                    (Vec3::new(0.0, 0.0, at), Vec3::new(size.x - 0.35, 0.0, at))
                };
                city.add(walls, corner + near, tall);
                city.add(walls, corner + far, tall);
            }
        }
        corner.y += height;
        roof(city, corner + Vec3::Y * 0.6, size, walls, rng);
        let back = Vec3::new(0.14 * size.x, 0.0, 0.14 * size.z);
        corner += back;
        size -= 2.0 * back;
    }
    let mast = corner + 0.5 * size;
    city.add(
        Stuff::Metal,
        mast - Vec3::new(0.2, 0.0, 0.2),
        Vec3::new(0.4, rng.range(6.0, 18.0), 0.4),
    );
}

/// A flat roof with its parapet, machines and a tank.
fn roof(city: &mut City, corner: Vec3, size: Vec3, walls: Stuff, rng: &mut Rng) {
    city.add(Stuff::Roof, corner, size + Vec3::Y * 0.12);
    let (thick, high) = (0.3, 0.9);
    let along_x = Vec3::new(size.x, high, thick);
    let along_z = Vec3::new(thick, high, size.z - 2.0 * thick);
    city.add(walls, corner, along_x);
    city.add(walls, corner + Vec3::Z * (size.z - thick), along_x);
    city.add(walls, corner + Vec3::Z * thick, along_z);
    city.add(walls, corner + Vec3::new(size.x - thick, 0.0, thick), along_z);
    for _ in 0..1 + rng.below(4) {
        let machine = Vec3::new(rng.range(1.2, 3.4), rng.range(0.9, 2.4), rng.range(1.2, 3.4));
        let room = size - machine - Vec3::new(2.0, 0.0, 2.0);
        let at = Vec3::new(1.0 + room.x * rng.f32(), 0.12, 1.0 + room.z * rng.f32());
        city.add(Stuff::Metal, corner + at, machine);
    }
}
