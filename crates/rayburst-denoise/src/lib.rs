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
mod bilateral;
mod blocks;
mod checks;
mod clip;
mod error;
mod estimate;
mod firefly;
mod geometry;
mod gradient;
mod guides;
mod inspect;
mod lanes;
mod least;
mod neighbourhood;
mod occlusion;
mod reflection;
mod reprojection;
mod scratch;
mod shadow;
mod shadow_history;
mod slope;
mod stack;
mod surfaces;
mod svgf;
mod taa;
mod temporal;
mod temporal_kernel;
mod texels;
mod upscale;
mod variance;

pub use asvgf::AdaptiveSvgf;
pub use atrous::{EdgeStopping, MOST_LEVELS, Wavelet, WaveletKernel};
pub use average::{Tap, Window, weighted_average};
pub use error::{DenoiseError, Result};
pub use firefly::{FireflyFilter, FireflySettings};
pub use gradient::{GradientSamples, GradientSettings, Gradients, NO_SAMPLE, STRATUM, strata};
pub use guides::Guides;
pub use occlusion::{OcclusionFilter, OcclusionSettings};
pub use reflection::{
    ReflectionFilter, ReflectionFilterSettings, ReflectionFrame, ReflectionHistory,
    ReflectionHistorySettings, ReflectionRays, ReflectionResolve, ReflectionSettings,
    ReflectionSurface, Resolved,
};
pub use reprojection::{Reprojection, SurfaceTests, Taps, reproject};
pub use shadow::{LightSize, ShadowFilter, ShadowSettings};
pub use shadow_history::{ShadowHistory, ShadowHistorySettings};
pub use stack::Stack;
pub use surfaces::{SurfaceTolerance, Surfaces};
pub use svgf::{Svgf, SvgfSettings};
pub use taa::{TaaSettings, TemporalAntialiasing};
pub use temporal::{Accumulation, LARGEST, Temporal};
pub use upscale::{TemporalUpscaling, UpscaleSettings};
pub use variance::{RunningVariance, VariancePlane, blend_variance};
