//! Exposure in stops, and a choice of it from the picture.
//!
//! Automatic exposure brings the log-average luminance of the picture's middle tones to middle
//! grey (after Reinhard et al. 2002, equation 1). Black background does not count, nor do the
//! darkest and brightest twentieth of the rest, so that small lights do not dim a picture; then
//! the exposure is lowered as far as needed to keep the bright tenth from burning out.
//! The result depends on nothing but the picture.

use crate::RgbImage;
use crate::colour::luminance;

/// Where the middle tones go.
const MIDDLE_GREY: f32 = 0.18;
/// The share of lit pixels that is left out at either end.
const TRIM: f32 = 0.05;
/// Luminance, relative to the 90th percentile, under which a pixel is background: 12 stops.
const BACKGROUND: f32 = 1.0 / 4096.0;
/// The highest exposed luminance of the 90th percentile.
const BRIGHT: f32 = 0.9;
/// Range of the result in stops.
const LIMIT: f32 = 32.0;

/// The factor of an exposure of `ev` stops: 2^ev.
#[inline]
pub fn scale(ev: f32) -> f32 {
    ev.exp2()
}

/// The exposure in stops that suits a picture; 0 for a black one.
pub fn auto_exposure(picture: &RgbImage) -> f32 {
    let mut lit: Vec<f32> = picture
        .pixels
        .iter()
        .map(|&p| luminance(p))
        .filter(|l| l.is_finite() && *l > f32::MIN_POSITIVE)
        .collect();
    lit.sort_unstable_by(f32::total_cmp);
    let Some(bright) = at(&lit, 0.9) else { return 0.0 };
    let background = lit.partition_point(|&l| l < bright * BACKGROUND);
    let lit = &lit[background..];
    let trim = (lit.len() as f32 * TRIM) as usize;
    let middle = &lit[trim..lit.len() - trim];
    let sum: f64 = middle.iter().map(|&l| f64::from(l.log2())).sum();
    let average = (sum / middle.len() as f64) as f32;
    let for_grey = MIDDLE_GREY.log2() - average;
    let for_bright = at(lit, 0.9).map_or(for_grey, |l| BRIGHT.log2() - l.log2());
    for_grey.min(for_bright).clamp(-LIMIT, LIMIT)
}

fn at(sorted: &[f32], share: f32) -> Option<f32> {
    sorted.get((sorted.len() as f32 * share) as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn grey(width: u32, height: u32, value: f32) -> RgbImage {
        RgbImage::new(width, height, Vec3::splat(value))
    }

    #[test]
    fn a_flat_picture_becomes_middle_grey() {
        for value in [1e-6, 0.18, 1.0, 4e5] {
            let ev = auto_exposure(&grey(8, 8, value));
            assert!((value * scale(ev) - 0.18).abs() < 1e-4, "{value} {ev}");
        }
    }

    #[test]
    fn small_lights_and_black_background_change_nothing() {
        let plain = auto_exposure(&grey(40, 40, 0.5));
        let mut lights = grey(40, 40, 0.5);
        lights.pixels[..60].fill(Vec3::splat(1e6));
        assert!((auto_exposure(&lights) - plain).abs() < 1e-5);
        let mut cutout = grey(40, 40, 0.5);
        cutout.pixels[..1400].fill(Vec3::ZERO);
        assert!((auto_exposure(&cutout) - plain).abs() < 1e-5);
        cutout.pixels[..1400].fill(Vec3::splat(1e-5));
        assert!((auto_exposure(&cutout) - plain).abs() < 1e-5);
    }

    #[test]
    fn a_bright_part_is_kept_from_burning_out() {
        let mut window = grey(10, 10, 0.01);
        window.pixels[..30].fill(Vec3::splat(1.0));
        assert!(scale(auto_exposure(&window)) <= 0.901);
    }

    #[test]
    fn black_and_broken_pictures_have_an_exposure() {
        assert_eq!(auto_exposure(&grey(4, 4, 0.0)), 0.0);
        assert_eq!(auto_exposure(&grey(4, 4, f32::NAN)), 0.0);
        assert!(auto_exposure(&grey(4, 4, f32::MAX)).is_finite());
        assert_eq!(auto_exposure(&grey(1, 1, 0.18)), 0.0);
    }
}
