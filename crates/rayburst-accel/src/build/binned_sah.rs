//! Top-down build of a binary tree by the binned surface area heuristic, in parallel.
//!
//! After Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007: the centroids
//! of a node's primitives fall into equal bins on each axis, and the plane between bins of least cost
//! `Σ area · blocks` splits the node ([`super::bins`]); nodes of few primitives are split exactly
//! ([`super::small`]).
//!
//! Changed: nodes whose subtree might grow deeper than is allowed ([`MAX_DEPTH`] at most), and nodes whose centroids all
//! coincide, are split at the median, so that depth is bounded for every input. Bins are merged with
//! minima, maxima and integer sums only, and primitives move between fixed chunks, so the tree does
//! not depend on the number of threads.
//!
//! Memory beyond the primitives: room for `2n − 1` nodes of 32 bytes, the most that there can be, of
//! which about `0.7 n` are touched. A subtree of `n` primitives owns `2n − 2` of them beside its root,
//! so that tasks need no lock and no copy.

use rayon::prelude::*;

use super::{
    bins::Blocks, bounds::Extent, monitor::Monitor, object::Kit, partition::CHUNK,
    primitives::PrimitiveRef,
};
use crate::{
    BuildError,
    layout::bvh2::{Bvh2, Node2},
};

/// No leaf is further from the root than this.
pub(crate) const MAX_DEPTH: usize = 64;

/// What a leaf costs beyond its area, see [`Blocks::overhead`].
const BLOCK_OVERHEAD: f32 = 0.6;
/// Subtrees of fewer primitives are built by one task.
pub(super) const TASK: usize = 4096;

/// Options of the builder.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinnedSah<'a> {
    /// Bins an axis, at most 32.
    pub(crate) bins: usize,
    /// Primitives in a leaf, at most; a power of two.
    pub(crate) leaf_size: usize,
    /// No leaf is further from the root than this: at least the depth of a tree of medians.
    pub(crate) max_depth: usize,
    /// Whom progress is told.
    pub(crate) monitor: Monitor<'a>,
}

/// Room for the nodes below one.
pub(super) struct Slots<'a> {
    pub(super) nodes: &'a mut [Node2],
    /// The index of the first of them in the tree.
    pub(super) base: u32,
}

impl<'a> Slots<'a> {
    /// Room for a pair of children, and for the nodes below each.
    pub(super) fn divide(self, left: usize) -> (&'a mut [Node2], [Self; 2]) {
        let (pair, rest) = self.nodes.split_at_mut(2);
        let (first, second) = rest.split_at_mut(left);
        let base = self.base + 2;
        let second = Slots { nodes: second, base: base + left as u32 };
        (pair, [Slots { nodes: first, base }, second])
    }
}

/// How many nodes there can be below one of some primitives.
pub(super) fn nodes_below(primitives: usize) -> usize {
    2 * primitives - 2
}

/// How deep a tree of medians is.
pub(super) fn levels(primitives: usize, leaf_size: usize) -> usize {
    primitives.div_ceil(leaf_size).next_power_of_two().ilog2() as usize
}

/// The subtree that one task builds.
struct Task<'a> {
    slots: Slots<'a>,
    used: usize,
    kit: Kit,
}

