//! The Utah teapot: Martin Newell's 32 bicubic Bézier patches (1975), tessellated.
//!
//! Newell measured a Melitta teapot; body and lid are surfaces of revolution whose quarter circles
//! are the cubic with handles at 0.56 of the radius, so that their 24 patches are six profile
//! curves; handle and spout are two patches each and their mirror images. Blinn's bottom (1987) is
//! included, his vertical scale of 1.3 is that of the data. Changed: the knob's control points at
//! (0.8, 0.45) use the exact 0.448, the slit between lid and rim is bridged, and the ends of handle
//! and spout are closed, so that the teapot is three closed surfaces.

use glam::{Vec2, Vec3};

use super::Shape;

/// Control points (radius, height) of the profile from the knob down to the centre of the bottom.
const PROFILE: [[(f32, f32); 4]; 6] = [
    [(0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)],
    [(0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)],
    [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)],
    [(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)],
    [(2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)],
    [(1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)],
];

/// A quarter circle of radius 1 as Newell drew it.
const ARC: [Vec2; 4] =
    [Vec2::new(1.0, 0.0), Vec2::new(1.0, 0.56), Vec2::new(0.56, 1.0), Vec2::new(0.0, 1.0)];

/// Control points (x, height, half width) across half a tube, from one edge in the plane of symmetry
/// to the other.
type Row = [(f32, f32, f32); 4];

/// Rows along the handle's two patches, from its upper end; the patches share the middle row.
const HANDLE: [Row; 7] = [
    [(-1.6, 2.025, 0.0), (-1.6, 2.025, 0.3), (-1.5, 2.25, 0.3), (-1.5, 2.25, 0.0)],
    [(-2.3, 2.025, 0.0), (-2.3, 2.025, 0.3), (-2.5, 2.25, 0.3), (-2.5, 2.25, 0.0)],
    [(-2.7, 2.025, 0.0), (-2.7, 2.025, 0.3), (-3.0, 2.25, 0.3), (-3.0, 2.25, 0.0)],
    [(-2.7, 1.8, 0.0), (-2.7, 1.8, 0.3), (-3.0, 1.8, 0.3), (-3.0, 1.8, 0.0)],
    [(-2.7, 1.575, 0.0), (-2.7, 1.575, 0.3), (-3.0, 1.35, 0.3), (-3.0, 1.35, 0.0)],
    [(-2.5, 1.125, 0.0), (-2.5, 1.125, 0.3), (-2.65, 0.9375, 0.3), (-2.65, 0.9375, 0.0)],
    [(-2.0, 0.9, 0.0), (-2.0, 0.9, 0.3), (-1.9, 0.6, 0.3), (-1.9, 0.6, 0.0)],
];

/// Rows along the spout's two patches, from its root.
const SPOUT: [Row; 7] = [
    [(1.7, 1.425, 0.0), (1.7, 1.425, 0.66), (1.7, 0.6, 0.66), (1.7, 0.6, 0.0)],
    [(2.6, 1.425, 0.0), (2.6, 1.425, 0.66), (3.1, 0.825, 0.66), (3.1, 0.825, 0.0)],
    [(2.3, 2.1, 0.0), (2.3, 2.1, 0.25), (2.4, 2.025, 0.25), (2.4, 2.025, 0.0)],
    [(2.7, 2.4, 0.0), (2.7, 2.4, 0.25), (3.3, 2.4, 0.25), (3.3, 2.4, 0.0)],
    [(2.8, 2.475, 0.0), (2.8, 2.475, 0.25), (3.525, 2.49375, 0.25), (3.525, 2.49375, 0.0)],
    [(2.9, 2.475, 0.0), (2.9, 2.475, 0.15), (3.45, 2.5125, 0.15), (3.45, 2.5125, 0.0)],
    [(2.8, 2.4, 0.0), (2.8, 2.4, 0.15), (3.2, 2.4, 0.15), (3.2, 2.4, 0.0)],
];

/// The teapot in Newell's units, 3.15 high, standing on the plane y = 0 with the spout towards +x;
/// every patch is split `n`×`n`. Body and lid, handle and spout follow each other in the mesh.
pub fn teapot(n: u32) -> Shape {
    let mut shape = Shape::default();
    add_body(&mut shape, n);
    add_tube(&mut shape, &HANDLE, n);
    add_tube(&mut shape, &SPOUT, n);
    shape
}

/// Bernstein's weights of a cubic and those of its derivative (over 3).
fn bernstein(t: f32) -> ([f32; 4], [f32; 3]) {
    let s = 1.0 - t;
    ([s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t], [s * s, 2.0 * s * t, t * t])
}

