//! Top-down build of a binary tree by the binned surface area heuristic, in parallel.
//!
//! After Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007: the centroids
//! of a node's primitives fall into equal bins on each axis; of all planes between bins the one of
//! least cost `Σ area · blocks` splits the node, where leaves are counted in blocks of as many
//! primitives as one leaf holds (Wald, Benthin, Boulos, "Getting rid of packets", 2008).
//!
//! Changed: nodes whose subtree might grow deeper than [`MAX_DEPTH`], and nodes whose centroids all
//! coincide, are split at the median, so that depth is bounded for every input. Bins are merged with
//! minima, maxima and integer sums only, so the tree does not depend on the number of threads.
//!
//! Memory beyond the primitives: at most `2n − 1` nodes of 32 bytes, about `0.8 n` in practice.

use glam::Vec4;
use rayburst_math::Aabb;
use rayon::prelude::*;

use super::primitives::PrimitiveRef;
use crate::layout::bvh2::{Bvh2, Node2};

/// No leaf is further from the root than this.
pub(crate) const MAX_DEPTH: usize = 64;

/// Subtrees of fewer primitives are built by one task.
const TASK: usize = 4096;
/// Nodes of more primitives are binned by several tasks, this many primitives each.
const BINNING_TASK: usize = 1 << 16;
const MAX_BINS: usize = 32;

/// Options of the builder.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinnedSah {
    /// Bins an axis, at most 32.
    pub(crate) bins: usize,
    /// Primitives in a leaf, at most.
    pub(crate) leaf_size: usize,
}

/// What is known of a node before it is split.
#[derive(Clone, Copy)]
struct Extent {
    bounds: Bounds4,
    /// The box around the centroids, times two.
    centroids: Bounds4,
}

/// A box in four lanes, of which the last is meaningless.
#[derive(Clone, Copy)]
struct Bounds4 {
    lower: Vec4,
    upper: Vec4,
}

impl Bounds4 {
    const EMPTY: Self =
        Self { lower: Vec4::splat(f32::INFINITY), upper: Vec4::splat(f32::NEG_INFINITY) };

    #[inline(always)]
    fn grow(&mut self, lower: Vec4, upper: Vec4) {
        self.lower = self.lower.min(lower);
        self.upper = self.upper.max(upper);
    }

    #[inline(always)]
    fn merge(&mut self, other: &Self) {
        self.grow(other.lower, other.upper);
    }

    #[inline(always)]
    fn half_area(&self) -> f32 {
        let e = self.upper - self.lower;
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    fn aabb(&self) -> Aabb {
        Aabb { lower: self.lower.truncate(), upper: self.upper.truncate() }
    }
}

impl Extent {
    const EMPTY: Self = Self { bounds: Bounds4::EMPTY, centroids: Bounds4::EMPTY };

    fn of(refs: &[PrimitiveRef]) -> Self {
        refs.iter().fold(Self::EMPTY, |mut extent, reference| {
            extent.bounds.grow(reference.lower(), reference.upper());
            let centroid = reference.lower() + reference.upper();
            extent.centroids.grow(centroid, centroid);
            extent
        })
    }

    fn merge(mut self, other: Self) -> Self {
        self.bounds.merge(&other.bounds);
        self.centroids.merge(&other.centroids);
        self
    }
}

/// Maps centroids to bins; the outermost bins are half as wide as the others.
#[derive(Clone, Copy)]
struct Binning {
    lower: Vec4,
    scale: Vec4,
}

impl Binning {
    fn new(centroids: &Bounds4, bins: usize) -> Self {
        let extent = centroids.upper - centroids.lower;
        let axis = |e: f32| {
            let scale = (bins - 1) as f32 / e;
            if scale.is_finite() { scale } else { 0.0 }
        };
        let scale = Vec4::new(axis(extent.x), axis(extent.y), axis(extent.z), 0.0);
        Self { lower: centroids.lower, scale }
    }

    /// The bin of a primitive on each axis.
    #[inline(always)]
    fn bins(&self, reference: &PrimitiveRef) -> [usize; 3] {
        // Adding 1.5 · 2²³ leaves a small number, rounded, in the low bits of the mantissa.
        const ROUND: Vec4 = Vec4::splat((3 << 22) as f32);
        let position = (reference.lower() + reference.upper() - self.lower) * self.scale + ROUND;
        let bin = |x: f32| x.to_bits() as usize % MAX_BINS;
        [bin(position.x), bin(position.y), bin(position.z)]
    }
}

/// A node's primitives in bins.
struct Bins {
    bounds: [[Bounds4; MAX_BINS]; 3],
    counts: [[u32; MAX_BINS]; 3],
}

impl Bins {
    const EMPTY: Self =
        Self { bounds: [[Bounds4::EMPTY; MAX_BINS]; 3], counts: [[0; MAX_BINS]; 3] };

