//! Reflections of one ray for every 2×2 pixels: resolved to full size, smoothed, and accumulated.

mod history;
mod resolve;
mod smooth;

pub use history::{ReflectionFrame, ReflectionHistory, ReflectionHistorySettings};
pub use resolve::{
    ReflectionRays, ReflectionResolve, ReflectionSettings, ReflectionSurface, Resolved,
};
pub use smooth::{ReflectionFilter, ReflectionFilterSettings};

/// Reflected rays that go farther are taken to go this far, world units.
pub(crate) const FARTHEST: f32 = 1e9;

/// What is not a position is taken to be this far away.
const OUTSIDE: f32 = 1e12;

/// A coordinate of a position.
#[inline(always)]
fn coordinate(value: f32) -> f32 {
    if value.abs() < OUTSIDE { value } else { OUTSIDE }
}