fn add_body(shape: &mut Shape, n: u32) {
    let around: Vec<(Vec2, Vec2)> = (0..4 * n).map(|i| arc(i, n)).collect();
    let segments = around.len() as u32;
    let mut last: Option<(Vec2, u32)> = None;
    let mut ring = |point: Vec2, tangent: Vec2| {
        let first = shape.positions.len() as u32;
        for &(p, d) in &around {
            shape.positions.push(Vec3::new(point.x * p.x, point.y, -point.x * p.y));
            // ∂P/∂profile × ∂P/∂arc; the radius cancels, so that the poles have normals too.
            let along = Vec3::new(tangent.x * p.x, tangent.y, -tangent.x * p.y);
            shape.normals.push(along.cross(Vec3::new(d.x, 0.0, -d.y)).normalize());
        }
        if let Some((above_point, above)) = last
            && above_point != point
        {
            for i in 0..segments {
                let j = (i + 1) % segments;
                if point.x > 0.0 {
                    shape.indices.push([above + i, first + i, first + j]);
                }
                if above_point.x > 0.0 {
                    shape.indices.push([above + i, first + j, above + j]);
                }
            }
        }
        last = Some((point, first));
    };
    for (index, curve) in PROFILE.iter().enumerate() {
        let points = curve.map(Vec2::from);
        if index == 2 {
            // The bridge from the lid's edge to the rim.
            let lid_edge = Vec2::from(PROFILE[1][3]);
            ring(lid_edge, Vec2::X);
            ring(points[0], Vec2::X);
        }
        // A curve that goes on smoothly shares its first ring with the one before.
        for i in u32::from(index != 0 && index != 2)..=n {
            let (b, d) = bernstein(i as f32 / n as f32);
            let point: Vec2 = (0..4).map(|k| points[k] * b[k]).sum();
            let tangent: Vec2 = (0..3).map(|k| (points[k + 1] - points[k]) * d[k]).sum();
            ring(point, tangent);
        }
    }
}

/// Point and derivative of the body's cross-section at step `i` of `4n`.
fn arc(i: u32, n: u32) -> (Vec2, Vec2) {
    let (b, d) = bernstein((i % n) as f32 / n as f32);
    let mut point: Vec2 = (0..4).map(|k| ARC[k] * b[k]).sum();
    let mut derivative: Vec2 = (0..3).map(|k| (ARC[k + 1] - ARC[k]) * d[k]).sum();
    for _ in 0..i / n {
        point = Vec2::new(-point.y, point.x);
        derivative = Vec2::new(-derivative.y, derivative.x);
    }
    (point, derivative)
}

fn add_tube(shape: &mut Shape, rows: &[Row; 7], n: u32) {
    let base = shape.positions.len() as u32;
    let sides = 2 * n;
    for step in 0..=2 * n {
        let patch = (step / n).min(1);
        let (b, d) = bernstein((step - patch * n) as f32 / n as f32);
        let rows = &rows[3 * patch as usize..][..4];
        let control = |r: usize, k: usize| {
            let (x, height, width) = rows[r][k];
            Vec3::new(x, height, width)
        };
        let points: [Vec3; 4] = std::array::from_fn(|k| (0..4).map(|r| control(r, k) * b[r]).sum());
        let slopes: [Vec3; 4] = std::array::from_fn(|k| {
            (0..3).map(|r| (control(r + 1, k) - control(r, k)) * d[r]).sum()
        });
        for side in 0..sides {
            // The far half is the near half's mirror image, run backwards.
            let mirrored = side > n;
            let across = if mirrored { sides - side } else { side };
            let (b, d) = bernstein(across as f32 / n as f32);
            let point: Vec3 = (0..4).map(|k| points[k] * b[k]).sum();
            let along: Vec3 = (0..4).map(|k| slopes[k] * b[k]).sum();
            let around: Vec3 = (0..3).map(|k| (points[k + 1] - points[k]) * d[k]).sum();
            let normal = around.cross(along).normalize();
            let flip = if mirrored { Vec3::new(1.0, 1.0, -1.0) } else { Vec3::ONE };
            shape.positions.push(point * flip);
            shape.normals.push(normal * flip);
        }
    }
    for ring in 0..2 * n {
        let here = base + ring * sides;
        for side in 0..sides {
            let next = (side + 1) % sides;
            let there = here + sides;
            shape.indices.push([here + side, here + next, there + next]);
            shape.indices.push([here + side, there + next, there + side]);
        }
    }
    add_cap(shape, base, sides, true);
    add_cap(shape, base + 2 * n * sides, sides, false);
}

/// Closes the ring of `sides` vertices from `ring` on by a fan around its middle, with flat normals.
fn add_cap(shape: &mut Shape, ring: u32, sides: u32, at_start: bool) {
    let corners: Vec<Vec3> = (ring..ring + sides).map(|i| shape.positions[i as usize]).collect();
    let middle = corners.iter().sum::<Vec3>() / sides as f32;
    let area: Vec3 = (0..corners.len())
        .map(|i| (corners[i] - middle).cross(corners[(i + 1) % corners.len()] - middle))
        .sum();
    let normal = area.normalize() * if at_start { -1.0 } else { 1.0 };
    let base = shape.positions.len() as u32;
    shape.positions.push(middle);
    shape.positions.extend(corners);
    shape.normals.extend(std::iter::repeat_n(normal, sides as usize + 1));
    for side in 0..sides {
        let (a, b) = (base + 1 + side, base + 1 + (side + 1) % sides);
        shape.indices.push(if at_start { [base, b, a] } else { [base, a, b] });
    }
}
