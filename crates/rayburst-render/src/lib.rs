//! Rendering: integrators and the progressive renderer.
//!
//! A [`Renderer`] gives every pixel of a picture the same number of samples, pass by pass. A pass is
//! cut into tiles, a tile into batches of eye rays, and an [integrator](IntegratorKind) works through
//! a batch as queues: generate → trace batch → shade → next bounce. [`Reference`] is the readable
//! twin, one ray at a time; [`ray_trace_image`] is that with a shader of your own.
#![forbid(unsafe_code)]

mod aov;
mod batch;
mod dimensions;
mod display;
mod error;
mod estimator;
mod footprint;
mod integrators;
mod naive;
mod progress;
pub mod realtime;
pub mod reference;
mod renderer;
mod settings;
mod shade;
mod tile;
mod visibility;

pub use aov::Aov;
pub use display::{Display, false_colours};
pub use error::{RenderError, Result};
pub use integrators::{IntegratorKind, View};
pub use naive::trace_naive;
pub use progress::{Limits, Outcome, Progress, RayCounts, StopReason};
pub use reference::{Reference, Way};
pub use renderer::{Control, Renderer};
pub use settings::{LightSampling, RenderSettings};
pub use shade::{Shade, Tracer, ray_trace_image};
pub use visibility::visible;

pub(crate) use aov::Features;
