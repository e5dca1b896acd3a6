//! sRGB's transfer function (IEC 61966-2-1, exact pieces) and Rec. 709 luminance.

use std::sync::LazyLock;

use glam::Vec3;

/// Rec. 709 weights of linear red, green and blue.
pub const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Luminance of a linear Rec. 709 colour.
#[inline]
pub fn luminance(colour: Vec3) -> f32 {
    colour.dot(LUMINANCE)
}

/// A value from 0 to `max`; NaN counts as 0, unlike with `clamp`.
#[inline]
pub(crate) fn clamp_bad(value: f32, max: f32) -> f32 {
    if value > 0.0 { value.min(max) } else { 0.0 }
}

/// Linear value to sRGB signal; both 0 to 1.
#[inline]
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// sRGB signal to linear value; both 0 to 1.
#[inline]
pub fn srgb_decode(signal: f32) -> f32 {
    if signal <= 0.040_45 { signal / 12.92 } else { ((signal + 0.055) / 1.055).powf(2.4) }
}

/// [`srgb_encode`] of each component.
#[inline]
pub fn srgb_encode3(linear: Vec3) -> Vec3 {
    Vec3::new(srgb_encode(linear.x), srgb_encode(linear.y), srgb_encode(linear.z))
}

/// [`srgb_decode`] of each component.
#[inline]
pub fn srgb_decode3(signal: Vec3) -> Vec3 {
    Vec3::new(srgb_decode(signal.x), srgb_decode(signal.y), srgb_decode(signal.z))
}

/// The linear value of each sRGB byte. Keep the reference where it is used often.
pub fn srgb_table() -> &'static [f32; 256] {
    static TABLE: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|i| srgb_decode(i as f32 / 255.0)));
    &TABLE
}

/// The value of each byte that stores a number from 0 to 1.
pub fn linear_table() -> &'static [f32; 256] {
    static TABLE: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|i| i as f32 / 255.0));
    &TABLE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_the_round_trip() {
        for byte in 0..=255u8 {
            let linear = srgb_table()[usize::from(byte)];
            assert_eq!((srgb_encode(linear) * 255.0).round() as u8, byte);
        }
        assert_eq!(srgb_table()[255], 1.0);
        assert_eq!(linear_table()[51], 0.2);
    }

    #[test]
    fn known_values() {
        // Middle grey, and both sides of the two pieces' joint.
        assert!((srgb_encode(0.18) - 0.461_356).abs() < 1e-5);
        assert!((srgb_encode(0.003_130_7) - srgb_encode(0.003_130_9)).abs() < 1e-5);
        assert!((srgb_decode(0.5) - 0.214_041).abs() < 1e-5);
        assert!((luminance(Vec3::ONE) - 1.0).abs() < 1e-6);
    }
}
