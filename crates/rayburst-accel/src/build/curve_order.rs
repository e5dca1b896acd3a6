//! Primitives in the order of a space-filling curve.

use std::sync::atomic::AtomicU64;

use rayon::prelude::*;

use super::{
    binned_sah::{TASK, extent_of},
    morton::{Grid, Keys},
    primitives::PrimitiveRef,
};
use crate::Curve;

/// Primitives sorted by the places of their centroids on a curve.
pub(super) fn in_curve_order(refs: &[PrimitiveRef], curve: Curve) -> Vec<PrimitiveRef> {
    let centroids = extent_of(refs).centroids;
    let grid = Grid::new(centroids.lower, centroids.upper, curve);
    let keys = (0..refs.len())
        .into_par_iter()
        .with_min_len(TASK)
        .map(|i| AtomicU64::new(grid.key(refs[i].lower() + refs[i].upper(), i as u32)))
        .collect();
    let keys = Keys::sort(keys);
    (0..keys.len())
        .into_par_iter()
        .with_min_len(TASK)
        .map(|at| refs[keys.index(at) as usize])
        .collect()
}