    fn clear(&mut self, bins: usize) {
        for axis in 0..3 {
            self.bounds[axis][..bins].fill(Bounds4::EMPTY);
            self.counts[axis][..bins].fill(0);
        }
    }

    fn fill(&mut self, refs: &[PrimitiveRef], binning: &Binning) {
        for reference in refs {
            let bins = binning.bins(reference);
            for axis in 0..3 {
                self.bounds[axis][bins[axis]].grow(reference.lower(), reference.upper());
                self.counts[axis][bins[axis]] += 1;
            }
        }
    }

    fn merge(mut self: Box<Self>, other: Box<Self>) -> Box<Self> {
        for axis in 0..3 {
            for bin in 0..MAX_BINS {
                self.bounds[axis][bin].merge(&other.bounds[axis][bin]);
                self.counts[axis][bin] += other.counts[axis][bin];
            }
        }
        self
    }
}

/// A plane between bins: those up to `bin` go left.
struct Split {
    axis: usize,
    bin: usize,
}

/// A tree whose lower parts were built by tasks of their own.
enum Tree {
    Inner(Aabb, Box<(Tree, Tree)>),
    Task(Vec<Node2>),
}

impl BinnedSah {
    /// Builds the tree over some primitives, which it reorders.
    pub(crate) fn build(&self, mut refs: Vec<PrimitiveRef>) -> Bvh2 {
        if refs.is_empty() {
            return Bvh2::default();
        }
        let extent =
            refs.par_chunks(BINNING_TASK).map(Extent::of).reduce(|| Extent::EMPTY, Extent::merge);
        let tree = self.grow_tree(&mut refs, 0, extent, 0);
        let order = refs.par_iter().map(PrimitiveRef::index).collect();
        drop(refs);
        let mut nodes = Vec::with_capacity(tree.node_count());
        nodes.push(Node2 { bounds: Aabb::EMPTY, first: 0, count: 0 });
        tree.flatten(0, &mut nodes);
        Bvh2 { nodes, order }
    }

    /// Splits large nodes, in parallel, down to tasks.
    fn grow_tree(
        &self,
        refs: &mut [PrimitiveRef],
        first: u32,
        extent: Extent,
        depth: usize,
    ) -> Tree {
        let mut bins = Box::new(Bins::EMPTY);
        if refs.len() < TASK {
            let mut nodes = Vec::with_capacity(refs.len());
            nodes.push(Node2 { bounds: extent.bounds.aabb(), first: 0, count: 0 });
            self.grow(refs, first, &extent, depth, 0, &mut nodes, &mut bins);
            nodes.shrink_to_fit();
            return Tree::Task(nodes);
        }
        let (middle, left, right) = self.divide(refs, &extent, depth, &mut bins);
        drop(bins);
        let (left_refs, right_refs) = refs.split_at_mut(middle);
        let children = rayon::join(
            || self.grow_tree(left_refs, first, left, depth + 1),
            || self.grow_tree(right_refs, first + middle as u32, right, depth + 1),
        );
        Tree::Inner(extent.bounds.aabb(), Box::new(children))
    }

    /// Makes `nodes[node]`, whose box is set, and all below it.
    fn grow(
        &self,
        refs: &mut [PrimitiveRef],
        first: u32,
        extent: &Extent,
        depth: usize,
        node: usize,
        nodes: &mut Vec<Node2>,
        bins: &mut Bins,
    ) {
        if refs.len() <= self.leaf_size {
            nodes[node].first = first;
            nodes[node].count = refs.len() as u32;
            return;
        }
        let (middle, left, right) = self.divide(refs, extent, depth, bins);
        let child = nodes.len();
        nodes[node].first = child as u32;
        for side in [&left, &right] {
            nodes.push(Node2 { bounds: side.bounds.aabb(), first: 0, count: 0 });
        }
        let (left_refs, right_refs) = refs.split_at_mut(middle);
        self.grow(left_refs, first, &left, depth + 1, child, nodes, bins);
        self.grow(right_refs, first + middle as u32, &right, depth + 1, child + 1, nodes, bins);
    }

