//! The structural similarity index.
//!
//! Wang, Bovik, Sheikh, Simoncelli: "Image Quality Assessment: From Error Visibility to Structural
//! Similarity", 2004, as `skimage.metrics.structural_similarity` computes it with
//! `gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1, channel_axis=2`:
//! an 11 × 11 Gaussian window, each channel by itself, the mean without a border of 5 pixels.

use super::convolve::Plane;
use crate::{ImageError, Result, RgbImage};

const DEVIATION: f64 = 1.5;
const RADIUS: usize = 5;
/// (0.01 × range)² and (0.03 × range)².
const C1: f64 = 1e-4;
const C2: f64 = 9e-4;

/// The mean index, and each pixel's index averaged over the channels. Pictures must be at least
/// 11 × 11.
pub fn ssim(reference: &RgbImage, test: &RgbImage) -> Result<(f64, Vec<f32>)> {
    let (width, height) = (reference.width as usize, reference.height as usize);
    if width.min(height) < 2 * RADIUS + 1 {
        let text = format!("ssim needs pictures of at least 11x11, these are {width}x{height}");
        return Err(ImageError::Invalid(text));
    }
    let mut map = vec![0.0f64; width * height];
    for channel in 0..3 {
        let plane = |picture: &RgbImage| -> Vec<f64> {
            picture.pixels.iter().map(|p| f64::from(p[channel])).collect()
        };
        let index = channel_index(reference.width, plane(reference), plane(test));
        map.iter_mut().zip(index).for_each(|(sum, s)| *sum += s / 3.0);
    }
    let rows = map.chunks_exact(width).skip(RADIUS).take(height - 2 * RADIUS);
    let sum: f64 = rows.map(|row| row[RADIUS..width - RADIUS].iter().sum::<f64>()).sum();
    let count = (width - 2 * RADIUS) * (height - 2 * RADIUS);
    Ok((sum / count as f64, map.into_iter().map(|s| s as f32).collect()))
}

fn channel_index(width: u32, x: Vec<f64>, y: Vec<f64>) -> Vec<f64> {
    let mut kernel: Vec<f64> = (0..=2 * RADIUS)
        .map(|i| (-0.5 * ((i as f64 - RADIUS as f64) / DEVIATION).powi(2)).exp())
        .collect();
    let sum: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= sum);
    let smooth = |values: Vec<f64>| Plane::new(width, values).convolve(&kernel, &kernel).values;
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect();
    let (xx, yy, xy) = (product(&x, &x), product(&y, &y), product(&x, &y));
    let [ux, uy, uxx, uyy, uxy] = [x, y, xx, yy, xy].map(smooth);
    (0..ux.len())
        .map(|i| {
            let (mx, my) = (ux[i], uy[i]);
            let (vx, vy, vxy) = (uxx[i] - mx * mx, uyy[i] - my * my, uxy[i] - mx * my);
            ((2.0 * mx * my + C1) * (2.0 * vxy + C2)) / ((mx * mx + my * my + C1) * (vx + vy + C2))
        })
        .collect()
}
