//! Which dimension of the sample sequence decides what. Groups of four share one Sobol' point.

/// Where in the pixel; two numbers.
pub(crate) const FILTER: u32 = 0;
/// Where on the lens; two numbers.
pub(crate) const LENS: u32 = 2;
