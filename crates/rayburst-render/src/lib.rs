//! Rendering: integrators and the progressive renderer.
//!
//! A [`Renderer`] gives every pixel of a picture the same number of samples, pass by pass. A pass is
//! cut into tiles, a tile into batches of eye rays, and an [integrator](IntegratorKind) works through
//! a batch as queues: generate → trace batch → shade → next bounce. [`ray_trace_image`] is one ray at a
//! time, with a shader of your own.
#![forbid(unsafe_code)]

mod aov;
mod batch;
mod dimensions;
mod display;
mod error;
mod integrators;
mod progress;
mod renderer;
mod settings;
mod shade;
mod tile;

pub use aov::Aov;
pub use display::{Display, false_colours};
pub use error::{RenderError, Result};
pub use integrators::{IntegratorKind, View};
pub use progress::{Limits, Outcome, Progress, RayCounts, StopReason};
pub use renderer::{Control, Renderer};
pub use settings::{LightSampling, RenderSettings};
pub use shade::{Shade, Tracer, ray_trace_image};

pub(crate) use aov::Features;
