//! Sines and cosines that are the same bits on every machine.
//!
//! `f32::sin` calls the platform's mathematics library, whose last bits differ. Here: reduction to
//! [−π/4, π/4] in f64 and Taylor's polynomials (Abramowitz, Stegun 1964, 4.3.65–66) to x¹⁷ and x¹⁶,
//! whose remainder is below 1e-17; then one rounding to f32.

use std::f64::consts::FRAC_PI_2;

use glam::{Mat3, Vec3};

/// Sine and cosine of an angle in radians, |x| < 10⁶.
pub fn sin_cos(x: f32) -> (f32, f32) {
    let x = f64::from(x);
    let quadrant = (x / FRAC_PI_2).round();
    from_quadrant(x - quadrant * FRAC_PI_2, quadrant as i64)
}

/// Sine and cosine of `part / whole` of a full turn; exact at quarter turns.
pub fn turn(part: u32, whole: u32) -> (f32, f32) {
    let (part, whole) = (4 * i64::from(part), i64::from(whole));
    let quadrant = (2 * part + whole).div_euclid(2 * whole);
    let rest = (part - quadrant * whole) as f64 / whole as f64;
    from_quadrant(rest * FRAC_PI_2, quadrant)
}

/// Sine and cosine of `quadrant` quarter turns plus `r`, |r| ≤ π/4.
fn from_quadrant(r: f64, quadrant: i64) -> (f32, f32) {
    let r2 = r * r;
    // Horner's scheme; each step divides by the next two numbers of the factorial.
    let mut sin = 1.0;
    let mut cos = 1.0;
    for k in (1..9).rev() {
        let k = f64::from(k);
        sin = 1.0 - r2 / ((2.0 * k) * (2.0 * k + 1.0)) * sin;
        cos = 1.0 - r2 / ((2.0 * k - 1.0) * (2.0 * k)) * cos;
    }
    let (sin, cos) = ((sin * r) as f32, cos as f32);
    // Adding 0 turns −0 into 0, so that equal corners have equal bits.
    match quadrant.rem_euclid(4) {
        0 => (sin, cos),
        1 => (cos, -sin + 0.0),
        2 => (-sin + 0.0, -cos),
        _ => (-cos, sin),
    }
}

/// A rotation about +Y, counter-clockwise seen from above.
pub fn rotation_y(angle: f32) -> Mat3 {
    let (sin, cos) = sin_cos(angle);
    Mat3::from_cols(Vec3::new(cos, 0.0, -sin), Vec3::Y, Vec3::new(sin, 0.0, cos))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_library_within_rounding() {
        for i in -20_000..20_000 {
            let x = i as f32 * 0.003_7;
            let (sin, cos) = sin_cos(x);
            let (s, c) = f64::from(x).sin_cos();
            assert!((f64::from(sin) - s).abs() < 6.1e-8, "sin {x}: {sin} for {s}");
            assert!((f64::from(cos) - c).abs() < 6.1e-8, "cos {x}: {cos} for {c}");
        }
    }

    #[test]
    fn quarter_turns_are_exact() {
        let quarters = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)];
        for (i, quarter) in quarters.into_iter().enumerate() {
            assert_eq!(turn(3 * i as u32, 12), quarter);
        }
    }

    #[test]
    fn rotates_counter_clockwise_from_above() {
        let turned = rotation_y(std::f32::consts::FRAC_PI_2) * Vec3::X;
        assert!(turned.abs_diff_eq(Vec3::NEG_Z, 1e-7), "{turned}");
    }
}
