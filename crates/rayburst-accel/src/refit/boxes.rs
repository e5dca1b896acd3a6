//! Trees whose leaves are boxes, over instances or procedural primitives: all boxes anew, bottom-up.

use glam::Vec3;
use rayburst_math::Aabb;
use rayon::prelude::*;

use super::RefitReport;
use crate::layout::bvh8::{Bvh8, NODE_LINES, Node8, Reference};

/// Nodes that one task works on, at least.
const TASK: usize = 1 << 9;

/// Makes all boxes of a tree anew, given those of the values of its leaves, of which empty ones are never met.
pub(crate) fn refit(tree: &mut Bvh8, bounds_of: impl Fn(u32) -> Aabb + Sync) -> RefitReport {
    let (lines, above) = tree.lines_mut();
    let nodes: &mut [Node8] = bytemuck::cast_slice_mut(lines);
    // What is below nodes first: most of it, and independent.
    let mut changed: usize = nodes
        .par_iter_mut()
        .with_min_len(TASK)
        .map(|node| set_children(node, |child| child.is_leaf().then(|| bounds_of(child.value()))))
        .sum();
    // Nodes follow those above them; those of clusters, which have leaves only, come earlier.
    let first_above = above.map_or(1, |line| line / NODE_LINES);
    let order = (1..first_above).chain((first_above..nodes.len()).rev()).chain([0]);
    let mut boxes = vec![Aabb::EMPTY; nodes.len()];
    let mut area = 0.0;
    for number in order {
        let node = &mut nodes[number];
        changed += set_children(node, |child| {
            (!child.is_leaf()).then(|| boxes[child.value() as usize / (2 * NODE_LINES)])
        });
        let (all, below) = sum(node);
        boxes[number] = all;
        area += below;
    }
    let bounds = boxes[0];
    let root = f64::from(bounds.half_area());
    let cost = (area + root) / root.max(f64::MIN_POSITIVE);
    let sah_after = if bounds.is_empty() { 0.0 } else { cost as f32 };
    let boxes_changed = changed + usize::from(tree.bounds != bounds);
    tree.bounds = bounds;
    let sah_before = std::mem::replace(&mut tree.shape.sah_cost, sah_after);
    RefitReport { bounds, sah_before, sah_after, boxes_changed }
}

/// Sets the boxes of some children; returns how many are not what they were.
fn set_children(node: &mut Node8, bounds_of: impl Fn(Reference) -> Option<Aabb>) -> usize {
    let mut changed = 0;
    for slot in 0..8 {
        let child = node.children[slot];
        if child == Reference::NONE {
            continue;
        }
        let Some(Aabb { lower, upper }) = bounds_of(child) else { continue };
        let new = [lower.x, upper.x, lower.y, upper.y, lower.z, upper.z];
        let mut differs = false;
        for (row, new) in node.boxes.planes.iter_mut().zip(new) {
            differs |= row[slot] != new;
            row[slot] = new;
        }
        changed += usize::from(differs);
    }
    changed
}

/// The box around the children of a node, and half the areas of theirs.
fn sum(node: &Node8) -> (Aabb, f64) {
    let planes = &node.boxes.planes;
    let least = |row: usize| planes[row].iter().copied().fold(f32::INFINITY, f32::min);
    let greatest = |row: usize| planes[row].iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let all = Aabb {
        lower: Vec3::new(least(0), least(2), least(4)),
        upper: Vec3::new(greatest(1), greatest(3), greatest(5)),
    };
    let mut area = 0.0;
    for slot in 0..8 {
        // Empty boxes have negative edges.
        let edge = |axis: usize| (planes[2 * axis + 1][slot] - planes[2 * axis][slot]).max(0.0);
        let [x, y, z] = [edge(0), edge(1), edge(2)];
        area += f64::from(x * y + y * z + z * x);
    }
    (all, area)
}
