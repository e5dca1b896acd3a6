//! Tubes around polylines: strands of hair, handles, rails.
//!
//! The cross-section is carried along the line without twist by two reflections a step (Wang,
//! Jüttler, Zheng, Liu: "Computation of Rotation Minimizing Frames", ACM TOG 2008, table I).

use glam::Vec3;
use rayburst_math::Frame;

use super::{Shape, trig};

/// Adds a closed tube of `sides` sides around a polyline of at least two distinct points, with a
/// pointed cap at both ends: `2·sides·points` triangles.
pub fn tube(shape: &mut Shape, line: &[Vec3], radius: impl Fn(usize) -> f32, sides: u32) {
    let tangent = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(line.len() - 1));
        (line[b] - line[a]).normalize_or(Vec3::Y)
    };
    let add = |shape: &mut Shape, position: Vec3, normal: Vec3| {
        shape.positions.push(position);
        shape.normals.push(normal);
        shape.positions.len() as u32 - 1
    };
    let last = line.len() - 1;
    let start = add(shape, line[0] - tangent(0) * radius(0), -tangent(0));
    let first_ring = start + 1;
    let mut along = tangent(0);
    let mut across = Frame::from_normal(along).tangent;
    for (i, &point) in line.iter().enumerate() {
        if i > 0 {
            (along, across) = transport(point - line[i - 1], along, tangent(i), across);
        }
        let beside = along.cross(across);
        for side in 0..sides {
            let (sin, cos) = trig::turn(side, sides);
            let normal = (across * cos + beside * sin).normalize();
            add(shape, point + normal * radius(i), normal);
        }
    }
    let end = add(shape, line[last] + along * radius(last), along);
    for side in 0..sides {
        let next = (side + 1) % sides;
        shape.indices.push([start, first_ring + next, first_ring + side]);
        for ring in 0..last as u32 {
            let here = first_ring + ring * sides;
            let there = here + sides;
            shape.indices.push([here + side, here + next, there + next]);
            shape.indices.push([here + side, there + next, there + side]);
        }
        let final_ring = first_ring + last as u32 * sides;
        shape.indices.push([final_ring + side, final_ring + next, end]);
    }
}

/// The frame one step on: reflect in the plane that bisects the step, then in the one that bisects
/// the tangents.
fn transport(step: Vec3, along: Vec3, next_along: Vec3, across: Vec3) -> (Vec3, Vec3) {
    let reflect = |v: Vec3, normal: Vec3| {
        let square = normal.length_squared();
        if square > 0.0 { v - normal * (2.0 / square * normal.dot(v)) } else { v }
    };
    let half_along = reflect(along, step);
    let half_across = reflect(across, step);
    let next_across = reflect(half_across, next_along - half_along);
    (next_along, (next_across - next_along * next_across.dot(next_along)).normalize_or(across))
}
