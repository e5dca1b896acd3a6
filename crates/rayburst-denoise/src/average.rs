//! The weighted average that all filters are forms of: slow, plain, and what faster ones are tested against.
//!
//! Eq. 26.3 of Akenine-Möller et al.: "Real-Time Rendering", 4th edition, online chapter "Real-Time Ray
//! Tracing" (2018): the sum of w(p, q) d(q) over the pixels q of a window around p, divided by the sum of the
//! weights; and its extension over time, where pixels of the frames before have weights, too.

use rayburst_image::Plane;
use rayon::prelude::*;

use crate::{Result, reprojection::same_size};

/// The pixels around a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Pixels to every side.
    pub radius: u32,
    /// From one to the next; 2 leaves every other one out, and so on. Zero counts as one.
    pub step: u32,
}

/// A pixel of a window, in one of the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tap {
    /// Column.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// Index of the frame: 0 is the picture, 1 the frame before, and so on.
    pub frame: usize,
}

/// The average over a window of some frames: the picture that is filtered, then those before it, if any.
/// `weight` is asked for a pixel of the picture and a tap. Taps outside the picture, values that are not
/// finite and weights that are not positive count for nothing; where nothing counts the result is zero.
///
/// Fails where frames differ in size. No frames give an empty plane.
pub fn weighted_average(
    frames: &[&Plane],
    window: Window,
    weight: impl Fn((u32, u32), Tap) -> f64 + Sync,
) -> Result<Plane> {
    let Some(first) = frames.first() else { return Ok(Plane::default()) };
    let size @ (width, height) = first.size();
    for frame in frames {
        same_size("a frame", frame.size(), size)?;
    }
    let mut out = Plane::new(width, height)?;
    let stride = out.stride();
    out.values_mut().par_chunks_mut(stride).zip(0..height).for_each(|(row, y)| {
        for (value, x) in row.iter_mut().zip(0..width) {
            *value = average_at(frames, window, &weight, (x, y));
        }
    });
    Ok(out)
}

fn average_at(
    frames: &[&Plane],
    window: Window,
    weight: &impl Fn((u32, u32), Tap) -> f64,
    (x, y): (u32, u32),
) -> f32 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (frame, plane) in frames.iter().enumerate() {
        for qy in range(y, plane.height(), window) {
            for qx in range(x, plane.width(), window) {
                let value = f64::from(plane.get(qx, qy));
                let weight = weight((x, y), Tap { x: qx, y: qy, frame });
                if weight > 0.0 && value.is_finite() {
                    sum += weight * value;
                    weights += weight;
                }
            }
        }
    }
    if weights > 0.0 { (sum / weights) as f32 } else { 0.0 }
}

/// The coordinates of a window around one that are in the picture.
fn range(centre: u32, size: u32, window: Window) -> impl Iterator<Item = u32> {
    let step = window.step.max(1);
    let before = (centre / step).min(window.radius);
    let after = ((size - 1 - centre) / step).min(window.radius);
    (0..=before + after).map(move |i| centre - before * step + i * step)
}
