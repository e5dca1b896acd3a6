//! Stephen Hill's fit of the Academy Color Encoding System's reference rendering transform and
//! 100-nit sRGB output transform (BakingLab, 2016): a rational curve between two matrices.
//!
//! Unlike Narkowicz's one-curve fit it desaturates bright colours as ACES does. Scaled so that an
//! input of 1 is not white; expose accordingly.

use glam::{Mat3, Vec3};

/// Linear sRGB to the rendering space (with ACES' saturation), rows written as columns below.
const INPUT: Mat3 = Mat3::from_cols(
    Vec3::new(0.597_19, 0.076_00, 0.028_40),
    Vec3::new(0.354_58, 0.908_34, 0.133_83),
    Vec3::new(0.048_23, 0.015_66, 0.837_77),
);

const OUTPUT: Mat3 = Mat3::from_cols(
    Vec3::new(1.604_75, -0.102_08, -0.003_27),
    Vec3::new(-0.531_08, 1.108_13, -0.072_76),
    Vec3::new(-0.073_67, -0.006_05, 1.076_02),
);

pub(super) fn map(c: Vec3) -> Vec3 {
    let v = INPUT * c;
    let numerator = v * (v + 0.024_578_6) - 0.000_090_537;
    let denominator = v * (0.983_729 * v + 0.432_951) + 0.238_081;
    OUTPUT * (numerator / denominator)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // The curve by hand at v = 0.18 and v = 1 for greys; both matrices keep greys.
        let curve = |v: f32| {
            (v * v + 0.024_578_6 * v - 0.000_090_537)
                / (0.983_729 * v * v + 0.432_951 * v + 0.238_081)
        };
        for v in [0.18, 1.0, 8.0] {
            assert!((map(Vec3::splat(v)) - Vec3::splat(curve(v))).abs().max_element() < 2e-4);
        }
        // Bright saturated red moves towards white.
        let red = map(Vec3::new(50.0, 0.0, 0.0));
        assert!(red.y > 0.2, "{red}");
    }
}
