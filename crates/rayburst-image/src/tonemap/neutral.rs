//! Khronos PBR Neutral (Khronos Group, 2024): base colours come out as authored under white
//! light; only highlights above 0.8 are compressed and, when very bright, desaturated.

use glam::Vec3;

/// Fresnel reflectance at normal incidence that the curve takes away again.
const F90: f32 = 0.04;
const START: f32 = 0.8 - F90;
const DESATURATION: f32 = 0.15;

pub(super) fn map(c: Vec3) -> Vec3 {
    let smallest = c.min_element();
    // A parabola that meets the constant with equal slope at 2 × 0.04.
    let offset =
        if smallest < 2.0 * F90 { smallest - smallest * smallest / (4.0 * F90) } else { F90 };
    let c = c - offset;
    let peak = c.max_element();
    if peak < START {
        return c;
    }
    let room = 1.0 - START;
    let compressed = 1.0 - room * room / (peak + room - START);
    let towards_white = 1.0 - 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    (c * (compressed / peak)).lerp(Vec3::splat(compressed), towards_white)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middle_tones_keep_their_hue_and_highlights_their_order() {
        let c = Vec3::new(0.5, 0.3, 0.2);
        assert!((map(c) - (c - 0.04)).abs().max_element() < 1e-6);
        // The joint is continuous.
        let below = map(Vec3::splat(0.799_9)).x;
        let above = map(Vec3::splat(0.800_1)).x;
        assert!((below - 0.76).abs() < 1e-3 && (above - below).abs() < 1e-3);
        // By the specification: peak 10 - 0.04 = 9.96 gives 1 - 0.0576 / 9.44.
        assert!((map(Vec3::splat(10.0)).x - (1.0 - 0.0576 / 9.44)).abs() < 1e-5);
    }
}
