//! How pictures that are not radiance are shown on a screen.

use rayburst_image::RgbImage;
use rayburst_math::glam::Vec3;

/// What the numbers of a picture mean to a screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Display {
    /// Radiance: expose and tone-map it.
    Radiance,
    /// Colours in [0, 1], shown as they are.
    Colours,
    /// Amounts from 0 up, in units of their own: shown in false colours, see [`false_colours`].
    Amounts,
}

/// Amounts in false colours from dark blue over green to yellow, and the amount that is shown as the
/// brightest: the 99th percentile of the finite ones. Infinite ones are black.
pub fn false_colours(amounts: &RgbImage) -> (RgbImage, f32) {
    let mut sorted: Vec<f32> =
        amounts.pixels.iter().map(|p| p.x).filter(|a| a.is_finite()).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let top = sorted.get(sorted.len() * 99 / 100).copied().unwrap_or(0.0);
    let scale = if top > 0.0 { 1.0 / top } else { 0.0 };
    let show = |p: Vec3| if p.x.is_finite() { ramp(p.x * scale) } else { Vec3::ZERO };
    (amounts.clone().map(show), top)
}

/// A ramp of rising luminance through seven colours, linear Rec. 709.
fn ramp(x: f32) -> Vec3 {
    const STOPS: [[f32; 3]; 7] = [
        [0.010, 0.004, 0.045],
        [0.055, 0.020, 0.200],
        [0.035, 0.110, 0.290],
        [0.015, 0.255, 0.270],
        [0.060, 0.440, 0.150],
        [0.430, 0.640, 0.040],
        [0.980, 0.800, 0.030],
    ];
    let at = x.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let i = (at as usize).min(STOPS.len() - 2);
    Vec3::from_array(STOPS[i]).lerp(Vec3::from_array(STOPS[i + 1]), at - i as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn false_colours_get_brighter() {
        let luminance = |c: Vec3| c.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        let steps: Vec<f32> = (0..=100).map(|i| luminance(ramp(i as f32 / 100.0))).collect();
        assert!(steps.windows(2).all(|w| w[0] < w[1]), "{steps:?}");
        let amounts = RgbImage::from_fn(10, 10, |x, y| {
            Vec3::splat(if (x, y) == (9, 9) { f32::INFINITY } else { (x + 10 * y) as f32 })
        });
        let (picture, top) = false_colours(&amounts);
        assert_eq!(top, 98.0);
        assert_eq!((picture.get(9, 9), picture.get(8, 9)), (Vec3::ZERO, ramp(1.0)));
    }
}
