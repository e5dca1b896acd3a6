//! Sums as pairs of floats.
//!
//! Knuth's error-free addition ("The Art of Computer Programming" 2, section 4.2.2) keeps what
//! rounding loses in a second float: about 48 bits, so that a million samples add up exactly
//! enough, and two plain `f32` planes in a file hold the whole state.

/// An unevaluated sum `hi + lo` with `|lo|` at most half an ulp of `hi`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    /// The rounded value.
    pub hi: f32,
    /// What rounding lost.
    pub lo: f32,
}

impl Sum {
    /// Adds one number.
    #[inline]
    pub fn add(&mut self, x: f32) {
        let sum = self.hi + x;
        let from_x = sum - self.hi;
        let error = (self.hi - (sum - from_x)) + (x - from_x);
        let low = self.lo + error;
        self.hi = sum + low;
        self.lo = low - (self.hi - sum);
    }

    /// The sum.
    #[inline]
    pub fn value(self) -> f64 {
        f64::from(self.hi) + f64::from(self.lo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayburst_math::hash::Rng;

    #[test]
    fn a_million_numbers_lose_nothing_that_a_float_could_show() {
        let mut rng = Rng::new(3);
        let (mut sum, mut exact, mut naive) = (Sum::default(), 0.0f64, 0.0f32);
        for _ in 0..1_000_000 {
            let x = rng.range(0.0, 1.0).powi(8) * 100.0;
            sum.add(x);
            exact += f64::from(x);
            naive += x;
        }
        assert!((sum.value() - exact).abs() < exact * 1e-11, "{} {exact}", sum.value());
        assert!((f64::from(naive) - exact).abs() > exact * 1e-7);
    }

    #[test]
    fn large_and_small_numbers_meet() {
        let mut sum = Sum::default();
        for x in [1e8, 1.0, -1e8] {
            sum.add(x);
        }
        assert_eq!(sum.value(), 1.0);
    }
}
