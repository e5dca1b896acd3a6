//! Splits between primitives: exact for few, binned for many.

use rayon::prelude::*;

use super::{
    bins::{Binning, Bins, Blocks, Split},
    bounds::{Bounds4, Extent},
    partition::{CHUNK, partition},
    primitives::PrimitiveRef,
    small::{self, SMALL, SmallSplit},
};

/// What finding splits needs: bins, and a second set for [`Bins::fill`].
pub(super) struct Kit {
    bins: [Bins; 2],
}

/// A split of a node's primitives.
#[derive(Clone, Copy, Debug)]
pub(super) enum ObjectSplit {
    Exact(SmallSplit),
    Binned(Binning, usize, Split),
}

impl ObjectSplit {
    /// Area times blocks of both sides.
    pub(super) fn cost(&self) -> f32 {
        match self {
            Self::Exact(split) => split.cost,
            Self::Binned(_, _, split) => split.cost,
        }
    }

    /// The axis that its plane is across.
    pub(super) fn axis(&self) -> usize {
        match self {
            Self::Exact(split) => split.axis,
            Self::Binned(_, _, split) => split.axis,
        }
    }

    /// Reorders the primitives that it was found for so that the first ones go left; returns how many
    /// these are.
    pub(super) fn apply(&self, refs: &mut [PrimitiveRef]) -> usize {
        match self {
            Self::Exact(split) => split.apply(refs),
            Self::Binned(binning, _, split) => {
                let left = binning.left_of(*split);
                partition(refs, |reference| left.holds(reference))
            }
        }
    }
}

impl Kit {
    pub(super) const EMPTY: Self = Self { bins: [Bins::EMPTY; 2] };

    /// The best split into two parts, if there is any.
    pub(super) fn find(
        &mut self,
        refs: &[PrimitiveRef],
        extent: &Extent,
        bins: usize,
        blocks: Blocks,
    ) -> Option<ObjectSplit> {
        let area = extent.bounds.half_area();
        if refs.len() <= SMALL {
            return Some(ObjectSplit::Exact(small::find(refs, area, blocks)));
        }
        let count = (4 + refs.len() / 4).min(bins);
        let binning = Binning::new(&extent.centroids, count);
        self.fill(refs, &binning, count);
        let split = self.bins[0].cheapest_split(count, blocks, area)?;
        Some(ObjectSplit::Binned(binning, count, split))
    }

    /// The boxes of both sides of the split found last.
    pub(super) fn sides(&self, split: &ObjectSplit, refs: &[PrimitiveRef]) -> [Bounds4; 2] {
        match split {
            ObjectSplit::Exact(split) => split.sides(refs),
            ObjectSplit::Binned(_, count, split) => self.bins[0].sides(*split, *count),
        }
    }

    /// Bins primitives, in parallel if they are many.
    fn fill(&mut self, refs: &[PrimitiveRef], binning: &Binning, count: usize) {
        let [own, spare] = &mut self.bins;
        if refs.len() <= CHUNK {
            return own.fill(spare, refs, binning, count);
        }
        let filled = refs
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut bins = Box::new([Bins::EMPTY; 2]);
                let [own, spare] = &mut *bins;
                own.fill(spare, chunk, binning, count);
                bins
            })
            .reduce_with(|mut a, b| {
                a[0].merge(&b[0], count);
                a
            });
        if let Some(filled) = filled {
            self.bins = *filled;
        }
    }
}
