//! Bins of centroids, and the cheapest plane between them.
//!
//! After Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007. Changed: leaves
//! are counted in blocks of as many primitives as one holds (Wald, Benthin, Boulos, "Getting rid of
//! packets", 2008), and the planes of all three axes are judged at once, an axis a lane.

use glam::Vec4;

use super::{
    bounds::{Bounds4, half_areas},
    primitives::PrimitiveRef,
};

pub(super) const MAX_BINS: usize = 32;

/// Maps centroids to bins; the outermost bins are half as wide as the others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binning {
    lower: Vec4,
    scale: Vec4,
}

/// Adding 1.5 · 2²³ leaves a small number, rounded, in the low bits of the mantissa.
pub(super) const ROUND: f32 = (3 << 22) as f32;

/// The bin whose number, rounded, is in the low bits.
#[inline(always)]
pub(super) fn bin_of(rounded: f32) -> usize {
    rounded.to_bits() as usize % MAX_BINS
}

impl Binning {
    pub(super) fn new(centroids: &Bounds4, bins: usize) -> Self {
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
        let position = (reference.lower() + reference.upper() - self.lower) * self.scale;
        let rounded = position + Vec4::splat(ROUND);
        [bin_of(rounded.x), bin_of(rounded.y), bin_of(rounded.z)]
    }

    /// The side on the left of a plane.
    pub(super) fn left_of(&self, split: Split) -> LeftSide {
        let (lower, scale) = (self.lower[split.axis], self.scale[split.axis]);
        LeftSide { lower, scale, axis: split.axis, last: split.bin }
    }
}

/// What lies left of a plane between bins.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeftSide {
    lower: f32,
    scale: f32,
    axis: usize,
    last: usize,
}

impl LeftSide {
    /// Whether a primitive is there; agrees with [`Binning::bins`] bit for bit.
    #[inline(always)]
    pub(super) fn holds(&self, reference: &PrimitiveRef) -> bool {
        let [from, to] = reference.interval(self.axis);
        bin_of((from + to - self.lower) * self.scale + ROUND) <= self.last
    }
}

/// A plane between bins: those up to `bin` go left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    pub(super) axis: usize,
    pub(super) bin: usize,
    /// Area times blocks of both sides.
    pub(super) cost: f32,
}

/// Nodes of so many primitives are binned into two sets of bins.
const INTERLEAVED: usize = 256;

/// A node's primitives in bins, the axes' boxes beside each other.
pub(super) struct Bins {
    bounds: [[Bounds4; 3]; MAX_BINS],
    counts: [[u32; 4]; MAX_BINS],
}

impl Bins {
    pub(super) const EMPTY: Self =
        Self { bounds: [[Bounds4::EMPTY; 3]; MAX_BINS], counts: [[0; 4]; MAX_BINS] };

    fn clear(&mut self, bins: usize) {
        self.bounds[..bins].fill([Bounds4::EMPTY; 3]);
        self.counts[..bins].fill([0; 4]);
    }

    /// Bins primitives. Neighbours often fall into the same bin, whose memory would be waited for: of
    /// many primitives, every other one goes to `other` first.
    pub(super) fn fill(
        &mut self,
        other: &mut Self,
        refs: &[PrimitiveRef],
        binning: &Binning,
        bins: usize,
    ) {
        self.clear(bins);
        if refs.len() < INTERLEAVED {
            for reference in refs {
                self.add(reference, binning);
            }
            return;
        }
        other.clear(bins);
        let (pairs, last) = refs.as_chunks::<2>();
        for [a, b] in pairs {
            self.add(a, binning);
            other.add(b, binning);
        }
        for reference in last {
            self.add(reference, binning);
        }
        self.merge(other, bins);
    }

    #[inline(always)]
    fn add(&mut self, reference: &PrimitiveRef, binning: &Binning) {
        let bins = binning.bins(reference);
        for axis in 0..3 {
            self.bounds[bins[axis]][axis].grow(reference.lower(), reference.upper());
            self.counts[bins[axis]][axis] += 1;
        }
    }

