//! Top-down build of a binary tree with object and spatial splits, in parallel.
//!
//! After Stich, Friedrich, Dietrich, "Spatial splits in bounding volume hierarchies", HPG 2009: where
//! the children of the best object split overlap by more than a small part of the root's area, planes
//! that split the primitives themselves are tried too ([`super::spatial`]), and the cheaper split is
//! taken. A primitive may then be in several leaves.
//!
//! Changed: spatial splits are not tried where they hardly gain: where the overlap is narrow, and in
//! nodes of few references unless these are large. The number of references is bounded by a budget;
//! the room that is left for new ones is divided between the children in proportion to their
//! references, so the tree does not depend on the number of threads. Object splits are those of
//! [`super::binned_sah`], whose bound on the depth holds here too: no child has more references than
//! its parent.
//!
//! Memory: the budget's references, and for each room for two nodes, of which few are touched.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::{
    binned_sah::{MAX_DEPTH, Slots, TASK, extent_of, halve, levels, nodes_below},
    bins::Blocks,
    bounds::{Bounds4, Extent},
    monitor::Monitor,
    object::{Kit, ObjectSplit},
    partition::CHUNK,
    primitives::PrimitiveRef,
    spatial::{Grid, SPATIAL_BINS, Shapes, SpatialBins, SpatialSplit},
};
use crate::{
    BuildError,
    layout::bvh2::{Bvh2, Node2},
};

/// Children that overlap by less than this part of the root's area are not worth a spatial split.
const LEAST_OVERLAP: f32 = 1e-4;
/// The same in nodes of few references, where a spatial split takes much time and gains little.
const LEAST_OVERLAP_OF_FEW: f32 = 1e-3;
/// Nodes of fewer references have few.
const FEW: usize = 128;
/// Nor are children that overlap, along the axis of the split, by less than this part of their parent.
const LEAST_WIDTH: f32 = 0.1;
/// The cost of a spatial split that is taken, at most, in units of the object split's. New references
/// cost more further down than the heuristic knows.
const MOST_COST: f32 = 0.95;

/// Options of the builder.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sbvh<'a, S> {
    /// Bins an axis for object splits, at most 32.
    pub(crate) bins: usize,
    /// Primitives in a leaf, at most; a power of two.
    pub(crate) leaf_size: usize,
    /// References for each primitive, at most.
    pub(crate) budget: f32,
    /// The primitives themselves.
    pub(crate) shapes: &'a S,
    /// Whom progress is told.
    pub(crate) monitor: Monitor<'a>,
}

/// What a build keeps.
struct Build<'a, S> {
    options: &'a Sbvh<'a, S>,
    blocks: Blocks,
    root_area: f32,
    duplicates: AtomicUsize,
}

/// References of a node, and room for more behind them.
struct Refs<'a> {
    slots: &'a mut [PrimitiveRef],
    count: usize,
    /// Where they are among all.
    first: u32,
}

impl Refs<'_> {
    fn used(&self) -> &[PrimitiveRef] {
        &self.slots[..self.count]
    }
}

/// What the splits of one task need.
struct Scratch {
    kit: Kit,
    spatial: SpatialBins,
}

impl Scratch {
    const EMPTY: Self = Self { kit: Kit::EMPTY, spatial: SpatialBins::EMPTY };
}

/// The subtree that one task builds.
struct Task<'a> {
    slots: Slots<'a>,
    used: usize,
    scratch: Scratch,
}

impl<S: Shapes> Sbvh<'_, S> {
    /// Builds the tree over some primitives; returns how many references it holds, too.
    pub(crate) fn build(&self, mut refs: Vec<PrimitiveRef>) -> Result<(Bvh2, usize), BuildError> {
        let count = refs.len();
        if count == 0 {
            return Ok((Bvh2::default(), 0));
        }
        let extra = (count as f64 * f64::from((self.budget - 1.0).max(0.0))) as usize;
        let limit = super::primitives::MAX_PRIMITIVES - count;
        let capacity = count + extra.min(limit);
        refs.try_reserve_exact(capacity - count).map_err(|_| BuildError::OutOfMemory {
            what: "the builder's references",
            bytes: capacity.saturating_mul(size_of::<PrimitiveRef>()),
        })?;
        refs.resize(capacity, PrimitiveRef::NONE);
        let extent = extent_of(&refs[..count]);
        let build = Build {
            options: self,
            blocks: Blocks::new(self.leaf_size, 0.0),
            root_area: extent.bounds.half_area(),
            duplicates: AtomicUsize::new(0),
        };
        let mut nodes = Node2::allocate(1 + nodes_below(capacity))?;
        if let Some((root, below)) = nodes.split_first_mut() {
            let slots = Slots { nodes: below, base: 1 };
            *root = build.grow_tree(Refs { slots: &mut refs, count, first: 0 }, &extent, 0, slots);
        }
        let order = refs.par_iter().with_min_len(TASK).map(PrimitiveRef::index_or_any).collect();
        Ok((Bvh2 { nodes, order }, count + build.duplicates.into_inner()))
    }
}

