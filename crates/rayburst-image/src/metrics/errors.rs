//! Errors by arithmetic: root mean square, relative mean square, and peak signal to noise.

use glam::{DVec3, Vec3};

use crate::RgbImage;

/// Keeps the relative error of dark pixels finite.
const RELATIVE_FLOOR: f32 = 0.01;

fn squares(reference: &RgbImage, test: &RgbImage) -> impl Iterator<Item = (Vec3, Vec3)> {
    reference.pixels.iter().zip(&test.pixels).map(|(&r, &t)| ((t - r) * (t - r), r))
}

fn mean(values: impl Iterator<Item = Vec3>, pixels: usize) -> f64 {
    let sum = values.fold(DVec3::ZERO, |sum, v| sum + v.as_dvec3());
    sum.element_sum() / (3 * pixels) as f64
}

/// The mean squared difference over pixels and channels.
pub fn mse(reference: &RgbImage, test: &RgbImage) -> f64 {
    mean(squares(reference, test).map(|(d, _)| d), reference.pixels.len())
}

/// The root of [`mse`], as `sqrt(skimage.metrics.mean_squared_error)`.
pub fn rmse(reference: &RgbImage, test: &RgbImage) -> f64 {
    mse(reference, test).sqrt()
}

/// The mean over pixels and channels of `difference² / (reference² + 0.01)`
/// (Rousselle, Knaus, Zwicker: "Adaptive Sampling and Reconstruction using Greedy Error
/// Minimization", 2011).
pub fn relmse(reference: &RgbImage, test: &RgbImage) -> f64 {
    mean(
        squares(reference, test).map(|(d, r)| d / (r * r + RELATIVE_FLOOR)),
        reference.pixels.len(),
    )
}

/// `10 log10(1 / mse)` in decibels, as `skimage.metrics.peak_signal_noise_ratio` with a data range
/// of 1; infinite for equal pictures.
pub fn psnr(reference: &RgbImage, test: &RgbImage) -> f64 {
    -10.0 * mse(reference, test).log10()
}

/// The root mean square over the channels of each pixel.
pub fn rmse_map(reference: &RgbImage, test: &RgbImage) -> Vec<f32> {
    squares(reference, test).map(|(d, _)| (d.element_sum() / 3.0).sqrt()).collect()
}

/// Each pixel's share of [`relmse`].
pub fn relmse_map(reference: &RgbImage, test: &RgbImage) -> Vec<f32> {
    squares(reference, test)
        .map(|(d, r)| (d / (r * r + RELATIVE_FLOOR)).element_sum() / 3.0)
        .collect()
}
