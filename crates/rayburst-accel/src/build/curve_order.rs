//! Primitives in the order of a space-filling curve, and binary subtrees that follow it.
//!
//! After Lauterbach, Garland, Sengupta, Luebke, Manocha, "Fast BVH construction on GPUs", 2009: a node
//! holds a part of the sorted order and divides where the highest differing bit of its codes changes.
//!
//! Changed: leaves hold several primitives; equal codes divide in the middle, so that the depth is at
//! most the bits of a code plus the logarithm of the number of primitives.

use std::sync::atomic::AtomicU64;

use rayon::prelude::*;

use super::{
    binned_sah::{Slots, TASK, extent_of},
    bounds::Bounds4,
    morton::{Grid, Keys},
    primitives::PrimitiveRef,
};
use crate::{Curve, layout::bvh2::Node2};

/// Primitives along a curve.
pub(super) struct Ordered {
    pub(super) keys: Keys,
    pub(super) refs: Vec<PrimitiveRef>,
}

impl Ordered {
    /// Sorts primitives by their centroids.
    pub(super) fn new(refs: &[PrimitiveRef], curve: Curve) -> Self {
        let centroids = extent_of(refs).centroids;
        let grid = Grid::new(centroids.lower, centroids.upper, curve);
        let keys = (0..refs.len())
            .into_par_iter()
            .with_min_len(TASK)
            .map(|i| AtomicU64::new(grid.key(refs[i].lower() + refs[i].upper(), i as u32)))
            .collect();
        let keys = Keys::sort(keys);
        let refs = (0..keys.len())
            .into_par_iter()
            .with_min_len(TASK)
            .map(|at| refs[keys.index(at) as usize])
            .collect();
        Self { keys, refs }
    }

    /// The primitives' indices.
    pub(super) fn order(&self) -> Vec<u32> {
        self.refs.par_iter().with_min_len(TASK).map(PrimitiveRef::index).collect()
    }
}

/// Makes binary nodes over parts of the order.
pub(super) struct Grower<'a> {
    pub(super) ordered: &'a Ordered,
    pub(super) leaf_size: usize,
}

impl Grower<'_> {
    /// Where a part divides.
    fn middle(&self, first: usize, end: usize) -> usize {
        self.ordered.keys.divide(first, end).unwrap_or(first + (end - first) / 2)
    }

    /// Makes a subtree; returns its root.
    pub(super) fn subtree(&self, first: usize, end: usize, slots: Slots<'_>) -> Node2 {
        let mut used = 0;
        let (root, bounds) = self.grow(first, end, slots.nodes, slots.base, &mut used);
        Node2 { bounds: bounds.aabb(), ..root }
    }

    fn grow(
        &self,
        first: usize,
        end: usize,
        nodes: &mut [Node2],
        base: u32,
        used: &mut usize,
    ) -> (Node2, Bounds4) {
        if end - first <= self.leaf_size {
            let bounds = self.bounds(first, end);
            return (Node2::leaf(bounds.aabb(), first as u32, end - first), bounds);
        }
        let middle = self.middle(first, end);
        let pair = *used;
        *used += 2;
        let (left, a) = self.grow(first, middle, nodes, base, used);
        let (right, b) = self.grow(middle, end, nodes, base, used);
        nodes[pair] = left;
        nodes[pair + 1] = right;
        let bounds = a.union(&b);
        (Node2::inner(bounds.aabb(), base + pair as u32), bounds)
    }

    /// The box of a part.
    fn bounds(&self, first: usize, end: usize) -> Bounds4 {
        let refs = &self.ordered.refs[first..end];
        refs.iter().fold(Bounds4::EMPTY, |sum, reference| sum.union(&Bounds4::of(reference)))
    }
}