impl BinnedSah<'_> {
    /// Builds the tree over some primitives.
    pub(crate) fn build(&self, mut refs: Vec<PrimitiveRef>) -> Result<Bvh2, BuildError> {
        if refs.is_empty() {
            return Ok(Bvh2::default());
        }
        let mut nodes = Node2::allocate(1 + nodes_below(refs.len()))?;
        if let Some((root, below)) = nodes.split_first_mut() {
            let slots = Slots { nodes: below, base: 1 };
            let extent = extent_of(&refs);
            *root = self.grow_tree(&mut refs, 0, &extent, 0, slots);
        }
        let order = refs.par_iter().with_min_len(TASK).map(PrimitiveRef::index).collect();
        Ok(Bvh2 { nodes, order })
    }

    /// Splits large nodes, in parallel, down to tasks; returns the root.
    fn grow_tree(
        &self,
        refs: &mut [PrimitiveRef],
        first: u32,
        extent: &Extent,
        depth: usize,
        slots: Slots<'_>,
    ) -> Node2 {
        if self.monitor.is_cancelled() {
            return Node2::leaf(extent.bounds.aabb(), first, refs.len());
        }
        if refs.len() < TASK {
            self.monitor.advance(refs.len());
            let mut task = Task { slots, used: 0, kit: Kit::EMPTY };
            return self.grow(refs, first, extent, depth, &mut task);
        }
        let middle = self.divide(refs, extent, depth, &mut Box::new(Kit::EMPTY));
        let (left_refs, right_refs) = refs.split_at_mut(middle);
        let (pair, [left, right]) = slots.divide(nodes_below(middle));
        let child = left.base - 2;
        let second = first + middle as u32;
        let grow = |refs: &mut [PrimitiveRef], first, slots| {
            let extent = extent_of(refs);
            self.grow_tree(refs, first, &extent, depth + 1, slots)
        };
        (pair[0], pair[1]) =
            rayon::join(|| grow(left_refs, first, left), || grow(right_refs, second, right));
        Node2::inner(extent.bounds.aabb(), child)
    }

    /// Makes a subtree; returns its root.
    fn grow(
        &self,
        refs: &mut [PrimitiveRef],
        first: u32,
        extent: &Extent,
        depth: usize,
        task: &mut Task<'_>,
    ) -> Node2 {
        let bounds = extent.bounds.aabb();
        if refs.len() <= self.leaf_size {
            return Node2::leaf(bounds, first, refs.len());
        }
        let middle = self.divide(refs, extent, depth, &mut task.kit);
        let pair = task.used;
        task.used += 2;
        let (left, right) = refs.split_at_mut(middle);
        for (side, refs, first) in [(0, left, first), (1, right, first + middle as u32)] {
            let extent = Extent::of(refs);
            task.slots.nodes[pair + side] = self.grow(refs, first, &extent, depth + 1, task);
        }
        Node2::inner(bounds, task.slots.base + pair as u32)
    }

    /// Reorders a node's primitives so that those of its first child come first; returns how many
    /// these are.
    fn divide(
        &self,
        refs: &mut [PrimitiveRef],
        extent: &Extent,
        depth: usize,
        kit: &mut Kit,
    ) -> usize {
        // An uneven split must leave room for medians all the way down.
        if depth + levels(refs.len(), self.leaf_size) < self.max_depth {
            let blocks = Blocks::new(self.leaf_size, BLOCK_OVERHEAD);
            if let Some(split) = kit.find(refs, extent, self.bins, blocks) {
                return split.apply(refs);
            }
        }
        halve(refs, extent)
    }
}

/// The extent of primitives, in parallel if they are many.
pub(super) fn extent_of(refs: &[PrimitiveRef]) -> Extent {
    refs.par_chunks(CHUNK).map(Extent::of).reduce(|| Extent::EMPTY, Extent::merge)
}

/// Reorders primitives by the widest axis of their centroids; returns half their number.
pub(super) fn halve(refs: &mut [PrimitiveRef], extent: &Extent) -> usize {
    let centroids = extent.centroids.upper - extent.centroids.lower;
    let axis = centroids.truncate().max_position();
    let middle = refs.len() / 2;
    let key = |reference: &PrimitiveRef| {
        let [from, to] = reference.interval(axis);
        from + to
    };
    refs.select_nth_unstable_by(middle, |a, b| {
        key(a).total_cmp(&key(b)).then(a.index().cmp(&b.index()))
    });
    middle
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use rayburst_math::{Aabb, hash::Rng};

    use super::*;

    #[test]
    fn memory_is_what_was_said_before() {
        let mut rng = Rng::new(1);
        for (count, leaf_size) in [(1, 4), (5, 4), (1000, 1), (1000, 4), (20_000, 4)] {
            let refs: Vec<_> = (0..count)
                .map(|i| {
                    PrimitiveRef::new(&Aabb::of_point(rng.vec3() * Vec3::new(9.0, 1.0, 1.0)), i)
                })
                .collect();
            let builder = BinnedSah {
                bins: 32,
                leaf_size,
                max_depth: MAX_DEPTH,
                monitor: Monitor::default(),
            };
            let tree = builder.build(refs).unwrap();
            assert_eq!(tree.nodes.capacity(), 2 * count as usize - 1);
            assert_eq!(tree.order.len(), count as usize);
            let (mut stack, mut reached, mut held) = (vec![0], 0, 0);
            while let Some(node) = stack.pop() {
                let node = &tree.nodes[node as usize];
                reached += 1;
                held += node.count;
                assert!(node.count as usize <= leaf_size);
                if !node.is_leaf() {
                    stack.extend([node.first, node.first + 1]);
                }
            }
            assert!(held == count && reached <= tree.nodes.len(), "{reached} nodes of {count}");
            // Leaves of one primitive need every node.
            assert!(leaf_size > 1 || reached == tree.nodes.len());
        }
    }
}