    /// Reorders a node's primitives so that those of its first child come first; returns how many
    /// these are, and the extents of both children.
    fn divide(
        &self,
        refs: &mut [PrimitiveRef],
        extent: &Extent,
        depth: usize,
        bins: &mut Bins,
    ) -> (usize, Extent, Extent) {
        let levels = refs.len().div_ceil(self.leaf_size).next_power_of_two().ilog2() as usize;
        if depth + levels < MAX_DEPTH {
            let bin_count = (4 + refs.len() / 4).min(self.bins);
            let binning = Binning::new(&extent.centroids, bin_count);
            self.bin(refs, &binning, bin_count, bins);
            if let Some(split) = self.cheapest_split(bins, bin_count) {
                return partition(refs, |reference| {
                    binning.bins(reference)[split.axis] <= split.bin
                });
            }
        }
        let centroids = extent.centroids.upper - extent.centroids.lower;
        let axis = centroids.truncate().max_position();
        let middle = refs.len() / 2;
        let key = |reference: &PrimitiveRef| reference.lower()[axis] + reference.upper()[axis];
        refs.select_nth_unstable_by(middle, |a, b| {
            key(a).total_cmp(&key(b)).then(a.index().cmp(&b.index()))
        });
        let (left, right) = refs.split_at(middle);
        (middle, Extent::of(left), Extent::of(right))
    }

    fn bin(&self, refs: &[PrimitiveRef], binning: &Binning, bin_count: usize, bins: &mut Bins) {
        if refs.len() <= BINNING_TASK {
            bins.clear(bin_count);
            bins.fill(refs, binning);
        } else {
            let filled = refs
                .par_chunks(BINNING_TASK)
                .map(|chunk| {
                    let mut bins = Box::new(Bins::EMPTY);
                    bins.fill(chunk, binning);
                    bins
                })
                .reduce_with(Bins::merge);
            if let Some(filled) = filled {
                *bins = *filled;
            }
        }
    }

    /// The plane of least cost, if any plane has primitives on both sides.
    fn cheapest_split(&self, bins: &Bins, bin_count: usize) -> Option<Split> {
        let cost = |bounds: &Bounds4, count: u32| {
            bounds.half_area() * (count as usize).div_ceil(self.leaf_size) as f32
        };
        let mut best = (f32::INFINITY, None);
        for axis in 0..3 {
            let (bounds, counts) = (&bins.bounds[axis], &bins.counts[axis]);
            let mut right_costs = [f32::INFINITY; MAX_BINS];
            let (mut right, mut count) = (Bounds4::EMPTY, 0);
            for bin in (1..bin_count).rev() {
                right.merge(&bounds[bin]);
                count += counts[bin];
                if count != 0 {
                    right_costs[bin - 1] = cost(&right, count);
                }
            }
            let (mut left, mut count) = (Bounds4::EMPTY, 0);
            for bin in 0..bin_count - 1 {
                left.merge(&bounds[bin]);
                count += counts[bin];
                if count != 0 {
                    let total = cost(&left, count) + right_costs[bin];
                    if total < best.0 {
                        best = (total, Some(Split { axis, bin }));
                    }
                }
            }
        }
        best.1
    }
}

/// Moves the primitives that go left to the front; returns their number and both sides' extents.
fn partition(
    refs: &mut [PrimitiveRef],
    goes_left: impl Fn(&PrimitiveRef) -> bool,
) -> (usize, Extent, Extent) {
    let (mut left, mut right) = (Extent::EMPTY, Extent::EMPTY);
    let add = |side: &mut Extent, reference: &PrimitiveRef| {
        side.bounds.grow(reference.lower(), reference.upper());
        let centroid = reference.lower() + reference.upper();
        side.centroids.grow(centroid, centroid);
    };
    let (mut begin, mut end) = (0, refs.len());
    loop {
        while begin < end && goes_left(&refs[begin]) {
            add(&mut left, &refs[begin]);
            begin += 1;
        }
        while begin < end && !goes_left(&refs[end - 1]) {
            end -= 1;
            add(&mut right, &refs[end]);
        }
        if begin >= end {
            return (begin, left, right);
        }
        refs.swap(begin, end - 1);
    }
}

impl Tree {
    fn node_count(&self) -> usize {
        match self {
            Self::Inner(_, children) => 1 + children.0.node_count() + children.1.node_count(),
            Self::Task(nodes) => nodes.len(),
        }
    }

    /// Writes the tree's root to `nodes[slot]` and appends the rest.
    fn flatten(self, slot: usize, nodes: &mut Vec<Node2>) {
        match self {
            Self::Inner(bounds, children) => {
                let first = nodes.len();
                let child = Node2 { bounds: Aabb::EMPTY, first: 0, count: 0 };
                nodes[slot] = Node2 { bounds, first: first as u32, count: 0 };
                nodes.extend([child, child]);
                children.0.flatten(first, nodes);
                children.1.flatten(first + 1, nodes);
            }
            Self::Task(task) => {
                // The task's node `i > 0` becomes `shift + i`.
                let shift = nodes.len() as u32 - 1;
                let mut moved = task.into_iter().map(|node| Node2 {
                    first: if node.is_leaf() { node.first } else { node.first + shift },
                    ..node
                });
                if let Some(root) = moved.next() {
                    nodes[slot] = root;
                }
                nodes.extend(moved);
            }
        }
    }
}
