//! Frames in real time: the sums of their passes, each pass against what it should be, and frames in a row.

mod effects;
mod filters;
mod loops;
mod motion;
mod sums;

use std::sync::Arc;

use glam::Vec3;
use rayburst_image::RgbImage;
use rayburst_render::realtime::{Frame, FrameRenderer, FrameSettings, History};
use rayburst_scene::{Camera, FlatScene};

/// The mean of as many frames of a scene that stands still.
pub(crate) fn mean_of_frames(
    scene: &Arc<FlatScene>,
    camera: Camera,
    settings: &FrameSettings,
    frames: u32,
) -> RgbImage {
    mean_of(scene, camera, settings, frames, |frame| frame.picture.to_image())
}

/// The mean over frames of a picture that each gives.
pub(crate) fn mean_of(
    scene: &Arc<FlatScene>,
    camera: Camera,
    settings: &FrameSettings,
    frames: u32,
    picture: impl Fn(&Frame<'_>) -> RgbImage,
) -> RgbImage {
    let mut renderer = FrameRenderer::new(*settings).unwrap();
    let mut history = History::new();
    let (width, height) = settings.render_size();
    let mut sum = RgbImage::new(width, height, Vec3::ZERO);
    for _ in 0..frames {
        let frame = renderer.frame(scene, &camera, &mut history).unwrap();
        for (sum, pixel) in sum.pixels.iter_mut().zip(&picture(&frame).pixels) {
            *sum += *pixel / frames as f32;
        }
    }
    sum
}

/// Channel means of a picture.
pub(crate) fn channels(picture: &RgbImage) -> Vec3 {
    picture.pixels.iter().sum::<Vec3>() / picture.pixels.len() as f32
}
