//! Powers of two and reciprocals by bits and polynomials: some operations, all of them vectors'.

use rayburst_simd::Isa;

/// Weights with a lower exponent are zero: their squares would soon be too small to be normal numbers.
pub(crate) const LEAST_EXPONENT: f32 = -40.0;
/// Adding it to a small number rounds it to a whole one, which the lowest bits then hold.
const ROUNDING: f32 = 12_582_912.0;

/// `a * b + c`: rounded once where the instruction set has an operation for it, else twice.
#[inline(always)]
pub(crate) fn fused<I: Isa>(a: f32, b: f32, c: f32) -> f32 {
    // AVX2 and AVX-512: elsewhere it may be a call.
    if const { I::NAME.as_bytes()[0] == b'a' } {
        #[expect(clippy::disallowed_methods, reason = "the token proves the operation")]
        a.mul_add(b, c)
    } else {
        a * b + c
    }
}

/// 2 to the power of `x` for `x` up to 100, within 1e-4 of it; zero if `x` is less than
/// [`LEAST_EXPONENT`] or NaN.
///
/// The whole part goes to the exponent's bits; the rest, within ±½, into the polynomial of third degree whose
/// largest relative error is least.
#[inline(always)]
pub(crate) fn exp2<I: Isa>(x: f32) -> f32 {
    let rounded = x + ROUNDING;
    let rest = x - (rounded - ROUNDING);
    let power = fused::<I>(rest, 0.055_171_95, 0.242_611_9);
    let power = fused::<I>(rest, power, 0.693_261);
    let power = fused::<I>(rest, power, 0.999_928);
    let bits = power.to_bits().wrapping_add(rounded.to_bits() << 23);
    if x > LEAST_EXPONENT { f32::from_bits(bits) } else { 0.0 }
}

/// One over `x` for x from 1e-18 to 1e18, within 2e-4 of it, without a division.
///
/// Subtracting the bits negates the exponent and, roughly, the mantissa; two of Newton's steps do the rest.
#[inline(always)]
pub(crate) fn reciprocal(x: f32) -> f32 {
    let guess = f32::from_bits(0x7EF3_11C3_u32.wrapping_sub(x.to_bits()));
    let better = guess * (2.0 - x * guess);
    better * (2.0 - x * better)
}

#[cfg(test)]
mod tests {
    use rayburst_simd::Scalar;

    use super::*;

    #[test]
    fn reciprocals_are_right_within_what_is_said() {
        let mut worst: f64 = 0.0;
        for i in -180_000..=180_000 {
            let x = (f64::from(i) * 1e-4 * std::f64::consts::LN_10).exp() as f32;
            worst = worst.max((f64::from(reciprocal(x)) * f64::from(x) - 1.0).abs());
        }
        assert!(worst < 2e-4, "{worst}");
    }

    #[test]
    fn powers_are_right_within_what_is_said() {
        let mut worst: f64 = 0.0;
        for i in -640_000..=1_000_000 {
            let x = i as f32 * 1e-4;
            if x > LEAST_EXPONENT {
                worst = worst.max((f64::from(exp2::<Scalar>(x)) / f64::from(x).exp2() - 1.0).abs());
            }
        }
        assert!(worst < 1e-4, "{worst}");
        for x in [-40.0, -65.0, -1e9, -1e38, f32::NEG_INFINITY, f32::NAN] {
            assert_eq!(exp2::<Scalar>(x), 0.0);
        }
    }
}
