//! Denoisers of one-sample pictures: planes in, planes out. Nothing here knows a scene.
//!
//! Every filter is a function from named planes and a small parameter struct to named planes. What lives
//! from frame to frame is in the filter's own history, and a history is never a plane that is handed out.

#![forbid(unsafe_code)]

mod approximate;
mod atrous;
mod atrous_kernel;
mod average;
mod error;
mod geometry;
mod guides;
mod reprojection;
mod slope;
mod stack;
mod temporal;
mod variance;

pub use atrous::{EdgeStopping, MOST_LEVELS, Wavelet, WaveletKernel};
pub use average::{Tap, Window, weighted_average};
pub use error::{DenoiseError, Result};
pub use guides::Guides;
pub use reprojection::{Reprojection, SurfaceTests, Taps, reproject};
pub use stack::Stack;
pub use temporal::{Accumulation, LARGEST, Temporal};
pub use variance::{RunningVariance, VariancePlane, blend_variance};