    pub(super) fn merge(&mut self, other: &Self, bins: usize) {
        for bin in 0..bins {
            for axis in 0..3 {
                self.bounds[bin][axis].merge(&other.bounds[bin][axis]);
                self.counts[bin][axis] += other.counts[bin][axis];
            }
        }
    }

    /// The plane of least cost, if any plane has primitives on both sides; `area` is the node's.
    pub(super) fn cheapest_split(&self, bins: usize, blocks: Blocks, area: f32) -> Option<Split> {
        let overhead = blocks.overhead * area;
        let mut right_costs = [Vec4::ZERO; MAX_BINS];
        let (mut right, mut count) = ([Bounds4::EMPTY; 3], Vec4::ZERO);
        for bin in (1..bins).rev() {
            self.sweep(bin, &mut right, &mut count);
            right_costs[bin - 1] = (half_areas(&right) + overhead) * blocks.lanes(count);
        }
        let mut best = Best::NONE;
        let (mut left, mut count) = ([Bounds4::EMPTY; 3], Vec4::ZERO);
        for bin in 0..bins - 1 {
            self.sweep(bin, &mut left, &mut count);
            best.offer(
                (half_areas(&left) + overhead) * blocks.lanes(count) + right_costs[bin],
                bin,
            );
        }
        best.least().map(|(cost, axis, bin)| Split { axis, bin, cost })
    }

    #[inline(always)]
    fn sweep(&self, bin: usize, sum: &mut [Bounds4; 3], count: &mut Vec4) {
        for axis in 0..3 {
            sum[axis].merge(&self.bounds[bin][axis]);
        }
        let [x, y, z, _] = self.counts[bin];
        *count += Vec4::new(x as i32 as f32, y as i32 as f32, z as i32 as f32, 0.0);
    }

    /// The boxes of both sides of a plane.
    pub(super) fn sides(&self, split: Split, bins: usize) -> [Bounds4; 2] {
        [0..split.bin + 1, split.bin + 1..bins].map(|range| {
            self.bounds[range].iter().fold(Bounds4::EMPTY, |sum, b| sum.union(&b[split.axis]))
        })
    }
}

/// How many leaves some primitives need, and what they cost.
#[derive(Clone, Copy, Debug)]
pub(super) struct Blocks {
    scale: f32,
    offset: f32,
    /// What a leaf costs beyond its area, as a part of its parent's area: a split that needs one leaf
    /// more, and so more memory, must be worth it. Among many leaves one more makes no difference.
    pub(super) overhead: f32,
}

impl Blocks {
    /// Of blocks of some primitives, a power of two.
    pub(super) fn new(leaf_size: usize, overhead: f32) -> Self {
        debug_assert!(leaf_size.is_power_of_two());
        let scale = 1.0 / leaf_size as f32;
        Self { scale, offset: 0.5 - 0.5 * scale, overhead }
    }

    /// `⌈count / size⌉` as the nearest integer to `count / size + (1 − 1 / size) / 2`.
    #[inline(always)]
    pub(super) fn lanes(self, count: Vec4) -> Vec4 {
        let round = Vec4::splat(ROUND);
        count * self.scale + self.offset + round - round
    }
}

/// The least cost on each axis so far. Sides without primitives cost NaN (an infinite area, no
/// blocks), which is never less.
pub(super) struct Best {
    costs: Vec4,
    places: Vec4,
}

impl Best {
    pub(super) const NONE: Self = Self { costs: Vec4::INFINITY, places: Vec4::ZERO };

    #[inline(always)]
    pub(super) fn offer(&mut self, costs: Vec4, place: usize) {
        let less = costs.cmplt(self.costs);
        self.costs = Vec4::select(less, costs, self.costs);
        self.places = Vec4::select(less, Vec4::splat(place as f32), self.places);
    }

    /// Cost, axis and place.
    pub(super) fn least(&self) -> Option<(f32, usize, usize)> {
        let axis = self.costs.truncate().min_position();
        let cost = self.costs[axis];
        (cost < f32::INFINITY).then(|| (cost, axis, self.places[axis] as usize))
    }
}
