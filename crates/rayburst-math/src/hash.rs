//! Integer hashes and a small generator: the roots of all randomness, with no global state.
//!
//! Jarzynski, Olano: "Hash Functions for GPU Rendering", JCGT 2020 (PCG output hash).

use glam::{Vec2, Vec3};

/// The PCG output permutation as a hash of 32 bits.
#[inline]
pub const fn pcg(input: u32) -> u32 {
    let state = input.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// A hash of two words; chain it for more.
#[inline]
pub const fn combine(a: u32, b: u32) -> u32 {
    pcg(a ^ pcg(b.wrapping_add(0x9E37_79B9)))
}

/// A hash of several words, order dependent.
#[inline]
pub fn words(words: &[u32]) -> u32 {
    words.iter().fold(0x8542_5F1D, |h, &w| combine(h, w))
}

/// The 24 high bits as a number in [0, 1).
#[inline]
pub fn to_unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A counter-based generator for tests, scene generators and ray sets; not for pixels (see
/// [`crate::Sampler`]).
#[derive(Clone, Debug)]
pub struct Rng {
    state: u64,
}

impl Rng {
    /// A stream that depends on nothing but `seed`.
    pub const fn new(seed: u64) -> Self {
        Self { state: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03 }
    }

    /// 64 random bits (SplitMix64; Steele, Lea, Flood 2014).
    #[inline]
    pub fn u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.state ^ (self.state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// 32 random bits.
    #[inline]
    pub fn u32(&mut self) -> u32 {
        (self.u64() >> 32) as u32
    }

    /// An integer in `[0, n)`, `n > 0`.
    #[inline]
    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.u32()) * u64::from(n)) >> 32) as u32
    }

    /// A number in [0, 1).
    #[inline]
    pub fn f32(&mut self) -> f32 {
        to_unit(self.u32())
    }

    /// A number in `[lo, hi)`.
    #[inline]
    pub fn range(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * self.f32()
    }

    /// Two numbers in [0, 1).
    #[inline]
    pub fn vec2(&mut self) -> Vec2 {
        Vec2::new(self.f32(), self.f32())
    }

    /// Three numbers in [0, 1).
    #[inline]
    pub fn vec3(&mut self) -> Vec3 {
        Vec3::new(self.f32(), self.f32(), self.f32())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_numbers_stay_below_one() {
        assert!(to_unit(u32::MAX) < 1.0);
        assert_eq!(to_unit(0), 0.0);
    }

    #[test]
    fn the_generator_is_uniform() {
        let mut rng = Rng::new(7);
        let mut bins = [0u32; 64];
        for _ in 0..640_000 {
            bins[rng.below(64) as usize] += 1;
        }
        // 63 degrees of freedom: mean 63, standard deviation 11.2.
        let chi2: f64 = bins.iter().map(|&b| (f64::from(b) - 1e4).powi(2) / 1e4).sum();
        assert!(chi2 < 63.0 + 5.0 * 11.2, "{chi2}");
    }
}
