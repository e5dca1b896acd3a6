//! Primitives in the order of a space-filling curve.

use std::sync::atomic::AtomicU64;

use rayon::prelude::*;

use super::{
    binned_sah::{TASK, extent_of},
    morton::{Grid, Keys},
    primitives::PrimitiveRef,
};
use crate::Curve;

/// Primitives along a curve.
pub(super) struct Ordered {
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
        Self { refs }
    }
}
