//! Nodes of few primitives, split exactly: every plane between two centroids is tried.
//!
//! The full sweep of the surface area heuristic (Wald, Boulos, Shirley, "Ray tracing deformable
//! scenes using dynamic bounding volume hierarchies", 2007). Changed: so few keys are sorted by
//! counting for each how many come before it, which needs no branch, and the planes of all three
//! axes are judged at once.

use glam::Vec4;

use super::{
    bins::{Best, Blocks},
    bounds::{Bounds4, half_areas},
    primitives::PrimitiveRef,
};

/// Nodes of this many primitives are split exactly.
pub(super) const SMALL: usize = 8;

/// The order of a small node's primitives along an axis.
type Order = [u8; SMALL];

/// Puts the primitives of a node, at most [`SMALL`], in an order whose first ones go left; returns
/// how many these are. `halve` allows only the split in the middle.
pub(super) fn split(
    refs: &mut [PrimitiveRef],
    bounds: &Bounds4,
    blocks: Blocks,
    halve: bool,
) -> usize {
    let count = refs.len();
    let orders = sort(refs);
    // A block more takes memory: it must save this much of the node's area.
    let overhead = BLOCK_OVERHEAD * bounds.half_area();
    let areas = |boxes: &[Bounds4; 3]| half_areas(boxes) + overhead;
    let block_count = |count: usize| blocks.lanes(Vec4::splat(count as f32));
    let mut right_costs = [Vec4::ZERO; SMALL];
    let mut right = [Bounds4::EMPTY; 3];
    for place in (1..count).rev() {
        add(refs, &orders, place, &mut right);
        right_costs[place - 1] = areas(&right) * block_count(count - place);
    }
    let mut best = Best::NONE;
    let mut left = [Bounds4::EMPTY; 3];
    for place in 0..count - 1 {
        add(refs, &orders, place, &mut left);
        if !halve || place + 1 == count / 2 {
            best.offer(areas(&left) * block_count(place + 1) + right_costs[place], place);
        }
    }
    // No cost is finite when areas overflow.
    let (_, axis, place) = best.least().unwrap_or((0.0, 0, count / 2 - 1));
    let mut sorted = [PrimitiveRef::NONE; SMALL];
    for (slot, &from) in sorted[..count].iter_mut().zip(&orders[axis]) {
        *slot = refs[usize::from(from)];
    }
    refs.copy_from_slice(&sorted[..count]);
    place + 1
}

/// What a block costs beyond its area, as a part of its parent's.
const BLOCK_OVERHEAD: f32 = 0.1;

#[inline(always)]
fn add(refs: &[PrimitiveRef], orders: &[Order; 3], place: usize, sum: &mut [Bounds4; 3]) {
    for axis in 0..3 {
        let reference = &refs[usize::from(orders[axis][place])];
        sum[axis].grow(reference.lower(), reference.upper());
    }
}

/// The orders by centroid along the three axes.
fn sort(refs: &[PrimitiveRef]) -> [Order; 3] {
    let mut keys = [[f32::INFINITY; SMALL]; 3];
    for (i, reference) in refs.iter().enumerate() {
        let centroid = reference.lower() + reference.upper();
        for axis in 0..3 {
            keys[axis][i] = centroid[axis];
        }
    }
    let mut orders = [[0; SMALL]; 3];
    for (keys, order) in keys.iter().zip(&mut orders) {
        let mut ranks = [0i32; SMALL];
        for (j, &key) in keys[..refs.len()].iter().enumerate() {
            for i in 0..SMALL {
                let before = (key < keys[i]) | ((key == keys[i]) & ((j as i32) < i as i32));
                ranks[i] += i32::from(before);
            }
        }
        for (i, &rank) in ranks[..refs.len()].iter().enumerate() {
            order[rank as usize % SMALL] = i as u8;
        }
    }
    orders
}
