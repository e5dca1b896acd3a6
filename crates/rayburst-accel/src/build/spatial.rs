//! Planes that split primitives: bins of space, and the partition of references by a plane.
//!
//! After Stich, Friedrich, Dietrich, "Spatial splits in bounding volume hierarchies", HPG 2009:
//! references are chopped at the planes between bins, each bin counts the references that begin and
//! that end in it, and a reference across the chosen plane goes to both sides or, if that is cheaper,
//! whole to one of them (*reference unsplitting*).
//!
//! Changed: leaves are counted in blocks; unsplitting judges by the boxes and counts that the bins
//! gave, so that it does not depend on the order of references.

use glam::Vec4;

use super::{
    bins::{Best, Blocks, ROUND, bin_of},
    bounds::{Bounds4, half_areas},
    clip::{Corners, Plane},
    primitives::PrimitiveRef,
};

/// Bins an axis at most.
pub(super) const SPATIAL_BINS: usize = 16;

/// The corners of primitives.
pub(crate) trait Shapes: Sync {
    /// The corners of the triangle of this index; boxes of references hold them or parts of them.
    fn corners(&self, index: u32) -> [Vec4; 3];
}

/// Bins of equal width across a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    lower: Vec4,
    width: Vec4,
    scale: Vec4,
    bins: usize,
}

impl Grid {
    pub(super) fn new(bounds: &Bounds4, bins: usize) -> Self {
        let extent = bounds.upper - bounds.lower;
        let axis = |e: f32| {
            let scale = bins as f32 / e;
            if scale.is_finite() { scale } else { 0.0 }
        };
        let scale = Vec4::new(axis(extent.x), axis(extent.y), axis(extent.z), 0.0);
        Self { lower: bounds.lower, width: extent / bins as f32, scale, bins }
    }

    /// The bins that hold a point, axis by axis.
    #[inline(always)]
    fn bins(&self, point: Vec4) -> [usize; 3] {
        let last = Vec4::splat((self.bins - 1) as f32);
        let position = (point - self.lower) * self.scale - 0.5;
        let rounded = position.max(Vec4::ZERO).min(last) + ROUND;
        [bin_of(rounded.x), bin_of(rounded.y), bin_of(rounded.z)]
    }

    /// The bin that holds a coordinate on an axis.
    #[inline(always)]
    fn bin<const AXIS: usize>(&self, x: f32) -> usize {
        let position = (x - self.lower[AXIS]) * self.scale[AXIS] - 0.5;
        let last = (self.bins - 1) as f32;
        let position = if position > 0.0 { position } else { 0.0 };
        bin_of((if position < last { position } else { last }) + ROUND)
    }

    /// The plane before a bin.
    #[inline(always)]
    fn plane(&self, axis: usize, bin: usize) -> f32 {
        self.lower[axis] + bin as f32 * self.width[axis]
    }
}

/// A plane that splits what it meets, and what the bins say of its sides.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpatialSplit {
    plane: Plane,
    pub(super) cost: f32,
    /// References on each side.
    pub(super) counts: [usize; 2],
    bounds: [Bounds4; 2],
}

/// A node's references in bins of space.
pub(super) struct SpatialBins {
    bounds: [[Bounds4; 3]; SPATIAL_BINS],
    /// References that begin in a bin.
    entries: [[u32; 4]; SPATIAL_BINS],
    /// References that end in a bin.
    exits: [[u32; 4]; SPATIAL_BINS],
}

impl SpatialBins {
    pub(super) const EMPTY: Self = Self {
        bounds: [[Bounds4::EMPTY; 3]; SPATIAL_BINS],
        entries: [[0; 4]; SPATIAL_BINS],
        exits: [[0; 4]; SPATIAL_BINS],
    };

    pub(super) fn fill(&mut self, refs: &[PrimitiveRef], grid: &Grid, shapes: &impl Shapes) {
        self.bounds[..grid.bins].fill([Bounds4::EMPTY; 3]);
        self.entries[..grid.bins].fill([0; 4]);
        self.exits[..grid.bins].fill([0; 4]);
        for reference in refs {
            let (first, last) = (grid.bins(reference.lower()), grid.bins(reference.upper()));
            for axis in 0..3 {
                self.entries[first[axis]][axis] += 1;
                self.exits[last[axis]][axis] += 1;
            }
            if first == last {
                for axis in 0..3 {
                    self.bounds[first[axis]][axis].grow(reference.lower(), reference.upper());
                }
            } else {
                let corners = shapes.corners(reference.index());
                self.chop::<0>(&corners, reference, grid, first[0], last[0]);
                self.chop::<1>(&corners, reference, grid, first[1], last[1]);
                self.chop::<2>(&corners, reference, grid, first[2], last[2]);
            }
        }
    }