impl<S: Shapes> Build<'_, S> {
    /// Splits large nodes, in parallel, down to tasks; returns the root.
    fn grow_tree(&self, refs: Refs<'_>, extent: &Extent, depth: usize, slots: Slots<'_>) -> Node2 {
        let monitor = &self.options.monitor;
        if monitor.is_cancelled() {
            return Node2::leaf(extent.bounds.aabb(), refs.first, refs.count);
        }
        if refs.count < TASK {
            monitor.advance(refs.count);
            let mut task = Task { slots, used: 0, scratch: Scratch::EMPTY };
            return self.grow(refs, extent, depth, &mut task);
        }
        let (left, right) = self.divide(refs, extent, depth, &mut Box::new(Scratch::EMPTY));
        let (pair, [left_slots, right_slots]) = slots.divide(nodes_below(left.slots.len()));
        let child = left_slots.base - 2;
        let grow = |refs: Refs<'_>, slots| {
            let extent = extent_of(refs.used());
            self.grow_tree(refs, &extent, depth + 1, slots)
        };
        (pair[0], pair[1]) = rayon::join(|| grow(left, left_slots), || grow(right, right_slots));
        Node2::inner(extent.bounds.aabb(), child)
    }

    /// Makes a subtree; returns its root.
    fn grow(&self, refs: Refs<'_>, extent: &Extent, depth: usize, task: &mut Task<'_>) -> Node2 {
        let bounds = extent.bounds.aabb();
        if refs.count <= self.options.leaf_size {
            return Node2::leaf(bounds, refs.first, refs.count);
        }
        let (left, right) = self.divide(refs, extent, depth, &mut task.scratch);
        let pair = task.used;
        task.used += 2;
        for (side, refs) in [left, right].into_iter().enumerate() {
            let extent = Extent::of(refs.used());
            task.slots.nodes[pair + side] = self.grow(refs, &extent, depth + 1, task);
        }
        Node2::inner(bounds, task.slots.base + pair as u32)
    }

    /// Divides a node's references, and the room behind them, between two children.
    fn divide<'r>(
        &self,
        refs: Refs<'r>,
        extent: &Extent,
        depth: usize,
        scratch: &mut Scratch,
    ) -> (Refs<'r>, Refs<'r>) {
        let Refs { slots, count, first } = refs;
        let (middle, end) = self.partition(slots, count, extent, depth, scratch);
        // The room left, in proportion.
        let room = slots.len() - end;
        let left_room = (room as u64 * middle as u64 / end as u64) as usize;
        let second = middle + left_room;
        if left_room != 0 {
            slots.copy_within(middle..end, second);
        }
        let (left, right) = slots.split_at_mut(second);
        (
            Refs { slots: left, count: middle, first },
            Refs { slots: right, count: end - middle, first: first + second as u32 },
        )
    }

    /// Reorders references by the cheapest split; returns how many go left, and how many there are.
    fn partition(
        &self,
        slots: &mut [PrimitiveRef],
        count: usize,
        extent: &Extent,
        depth: usize,
        scratch: &mut Scratch,
    ) -> (usize, usize) {
        let (refs, options) = (&slots[..count], self.options);
        if depth + levels(count, options.leaf_size) >= MAX_DEPTH {
            return (halve(&mut slots[..count], extent), count);
        }
        let object = scratch.kit.find(refs, extent, options.bins, self.blocks);
        if count < slots.len() && self.overlaps(object.as_ref(), &scratch.kit, refs) {
            let cost = object.as_ref().map_or(f32::INFINITY, ObjectSplit::cost);
            let room = slots.len() - count;
            if let Some(split) = self.spatial(refs, &extent.bounds, cost, room, scratch) {
                let (middle, end) = split.partition(slots, count, options.shapes);
                if middle != 0 && middle != end {
                    self.duplicates.fetch_add(end - count, Ordering::Relaxed);
                    return (middle, end);
                }
                // All went to one side, so none was split; the object split's order is lost.
                return (halve(&mut slots[..count], extent), count);
            }
        }
        let refs = &mut slots[..count];
        let middle = match object {
            Some(split) => split.apply(refs),
            None => halve(refs, extent),
        };
        (middle, count)
    }

    /// Whether the children of an object split overlap so much that a spatial one might be better.
    fn overlaps(&self, object: Option<&ObjectSplit>, kit: &Kit, refs: &[PrimitiveRef]) -> bool {
        let Some(object) = object else { return true };
        let least = if refs.len() < FEW { LEAST_OVERLAP_OF_FEW } else { LEAST_OVERLAP };
        let least = least * self.root_area;
        let [left, right] = kit.sides(object, refs);
        let shared = left.intersection(&right);
        let width = |b: &Bounds4| b.upper[object.axis()] - b.lower[object.axis()];
        !shared.is_empty()
            && shared.half_area() > least
            && width(&shared) > LEAST_WIDTH * width(&left.union(&right))
    }

    /// The best spatial split, if it is better than a cost and there is room for its references.
    fn spatial(
        &self,
        refs: &[PrimitiveRef],
        bounds: &Bounds4,
        cost: f32,
        room: usize,
        scratch: &mut Scratch,
    ) -> Option<SpatialSplit> {
        let bins = (4 + refs.len() / 2).min(SPATIAL_BINS);
        let grid = Grid::new(bounds, bins);
        let shapes = self.options.shapes;
        let spatial = &mut scratch.spatial;
        if refs.len() <= CHUNK {
            spatial.fill(refs, &grid, shapes);
        } else {
            let filled = refs
                .par_chunks(CHUNK)
                .map(|chunk| {
                    let mut spatial = Box::new(SpatialBins::EMPTY);
                    spatial.fill(chunk, &grid, shapes);
                    spatial
                })
                .reduce_with(|mut a, b| {
                    a.merge(&b, bins);
                    a
                });
            if let Some(filled) = filled {
                *spatial = *filled;
            }
        }
        let split = spatial.cheapest_split(&grid, self.blocks, bounds.half_area())?;
        let [left, right] = split.counts;
        let progress = left < refs.len() && right < refs.len();
        (split.cost < cost * MOST_COST && progress && left + right <= refs.len() + room)
            .then_some(split)
    }
}
