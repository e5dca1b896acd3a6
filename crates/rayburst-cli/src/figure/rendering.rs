//! Rendering for figures: a built-in scene, with a progress bar, until done or stopped.

use std::{ops::ControlFlow, sync::Arc};

use rayburst::{
    accel::BuildOptions,
    image::{
        Rgb8Image, RgbImage, ToneMap,
        quantise::{Dither, to_srgb8},
    },
    render::{Limits, Progress, Renderer, StopReason},
    scene::{Camera, FlatScene, Flattener, Pose, builtin},
};

use crate::{
    error::{CliError, Result},
    interrupt,
    progress::{self, Bar},
};

/// A built-in scene at rest and its first view.
pub(super) fn scene(spec: &str) -> Result<(Arc<FlatScene>, Camera)> {
    let scene = builtin::build(spec).map_err(|e| CliError::failed(e.to_string()))?;
    let view = scene.views.first().map(|v| v.camera);
    let camera = view.ok_or_else(|| CliError::failed(format!("scene '{spec}' has no view")))?;
    let flat = Flattener::new(&scene, BuildOptions::default()).at(&Pose::rest(&scene))?;
    Ok((Arc::new(flat), camera))
}

/// Renders to the last sample; the bar shows these samples as a share of `all`.
pub(super) fn finish(renderer: &mut Renderer, from: u32, all: u32) -> Result<()> {
    let pixels = renderer.settings().pixels();
    let bar = Bar::new(pixels, progress::Limits::default(), String::new());
    let outcome = renderer.render_until(&Limits::default(), &|now| {
        bar.show(&Progress { target: all, ..now.clone() }, from);
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    bar.clear();
    match outcome.reason {
        StopReason::Interrupted => Err(CliError::failed("stopped before the figure was finished")),
        _ => Ok(()),
    }
}

/// A picture in 8 bits.
pub(super) fn develop(picture: &RgbImage, stops: f32) -> Rgb8Image {
    to_srgb8(&ToneMap::default().apply_image(picture, stops), Dither::Triangular)
}