    /// Adds what of a triangle is in its reference's box to the bins from `first` to `last`: the parts
    /// of its edges in each, drawn into the box. As the bins only choose a plane, this need not be
    /// exact.
    #[inline(always)]
    fn chop<const AXIS: usize>(
        &mut self,
        corners: &Corners,
        reference: &PrimitiveRef,
        grid: &Grid,
        first: usize,
        last: usize,
    ) {
        let (lower, upper) = (reference.lower(), reference.upper());
        if first == last {
            return self.bounds[first][AXIS].grow(lower, upper);
        }
        let [from, to] = [lower[AXIS], upper[AXIS]];
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = if corners[i][AXIS] <= corners[j][AXIS] {
                (corners[i], corners[j])
            } else {
                (corners[j], corners[i])
            };
            if b[AXIS] < from || a[AXIS] > to {
                continue;
            }
            // Not finite only if both ends are in one bin.
            let slope = (b - a) / (b[AXIS] - a[AXIS]);
            let at = |position: f32| a + slope * (position - a[AXIS]);
            let start = if a[AXIS] < from { at(from) } else { a };
            let end = if b[AXIS] > to { at(to) } else { b };
            let begin_bin = grid.bin::<AXIS>(start[AXIS]).clamp(first, last);
            let end_bin = grid.bin::<AXIS>(end[AXIS]).clamp(first, last);
            let mut previous = start.clamp(lower, upper);
            for bin in begin_bin..end_bin {
                let next = at(grid.plane(AXIS, bin + 1)).clamp(lower, upper);
                self.bounds[bin][AXIS].grow(previous.min(next), previous.max(next));
                previous = next;
            }
            let end = end.clamp(lower, upper);
            self.bounds[end_bin][AXIS].grow(previous.min(end), previous.max(end));
        }
    }

    pub(super) fn merge(&mut self, other: &Self, bins: usize) {
        for bin in 0..bins {
            for axis in 0..3 {
                self.bounds[bin][axis].merge(&other.bounds[bin][axis]);
                self.entries[bin][axis] += other.entries[bin][axis];
                self.exits[bin][axis] += other.exits[bin][axis];
            }
        }
    }

    /// The plane of least cost, if any plane has something on both sides; `area` is the node's.
    pub(super) fn cheapest_split(
        &self,
        grid: &Grid,
        blocks: Blocks,
        area: f32,
    ) -> Option<SpatialSplit> {
        let bins = grid.bins;
        let overhead = blocks.overhead * area;
        let mut right_costs = [Vec4::ZERO; SPATIAL_BINS];
        let (mut right, mut count) = ([Bounds4::EMPTY; 3], Vec4::ZERO);
        for bin in (1..bins).rev() {
            self.sweep(bin, &self.exits, &mut right, &mut count);
            right_costs[bin - 1] = (half_areas(&right) + overhead) * blocks.lanes(count);
        }
        let mut best = Best::NONE;
        let (mut left, mut count) = ([Bounds4::EMPTY; 3], Vec4::ZERO);
        for bin in 0..bins - 1 {
            self.sweep(bin, &self.entries, &mut left, &mut count);
            let cost = (half_areas(&left) + overhead) * blocks.lanes(count);
            best.offer(cost + right_costs[bin], bin);
        }
        let (cost, axis, bin) = best.least()?;
        let sum = |counts: &[[u32; 4]]| counts.iter().map(|c| c[axis] as usize).sum();
        let union = |bounds: &[[Bounds4; 3]]| {
            bounds.iter().fold(Bounds4::EMPTY, |sum, b| sum.union(&b[axis]))
        };
        Some(SpatialSplit {
            plane: Plane::new(axis, grid.plane(axis, bin + 1)),
            cost,
            counts: [sum(&self.entries[..=bin]), sum(&self.exits[bin + 1..bins])],
            bounds: [union(&self.bounds[..=bin]), union(&self.bounds[bin + 1..bins])],
        })
    }

    #[inline(always)]
    fn sweep(
        &self,
        bin: usize,
        counts: &[[u32; 4]; SPATIAL_BINS],
        sum: &mut [Bounds4; 3],
        count: &mut Vec4,
    ) {
        for axis in 0..3 {
            sum[axis].merge(&self.bounds[bin][axis]);
        }
        let [x, y, z, _] = counts[bin];
        *count += Vec4::new(x as i32 as f32, y as i32 as f32, z as i32 as f32, 0.0);
    }
}

/// Where a reference across a plane goes.
enum Sides {
    Left,
    Right,
    Both(Bounds4, Bounds4),
}

impl SpatialSplit {
    /// Moves the references that go left to the front of the first `count`, and those that go right
    /// behind them; the second halves of split ones follow, in the room after `count`. Returns how many
    /// are left, and how many there are now.
    pub(super) fn partition(
        &self,
        refs: &mut [PrimitiveRef],
        count: usize,
        shapes: &impl Shapes,
    ) -> (usize, usize) {
        let (mut middle, mut end) = (0, count);
        for i in 0..count {
            let mut reference = refs[i];
            let [from, to] = reference.interval(self.plane.axis);
            let goes_left = if to <= self.plane.position {
                true
            } else if from >= self.plane.position {
                false
            } else {
                match self.sides(&reference, end < refs.len(), shapes) {
                    Sides::Left => true,
                    Sides::Right => false,
                    Sides::Both(left, right) => {
                        refs[end] = reference.with_bounds(&right);
                        end += 1;
                        reference = reference.with_bounds(&left);
                        true
                    }
                }
            };
            refs[i] = refs[middle];
            refs[middle] = reference;
            middle += usize::from(goes_left);
        }
        (middle, end)
    }

    fn sides(&self, reference: &PrimitiveRef, room: bool, shapes: &impl Shapes) -> Sides {
        let whole = Bounds4::of(reference);
        let corners = shapes.corners(reference.index());
        let (left, right) = self.plane.clip(&corners, &whole);
        // The triangle itself may be on one side only, although its box is not.
        if right.is_empty() {
            return Sides::Left;
        }
        if left.is_empty() {
            return Sides::Right;
        }
        let [a, b] = &self.bounds;
        let (a_area, b_area) = (a.half_area(), b.half_area());
        let [a_count, b_count] = self.counts.map(|count| count as f32);
        let both = a_area * a_count + b_area * b_count;
        let only_left = a.union(&whole).half_area() * a_count + b_area * (b_count - 1.0);
        let only_right = a_area * (a_count - 1.0) + b.union(&whole).half_area() * b_count;
        if room && both <= only_left && both <= only_right {
            Sides::Both(left, right)
        } else if only_left <= only_right {
            Sides::Left
        } else {
            Sides::Right
        }
    }
}
