//! The stands: terraces in the form of a rectangle with round corners, their seats and a roof.

use glam::Vec3;
use rayburst_math::hash::Rng;

use crate::shapes::{Shape, trig};

/// Half the straight parts of the sides, and the corners' radius at the first row; metres.
const STRAIGHT: [f32; 2] = [44.0, 26.0];
const CORNER: f32 = 17.0;
/// Segments of a quarter circle.
const SEGMENTS: u32 = 12;

/// A row's depth and rise, the height of the first one.
const DEPTH: f32 = 0.8;
const RISE: f32 = 0.42;
const BASE: f32 = 1.3;

pub(super) struct Stands {
    pub(super) concrete: Shape,
    pub(super) roof: Shape,
    /// By colour.
    pub(super) seats: [Shape; 3],
}

/// A place on the curve around the field.
#[derive(Clone, Copy)]
struct Station {
    position: Vec3,
    outward: Vec3,
}

pub(super) fn build(rows: u32) -> Stands {
    let mut stands = Stands {
        concrete: Shape::default(),
        roof: Shape::default(),
        seats: std::array::from_fn(|_| Shape::default()),
    };
    let mut rng = Rng::new(1988);
    for row in 0..rows {
        let (near, far) = (row as f32 * DEPTH, (row + 1) as f32 * DEPTH);
        let height = BASE + row as f32 * RISE;
        let below = if row == 0 { 0.0 } else { height - RISE };
        strip(&mut stands.concrete, [(near, below), (near, height)]);
        strip(&mut stands.concrete, [(near, height), (far, height)]);
        add_seats(&mut stands.seats, row, near + 0.3, height, &mut rng);
    }
    let (back, top) = (rows as f32 * DEPTH, BASE + rows as f32 * RISE);
    // A wall behind the last row, and the outside.
    let wall = top + 2.2;
    strip(&mut stands.concrete, [(back, top - RISE), (back, wall)]);
    strip(&mut stands.concrete, [(back, wall), (back + 0.5, wall)]);
    strip(&mut stands.concrete, [(back + 0.5, wall), (back + 0.5, 0.0)]);
    // A roof over the upper rows, held by columns.
    let eaves = [(0.45 * back, top + 6.0), (0.45 * back, top + 6.5), (back + 1.5, top + 5.0)];
    strip(&mut stands.roof, [eaves[0], eaves[1]]);
    strip(&mut stands.roof, [eaves[1], eaves[2]]);
    strip(&mut stands.roof, [eaves[2], (back + 1.5, top + 4.6)]);
    strip(&mut stands.roof, [(back + 1.5, top + 4.6), eaves[0]]);
    let length = perimeter(back + 0.25);
    let columns = (length / 9.0) as u32;
    for i in 0..columns {
        let s = at(back + 0.25, length * i as f32 / columns as f32);
        add_box(&mut stands.concrete, s, -0.25, wall, 0.0, [0.3, top + 5.4 - wall, 0.5]);
    }
    stands
}

/// Seats along a row, with aisles between them.
fn add_seats(seats: &mut [Shape; 3], row: u32, offset: f32, height: f32, rng: &mut Rng) {
    let length = perimeter(offset);
    let count = (length / 0.52) as u32;
    for i in 0..count {
        if i % 26 < 2 {
            continue;
        }
        let s = at(offset, length * (i as f32 + 0.5) / count as f32);
        let color = match row % 12 {
            8 | 9 => 1,
            10 => 2,
            _ if rng.below(40) == 0 => 1,
            _ => 0,
        };
        let shape = &mut seats[color];
        add_box(shape, s, 0.0, height + 0.36, 0.0, [0.44, 0.06, 0.4]);
        add_box(shape, s, 0.34, height + 0.42, 0.1, [0.44, 0.4, 0.05]);
    }
}

/// A box that stands at a station: width along the curve, height, depth outwards; `forward` is its
/// front's distance from the station, `lean` how far its top leans outwards.
fn add_box(
    shape: &mut Shape,
    station: Station,
    forward: f32,
    base: f32,
    lean: f32,
    [width, height, depth]: [f32; 3],
) {
    let along = Vec3::Y.cross(station.outward);
    let front = station.position + station.outward * forward;
    let ring = |y: f32, out: f32| {
        let corner = |side: f32, deep: f32| {
            front + along * (side * width) + station.outward * (deep * depth + out) + Vec3::Y * y
        };
        // Counter-clockwise from above: `along` leads to the right of one who looks inwards.
        [corner(-0.5, 1.0), corner(0.5, 1.0), corner(0.5, 0.0), corner(-0.5, 0.0)]
    };
    shape.add_hexahedron(ring(base, 0.0), ring(base + height, lean));
}

/// Sweeps a segment between two points (offset outwards, height) around the field. A segment that
/// runs outwards has its front above, one that runs up towards the field.
fn strip(shape: &mut Shape, [from, to]: [(f32, f32); 2]) {
    let stations = 4 * (SEGMENTS + 1);
    let place = |i: u32, (offset, height): (f32, f32)| {
        let (side, step) = ((i / (SEGMENTS + 1)) % 4, i % (SEGMENTS + 1));
        corner(offset, side, step).position + Vec3::Y * height
    };
    for i in 0..stations {
        let j = (i + 1) % stations;
        shape.add_quad([place(j, from), place(i, from), place(i, to), place(j, to)]);
    }
}

/// Directions of the four sides: outwards, and along counter-clockwise seen from above.
fn side_axes(side: u32) -> (Vec3, Vec3) {
    match side {
        0 => (Vec3::Z, Vec3::X),
        1 => (Vec3::X, Vec3::NEG_Z),
        2 => (Vec3::NEG_Z, Vec3::NEG_X),
        _ => (Vec3::NEG_X, Vec3::Z),
    }
}

/// Half the length of a side's straight part.
fn straight(side: u32) -> f32 {
    STRAIGHT[(side % 2) as usize]
}

/// Station `step` of `SEGMENTS` of the corner after a side.
fn corner(offset: f32, side: u32, step: u32) -> Station {
    let (outward, along) = side_axes(side);
    let middle = along * straight(side) + outward * straight(side + 1);
    let (sin, cos) = trig::turn(step, 4 * SEGMENTS);
    let outward = outward * cos + along * sin;
    Station { position: middle + outward * (CORNER + offset), outward }
}

fn perimeter(offset: f32) -> f32 {
    4.0 * (STRAIGHT[0] + STRAIGHT[1]) + std::f32::consts::TAU * (CORNER + offset)
}

/// The station a length along the curve.
fn at(offset: f32, length: f32) -> Station {
    let radius = CORNER + offset;
    let quarter = std::f32::consts::FRAC_PI_2 * radius;
    let mut rest = length;
    for side in 0..4 {
        let (outward, along) = side_axes(side);
        let half = straight(side);
        if rest < 2.0 * half {
            let position = along * (rest - half) + outward * (straight(side + 1) + radius);
            return Station { position, outward };
        }
        rest -= 2.0 * half;
        if rest < quarter || side == 3 {
            let (sin, cos) = trig::sin_cos((rest / radius).min(std::f32::consts::FRAC_PI_2));
            let middle = along * half + outward * straight(side + 1);
            let outward = outward * cos + along * sin;
            return Station { position: middle + outward * radius, outward };
        }
        rest -= quarter;
    }
    corner(offset, 3, SEGMENTS)
}
