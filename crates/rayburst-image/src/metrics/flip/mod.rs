//! ꟻLIP: the difference an observer sees when flipping between two pictures, 0 to 1 a pixel.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: "ꟻLIP: A Difference
//! Evaluator for Alternating Images", HPG 2020. A colour difference after filtering by the eye's
//! contrast sensitivity, amplified where edges or points differ:
//! `colour^(1 - feature)` (equation 13). Filters are separable here; the blue-yellow one is a sum
//! of two Gaussians, hence two passes. Agrees with the authors' `flip-evaluator`.

mod colour;
mod features;
mod hdr;
mod spatial;

use super::convolve::Plane;
use rayon::prelude::*;

use crate::RgbImage;

pub use hdr::{ExposureRange, hdr_flip};

/// Pixels per degree of vision 0.7 m before a screen 0.7 m and 3840 pixels wide: about 67.02.
pub const PIXELS_PER_DEGREE: f32 = 0.7 * (3840.0 / 0.7) * (std::f32::consts::PI / 180.0);

/// LDR-ꟻLIP of each pixel. The pictures are display-linear and have one size; values are clipped
/// to 0 to 1.
pub fn flip(reference: &RgbImage, test: &RgbImage, pixels_per_degree: f32) -> Vec<f32> {
    let [reference, test] = [reference, test].map(opponent_planes);
    let colours = spatial::colour_difference(&reference, &test, pixels_per_degree);
    let features = features::difference(&reference[0], &test[0], pixels_per_degree);
    colours.par_iter().zip(&features).map(|(c, f)| c.powf(1.0 - f)).collect()
}

/// The three planes of Y Cx Cz.
fn opponent_planes(picture: &RgbImage) -> [Plane<f32>; 3] {
    let mut planes = [(); 3].map(|()| Vec::with_capacity(picture.pixels.len()));
    for &pixel in &picture.pixels {
        let clipped = pixel.clamp(glam::Vec3::ZERO, glam::Vec3::ONE);
        let opponent = colour::linear_to_opponent(clipped);
        for i in 0..3 {
            planes[i].push(opponent[i]);
        }
    }
    planes.map(|values| Plane::new(picture.width, values))
}
