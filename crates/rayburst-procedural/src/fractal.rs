//! Fractal landscapes: heights from noise of many sizes.
//!
//! The noise is the gradient noise of Perlin: "Improving Noise" (2002), in two dimensions and with
//! gradients from a hash instead of a table. Its sums are those of Musgrave in Ebert,
//! Musgrave, Peachey, Perlin, Worley: "Texturing and Modeling: A Procedural Approach", 3rd ed. (2003),
//! chapter 16.

use glam::{DVec2, Vec2};
use rayburst_math::hash;

use crate::{HeightField, HeightFieldError};

/// How a landscape is made. The same numbers give the same heights everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landscape {
    /// Which landscape.
    pub seed: u32,
    /// `2^level + 1` heights along each side; at most [`Landscape::MAX_LEVEL`].
    pub level: u32,
    /// Cells of the largest noise along a side.
    pub frequency: f32,
    /// How many noises are summed, each of half the size of the one before.
    pub octaves: u32,
    /// How much lower each noise is than the one before, about 0.5.
    pub gain: f32,
    /// 0: hills (fractional Brownian motion); 1: ridges (ridged multifractal); between: a blend.
    pub ridges: f32,
}

impl Landscape {
    /// The finest grid: 8193 heights along each side.
    pub const MAX_LEVEL: u32 = 13;
    /// No more noises than this are summed.
    pub const MAX_OCTAVES: u32 = 24;

    /// Heights along each side.
    pub fn size(&self) -> usize {
        (1 << self.level.min(Self::MAX_LEVEL)) + 1
    }

    /// The heights, between -1 and 1, those of equal z side by side. Parameters that are not numbers
    /// count as 0.
    pub fn heights(&self) -> Vec<f32> {
        let n = self.size();
        let at = |i: usize| i as f64 / (n - 1) as f64;
        (0..n * n).map(|i| self.height(DVec2::new(at(i % n), at(i / n)))).collect()
    }

    /// The landscape over the rectangle from `lower` to `upper` (x and z), from `-height` to `height`
    /// at most.
    pub fn height_field(
        &self,
        lower: Vec2,
        upper: Vec2,
        height: f32,
    ) -> Result<HeightField, HeightFieldError> {
        let heights = self.heights().iter().map(|h| h * height).collect();
        HeightField::new(self.size(), self.size(), heights, lower, upper)
    }

    /// The height at a place in the unit square, between -1 and 1.
    fn height(&self, place: DVec2) -> f32 {
        let number = |x: f32, low: f64, high: f64| {
            if x.is_nan() { 0.0 } else { f64::from(x).clamp(low, high) }
        };
        let gain = number(self.gain, 0.0, 1.0);
        let ridges = number(self.ridges, 0.0, 1.0);
        let mut frequency = number(self.frequency, 0.0, 65_536.0);
        let (mut hills, mut crests, mut weight) = (0.0, 0.0, 1.0);
        let (mut amplitude, mut sum) = (1.0, 0.0);
        for octave in 0..self.octaves.min(Self::MAX_OCTAVES) {
            let noise = gradient_noise(hash::combine(self.seed, octave), place * frequency);
            hills += amplitude * noise;
            // Sharp where the noise is 0; details only grow on what is high already.
            let crest = (1.0 - noise.abs()).powi(2) * weight;
            crests += amplitude * crest;
            weight = (2.0 * crest).clamp(0.0, 1.0);
            sum += amplitude;
            amplitude *= gain;
            frequency *= 2.0;
        }
        if sum == 0.0 {
            return 0.0;
        }
        let (hills, crests) = (hills / sum, 2.0 * crests / sum - 1.0);
        (hills + ridges * (crests - hills)) as f32
    }
}

impl Default for Landscape {
    fn default() -> Self {
        Self { seed: 0, level: 9, frequency: 4.0, octaves: 9, gain: 0.5, ridges: 0.5 }
    }
}

/// Noise between -1 and 1, twice continuously differentiable, 0 at points with whole coordinates.
fn gradient_noise(seed: u32, place: DVec2) -> f64 {
    let corner = place.floor();
    let inside = place - corner;
    let fade = |t: f64| t * t * t * (t * (6.0 * t - 15.0) + 10.0);
    let (u, v) = (fade(inside.x), fade(inside.y));
    let slope = |x: f64, z: f64| {
        let cell = corner + DVec2::new(x, z);
        // Negative coordinates wrap; the cast to i64 saturates, and noise is not asked for so far out.
        let word = |c: f64| c as i64 as u32;
        let bits = hash::words(&[seed, word(cell.x), word(cell.y)]);
        // No sines: their last bits differ between machines. Odd numbers are never zero.
        let odd = |bits: u32| f64::from(2 * (bits & 0xFFFF) + 1) - 65_536.0;
        let gradient = DVec2::new(odd(bits), odd(bits >> 16)).normalize();
        gradient.dot(inside - DVec2::new(x, z))
    };
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let value = lerp(
        lerp(slope(0.0, 0.0), slope(1.0, 0.0), u),
        lerp(slope(0.0, 1.0), slope(1.0, 1.0), u),
        v,
    );
    // Unit gradients reach at most √½ in the middle of a cell.
    (value * std::f64::consts::SQRT_2).clamp(-1.0, 1.0)
}
