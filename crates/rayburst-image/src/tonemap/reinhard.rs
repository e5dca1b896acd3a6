//! Reinhard, Stark, Shirley, Ferwerda: "Photographic Tone Reproduction for Digital Images",
//! SIGGRAPH 2002, equation 4, on luminance so that hues stay.
//!
//! The paper takes the largest luminance of the picture as white; here it is a constant, so that
//! one bright pixel does not change all others.

use glam::Vec3;

use crate::colour::luminance;

/// The luminance that becomes 1: two stops above it.
const WHITE: f32 = 4.0;

pub(super) fn map(c: Vec3) -> Vec3 {
    c * ((1.0 + luminance(c) * (1.0 / (WHITE * WHITE))) / (1.0 + luminance(c)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_becomes_one() {
        assert!((map(Vec3::splat(WHITE)).x - 1.0).abs() < 1e-6);
        assert!((map(Vec3::splat(1.0)).x - 0.531_25).abs() < 1e-6);
    }
}
