//! Display-linear colours to sRGB bytes, rounded or dithered.
//!
//! Dither breaks up the bands that 8 bits leave in smooth shading. It adds a triangular offset of
//! ±1 step from a hash of pixel and channel: the error is then independent of the signal in mean
//! and variance (Wannamaker, Lipshitz, Vanderkooy, Wright: "A theory of nonsubtractive dither",
//! 2000), and the same picture always gives the same bytes.

use glam::Vec3;
use rayburst_math::hash;
use rayon::prelude::*;

use crate::colour::{clamp_bad, srgb_encode3};
use crate::{Rgb8Image, RgbImage};

/// How a value between two steps is rounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Dither {
    /// To the nearest step.
    #[default]
    None,
    /// By a triangular hash noise of one step.
    Triangular,
}

/// Quantises display-linear values (0 to 1, others clip, NaN is 0) to sRGB bytes.
pub fn to_srgb8(picture: &RgbImage, dither: Dither) -> Rgb8Image {
    let mut data = vec![0u8; picture.pixels.len() * 3];
    data.par_chunks_mut(3 * 4096).enumerate().for_each(|(block, bytes)| {
        let first = block * 4096;
        for (i, bytes) in bytes.chunks_exact_mut(3).enumerate() {
            let steps = encode(picture.pixels[first + i]) * 255.0;
            for channel in 0..3 {
                let offset = match dither {
                    Dither::None => 0.0,
                    Dither::Triangular => triangular((first + i) as u32, channel as u32),
                };
                // Black and white stay free of noise; `as` saturates.
                let step = steps[channel];
                let offset = offset * step.min(255.0 - step).clamp(0.0, 1.0);
                bytes[channel] = (step + offset + 0.5) as u8;
            }
        }
    });
    Rgb8Image { width: picture.width, height: picture.height, data }
}

/// Quantises display-linear values to 16-bit sRGB words.
pub fn to_srgb16(picture: &RgbImage) -> Vec<u16> {
    let words = |p: &Vec3| (encode(*p) * 65_535.0 + 0.5).to_array().map(|v| v as u16);
    picture.pixels.iter().flat_map(words).collect()
}

fn encode(colour: Vec3) -> Vec3 {
    let clean = colour.to_array().map(|v| clamp_bad(v, 1.0));
    srgb_encode3(Vec3::from_array(clean))
}

/// In (-1, 1), with a triangular density.
fn triangular(pixel: u32, channel: u32) -> f32 {
    let a = hash::words(&[pixel, channel, 0]);
    let b = hash::pcg(a);
    hash::to_unit(a) - hash::to_unit(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::srgb_table;

    #[test]
    fn bytes_come_back_exactly() {
        let table = srgb_table();
        let ramp = RgbImage::from_fn(256, 1, |x, _| Vec3::splat(table[x as usize]));
        let out = to_srgb8(&ramp, Dither::None);
        assert!(out.data.chunks(3).enumerate().all(|(i, c)| c == [i as u8; 3]));
    }

    #[test]
    fn dither_keeps_the_mean_and_hides_the_step() {
        // A signal of 100.3 steps: plain rounding says 100 everywhere.
        let value = crate::colour::srgb_decode(100.3 / 255.0);
        let flat = RgbImage::new(256, 256, Vec3::splat(value));
        let out = to_srgb8(&flat, Dither::Triangular);
        let mean = out.data.iter().map(|&b| f64::from(b)).sum::<f64>() / out.data.len() as f64;
        assert!((mean - 100.3).abs() < 0.01, "{mean}");
        assert_eq!(out, to_srgb8(&flat, Dither::Triangular));
        assert!(to_srgb8(&flat, Dither::None).data.iter().all(|&b| b == 100));
    }

    #[test]
    fn the_ends_stay_clean_and_bad_numbers_are_black_or_white() {
        for dither in [Dither::None, Dither::Triangular] {
            let black = to_srgb8(&RgbImage::new(64, 64, Vec3::ZERO), dither);
            assert!(black.data.iter().all(|&b| b == 0));
            let white = to_srgb8(&RgbImage::new(64, 64, Vec3::splat(7.0)), dither);
            assert!(white.data.iter().all(|&b| b == 255));
        }
        let bad = RgbImage::new(1, 1, Vec3::new(f32::NAN, f32::INFINITY, -1.0));
        assert_eq!(to_srgb8(&bad, Dither::None).data, [0, 255, 0]);
        assert_eq!(to_srgb16(&bad), [0, 65_535, 0]);
    }
}
