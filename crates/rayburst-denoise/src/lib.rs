//! Denoisers of one-sample pictures: planes in, planes out. Nothing here knows a scene.
//!
//! Every filter is a function from named planes and a small parameter struct to named planes. What lives
//! from frame to frame is in the filter's own history, and a history is never a plane that is handed out.

#![forbid(unsafe_code)]

mod approximate;
mod asvgf;
mod atrous;
mod atrous_kernel;
mod average;
mod error;
mod estimate;
mod geometry;
mod gradient;
mod guides;
mod inspect;
mod reprojection;
mod slope;
mod stack;
mod svgf;
mod temporal;
mod temporal_kernel;
mod variance;

pub use asvgf::AdaptiveSvgf;
pub use atrous::{EdgeStopping, MOST_LEVELS, Wavelet, WaveletKernel};
pub use average::{Tap, Window, weighted_average};
pub use error::{DenoiseError, Result};
pub use gradient::{GradientSamples, GradientSettings, Gradients, NO_SAMPLE, STRATUM, strata};
pub use guides::Guides;
pub use reprojection::{Reprojection, SurfaceTests, Taps, reproject};
pub use stack::Stack;
pub use svgf::{Svgf, SvgfSettings};
pub use temporal::{Accumulation, LARGEST, Temporal};
pub use variance::{RunningVariance, VariancePlane, blend_variance};
