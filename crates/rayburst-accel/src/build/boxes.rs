//! The tree over boxes, each of which is a leaf: of instances, and of procedural primitives.

use std::sync::atomic::AtomicU64;

use glam::Vec4;
use rayburst_math::Aabb;
use rayon::prelude::*;

use super::{
    binned_sah::{BinnedSah, MAX_DEPTH},
    monitor::Monitor,
    morton::{Grid, INACTIVE, Keys},
    primitives::PrimitiveRef,
};
use crate::{
    BuildError, BuildOptions, BuildQuality,
    layout::bvh8::{Bvh8, Leaves},
};

/// Boxes that one task works on, at least.
pub(crate) const TASK: usize = 1 << 10;
/// So few boxes are not worth a sort along a curve.
const FEW: usize = 64;

/// Leaves that are boxes: the reference says which, and nothing is stored.
pub(crate) struct BoxLeaves;

impl Leaves for BoxLeaves {
    const HALF_LINES: usize = 0;

    fn place(&self, primitives: &[u32], _: u32) -> u32 {
        primitives[0]
    }

    fn write(&self, _: &[u32], _: &mut [u32]) {}
}

/// Boxes to build over; those that are empty stay out of the tree.
pub(crate) struct Boxes<F> {
    /// How many there are.
    pub(crate) count: usize,
    /// How many are not empty.
    pub(crate) active: usize,
    /// The box around twice the centres of those that are not empty.
    pub(crate) centres: [Vec4; 2],
    /// The box of each.
    pub(crate) bounds_of: F,
}

/// Twice the centre of a box.
pub(crate) fn twice_the_centre(bounds: &Aabb) -> Vec4 {
    (bounds.lower + bounds.upper).extend(0.0)
}

impl<F: Fn(u32) -> Aabb + Sync> Boxes<F> {
    /// Builds the tree; the value of a leaf is the index of its box.
    pub(crate) fn tree(
        &self,
        options: &BuildOptions<'_>,
        monitor: Monitor<'_>,
    ) -> Result<Bvh8, BuildError> {
        if options.quality == BuildQuality::Fast && self.active > FEW {
            return Bvh8::over_boxes(&self.keys(options), &self.bounds_of, 8);
        }
        let binary = BinnedSah { bins: 16, leaf_size: 1, max_depth: MAX_DEPTH, monitor };
        let binary = binary.build(self.references())?;
        // A cancelled tree has leaves of any size.
        monitor.check()?;
        Bvh8::collapse(&binary, &BoxLeaves)
    }

    /// The boxes, in parallel.
    fn all(&self) -> impl IndexedParallelIterator<Item = (u32, Aabb)> {
        let indices = (0..self.count as u32).into_par_iter().with_min_len(TASK);
        indices.map(|index| (index, (self.bounds_of)(index)))
    }

    fn references(&self) -> Vec<PrimitiveRef> {
        let reference = |(index, bounds): (u32, Aabb)| PrimitiveRef::new(&bounds, index);
        if self.active == self.count {
            return self.all().map(reference).collect();
        }
        self.all().filter(|(_, bounds)| !bounds.is_empty()).map(reference).collect()
    }

    fn keys(&self, options: &BuildOptions<'_>) -> Keys {
        let [lower, upper] = self.centres;
        let grid = Grid::new(lower, upper, options.curve);
        let key = |(index, bounds): (u32, Aabb)| {
            let key = if bounds.is_empty() {
                INACTIVE
            } else {
                grid.key(twice_the_centre(&bounds), index)
            };
            AtomicU64::new(key)
        };
        Keys::sort(self.all().map(key).collect())
    }
}
