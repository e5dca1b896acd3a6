//! Frames in real time: a G-buffer, passes over planes, and what lives from frame to frame.
//!
//! A [`FrameRenderer`] makes one frame after the other of a scene at its instants. Each pass reads named
//! planes and writes others: the [`GBuffer`] says what the eye sees, the [`Signals`] what light arrives
//! there, in the parts that filters want apart. Only passes that rasterise or trace see the scene.

mod analytic;
mod composite;
mod demodulate;
mod direct;
mod filters;
mod gbuffer;
mod history;
mod indirect;
mod layers;
mod lights;
mod motion;
mod occlusion;
mod pass;
mod paths;
mod quads;
mod renderer;
mod screen;
mod screen_pass;
mod settings;
mod shadow_map;
mod shadows;
mod signals;
mod ssao;
mod ssr;
mod technique;
mod view;
mod visibility;

pub use composite::{CompositeParameters, Lights, composite, variance};
pub use gbuffer::{GBuffer, PixelKind};
pub use history::History;
pub use layers::{FrameLayer, Merge};
pub use motion::Motion;
pub use renderer::{Frame, FrameRenderer, PassReport};
pub use settings::{Denoiser, FrameMode, FrameSettings, Passes, Quality, Technique};
pub use signals::{LEAST_REFLECTANCE, Signals, guarded};
pub use ssao::{ScreenOcclusion, screen_occlusion};
pub use ssr::{
    ScreenReflections, ScreenReflectionsInput, ScreenReflectionsSettings, screen_reflections,
};
pub use view::FrameView;
pub use visibility::{PrimaryRaster, rasterise, trace_primary};
