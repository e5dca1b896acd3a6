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

/// A plane between two primitives of a small node.
#[derive(Clone, Copy, Debug)]
pub(super) struct SmallSplit {
    order: Order,
    middle: usize,
    pub(super) axis: usize,
    pub(super) cost: f32,
}

/// The best split of a node of two to [`SMALL`] primitives, whose half area is given.
pub(super) fn find(refs: &[PrimitiveRef], area: f32, blocks: Blocks) -> SmallSplit {
    let count = refs.len();
    let orders = sort(refs);
    let overhead = blocks.overhead * area;
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
        best.offer(areas(&left) * block_count(place + 1) + right_costs[place], place);
    }
    // No cost is finite when areas overflow.
    let (cost, axis, place) = best.least().unwrap_or((f32::INFINITY, 0, count / 2 - 1));
    SmallSplit { order: orders[axis], middle: place + 1, axis, cost }
}

impl SmallSplit {
    /// Reorders the primitives so that the first ones go left; returns how many these are.
    pub(super) fn apply(&self, refs: &mut [PrimitiveRef]) -> usize {
        let mut sorted = [PrimitiveRef::NONE; SMALL];
        for (slot, &from) in sorted.iter_mut().zip(&self.order[..refs.len()]) {
            *slot = refs[usize::from(from)];
        }
        refs.copy_from_slice(&sorted[..refs.len()]);
        self.middle
    }

    /// The boxes of both sides.
    pub(super) fn sides(&self, refs: &[PrimitiveRef]) -> [Bounds4; 2] {
        let (left, right) = self.order[..refs.len()].split_at(self.middle);
        let union = |side: &[u8]| {
            let bounds = side.iter().map(|&i| Bounds4::of(&refs[usize::from(i)]));
            bounds.fold(Bounds4::EMPTY, |sum, b| sum.union(&b))
        };
        [union(left), union(right)]
    }
}

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
