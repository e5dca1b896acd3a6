//! Counter-based sample sequences: (seed, pixel, sample, dimension) → number in [0, 1).
//!
//! `sobol` pads four-dimensional Sobol' points, each group shuffled and each dimension
//! Owen-scrambled by hashes (Burley: "Practical Hash-based Owen Scrambling", JCGT 2020; the hash is
//! Laine and Karras's with Vegdahl's constants). The direction numbers are those of Joe and Kuo (2008).
//!
//! `blue` is for frames of one sample a pixel: pixels take the points of one scrambled Sobol' sequence in
//! the order of a scrambled Z curve, so that every block of 2ⁿ×2ⁿ pixels has well spread points and the
//! noise is blue over the screen (Ahmed, Wonka: "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling
//! Error via Hierarchical Ordering of Pixels", SIGGRAPH Asia 2020). From frame to frame all points of a
//! dimension are shifted by the next point of another scrambled sequence, so that each pixel's are well
//! spread over time, too (Cranley, Patterson: "Randomization of Number Theoretic Methods for Multiple
//! Integration", 1976).

use glam::Vec2;

use crate::hash;

/// Which sequence a [`Sampler`] follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SamplerKind {
    /// Owen-scrambled Sobol' points, padded in groups of four dimensions.
    #[default]
    Sobol,
    /// Independent hashed numbers.
    Independent,
    /// Blue noise over the screen and over frames; the sample's number is the frame's.
    Blue,
}

impl SamplerKind {
    /// All kinds with the names users type.
    pub const ALL: [(&'static str, Self); 3] =
        [("sobol", Self::Sobol), ("independent", Self::Independent), ("blue", Self::Blue)];
}

/// The sequence of one sample of one pixel: 16 bytes, copied freely, no state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampler {
    pub(crate) kind: SamplerKind,
    /// Hash of seed and pixel; for `blue` the seed.
    pub(crate) key: u32,
    pub(crate) sample: u32,
    /// The pixel's place on the Z curve.
    pub(crate) place: u32,
}

/// Direction numbers of the first four Sobol' dimensions.
pub(crate) const SOBOL: [[u32; 32]; 4] = [
    directions(0, 0, [0; 3]),
    directions(1, 0, [1, 0, 0]),
    directions(2, 1, [1, 3, 0]),
    directions(3, 1, [1, 3, 1]),
];

/// Direction numbers from a primitive polynomial of degree `s` with middle coefficients `a` and the
/// initial values `m`; `s = 0` is the van der Corput sequence.
const fn directions(s: usize, a: u32, m: [u32; 3]) -> [u32; 32] {
    let mut v = [0u32; 32];
    let mut i = 0;
    while i < 32 {
        v[i] = if s == 0 {
            1 << (31 - i)
        } else if i < s {
            m[i] << (31 - i)
        } else {
            let mut x = v[i - s] ^ (v[i - s] >> s);
            let mut k = 1;
            while k < s {
                x ^= ((a >> (s - 1 - k)) & 1) * v[i - k];
                k += 1;
            }
            x
        };
        i += 1;
    }
    v
}

/// For dimensions 1 to 3 what each byte of the index contributes: four look-ups a number.
static SOBOL_BYTES: [[[u32; 256]; 4]; 3] = byte_tables();

const fn byte_tables() -> [[[u32; 256]; 4]; 3] {
    let mut tables = [[[0u32; 256]; 4]; 3];
    let mut i = 0;
    while i < 3 * 4 * 256 {
        let (dimension, byte, value) = (i / 1024, i / 256 % 4, i % 256);
        let mut bit = 0;
        while bit < 8 {
            if value >> bit & 1 == 1 {
                tables[dimension][byte][value] ^= SOBOL[dimension + 1][8 * byte + bit];
            }
            bit += 1;
        }
        i += 1;
    }
    tables
}

#[inline]
pub(crate) fn sobol(index: u32, dimension: usize) -> u32 {
    if dimension == 0 {
        return index.reverse_bits();
    }
    let tables = &SOBOL_BYTES[dimension - 1];
    let [a, b, c, d] = index.to_le_bytes().map(usize::from);
    tables[0][a] ^ tables[1][b] ^ tables[2][c] ^ tables[3][d]
}

/// Nested uniform (Owen) scrambling of the bits of `x`, highest bit first.
#[inline]
pub(crate) fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The number of a pixel on the Z curve; sides of 65,536 pixels.
#[inline]
pub fn z_order(x: u32, y: u32) -> u32 {
    let spread = |v: u32| {
        let v = v & 0xffff;
        let v = (v | (v << 8)) & 0x00ff_00ff;
        let v = (v | (v << 4)) & 0x0f0f_0f0f;
        let v = (v | (v << 2)) & 0x3333_3333;
        (v | (v << 1)) & 0x5555_5555
    };
    spread(x) | (spread(y) << 1)
}

impl Sampler {
    /// The sequence of sample number `sample` of pixel number `pixel`. For `blue`, pixels whose numbers
    /// are near each other are neighbours; better use [`Sampler::at`].
    #[inline]
    pub fn new(kind: SamplerKind, seed: u32, pixel: u32, sample: u32) -> Self {
        match kind {
            SamplerKind::Blue => Self { kind, key: seed, sample, place: pixel },
            _ => Self { kind, key: hash::combine(seed, pixel), sample, place: 0 },
        }
    }

    /// The sequence of a sample of the pixel in column `x` and row `y` of a picture of that width.
    #[inline]
    pub fn at(kind: SamplerKind, seed: u32, (x, y): (u32, u32), width: u32, sample: u32) -> Self {
        let pixel = match kind {
            SamplerKind::Blue => z_order(x, y),
            _ => y.wrapping_mul(width).wrapping_add(x),
        };
        Self::new(kind, seed, pixel, sample)
    }

    #[inline]
    fn bits(&self, dimension: u32) -> u32 {
        match self.kind {
            SamplerKind::Independent => {
                hash::combine(hash::combine(self.key, self.sample), dimension)
            }
            SamplerKind::Sobol => {
                let group = hash::combine(self.key, dimension >> 2);
                let index = owen_scramble(self.sample, group);
                let within = dimension & 3;
                owen_scramble(sobol(index, within as usize), hash::combine(group, within))
            }
            SamplerKind::Blue => {
                let group = hash::combine(self.key, dimension >> 2);
                let within = dimension & 3;
                let index = owen_scramble(self.place, group);
                let point =
                    owen_scramble(sobol(index, within as usize), hash::combine(group, within));
                // The same for all pixels of a frame, so that their noise stays blue.
                let group = hash::combine(!self.key, dimension >> 2);
                let index = owen_scramble(self.sample, group);
                let within_frame = hash::combine(group, within);
                point.wrapping_add(owen_scramble(sobol(index, within as usize), within_frame))
            }
        }
    }

    /// The number of one dimension, in [0, 1).
    #[inline]
    pub fn get_1d(&self, dimension: u32) -> f32 {
        hash::to_unit(self.bits(dimension))
    }

    /// The numbers of dimensions `dimension` and `dimension + 1`; keep `dimension` even so that both
    /// come from one Sobol' point.
    #[inline]
    pub fn get_2d(&self, dimension: u32) -> Vec2 {
        debug_assert!(dimension.is_multiple_of(2));
        Vec2::new(self.get_1d(dimension), self.get_1d(dimension + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn byte_tables_are_the_direction_numbers() {
        for index in (0..2000).chain([u32::MAX, 0x8000_0001, 0x1234_5678]) {
            for dimension in 0..4 {
                let bits = (0..32).filter(|bit| index >> bit & 1 == 1);
                let slow = bits.fold(0, |x, bit| x ^ SOBOL[dimension][bit as usize]);
                assert_eq!(sobol(index, dimension), slow, "{index} {dimension}");
            }
        }
    }

    #[test]
    fn sobol_points_fill_every_elementary_interval() {
        // A (0, m, 2)-net: each of the 2^m boxes of every aspect ratio holds exactly one point.
        for pixel in 0..20 {
            for base in [0, 2, 4, 10] {
                let points: Vec<Vec2> = (0..64)
                    .map(|s| Sampler::new(SamplerKind::Sobol, 3, pixel, s).get_2d(base))
                    .collect();
                // Dimensions 0 and 1 of a group are a (0,2)-sequence; 2 and 3 are stratified in 1D.
                for log_x in 0..=6 {
                    if base % 4 != 0 && log_x != 0 && log_x != 6 {
                        continue;
                    }
                    let (nx, ny) = (1usize << log_x, 1usize << (6 - log_x));
                    let mut seen = [false; 64];
                    for p in &points {
                        let cell = (p.y * ny as f32) as usize * nx + (p.x * nx as f32) as usize;
                        assert!(!seen[cell], "pixel {pixel}, base {base}, {nx}x{ny}");
                        seen[cell] = true;
                    }
                }
            }
        }
    }

    #[test]
    fn dimensions_and_pixels_are_uncorrelated() {
        for (_, kind) in SamplerKind::ALL {
            for (a, b) in [(0u32, 4u32), (1, 6), (2, 9), (5, 130)] {
                let n = 4096;
                let mut sum = 0.0f64;
                for i in 0..n {
                    let s = Sampler::new(kind, 0, 17, i);
                    sum += f64::from(s.get_1d(a) - 0.5) * f64::from(s.get_1d(b) - 0.5);
                }
                // Standard deviation of the mean product of independent numbers: (1/12)/sqrt(n).
                let z = sum / f64::from(n) * 12.0 * f64::from(n).sqrt();
                assert!(z.abs() < 4.5, "{kind:?} {a} {b}: {z}");
            }
        }
    }

    #[test]
    fn blocks_of_pixels_are_well_spread_in_every_frame() {
        for frame in [0, 1, 77] {
            for (left, top) in [(0, 0), (24, 8), (4096, 640)] {
                for dimension in [0, 2, 5, 130] {
                    let mut seen = [0; 16];
                    for i in 0..16 {
                        let (x, y) = (left + i % 4, top + i / 4);
                        let sampler = Sampler::at(SamplerKind::Blue, 3, (x, y), 8192, frame);
                        let value = sampler.get_1d(dimension);
                        assert!((0.0..1.0).contains(&value));
                        // The frame's shift taken back, points are one in each sixteenth.
                        let first = Sampler::at(SamplerKind::Blue, 3, (left, top), 8192, frame);
                        let zero = Sampler::at(SamplerKind::Blue, 3, (left, top), 8192, 0);
                        let shift = first.bits(dimension).wrapping_sub(zero.bits(dimension));
                        let still = Sampler::at(SamplerKind::Blue, 3, (x, y), 8192, 0);
                        assert_eq!(
                            sampler.bits(dimension),
                            still.bits(dimension).wrapping_add(shift)
                        );
                        // How far apart they are does not depend on it.
                        seen[(value * 16.0) as usize] += 1;
                    }
                    // A shift may move two across a border.
                    assert!(seen.iter().all(|&n| n <= 2), "{seen:?}");
                }
            }
        }
    }

    #[test]
    fn the_noise_of_a_frame_is_blue() {
        // The mean over blocks of 4×4 pixels varies much less than that of independent numbers.
        let variance = |kind: SamplerKind, frame: u32| {
            let mut sum = 0.0f64;
            for block in 0..256 {
                let mut mean = 0.0;
                for i in 0..16 {
                    let pixel = (block % 16 * 4 + i % 4, block / 16 * 4 + i / 4);
                    mean += f64::from(Sampler::at(kind, 9, pixel, 64, frame).get_1d(2)) / 16.0;
                }
                sum += (mean - 0.5).powi(2) / 256.0;
            }
            sum
        };
        for frame in 0..8 {
            let independent = variance(SamplerKind::Independent, frame);
            assert!(variance(SamplerKind::Blue, frame) < 0.25 * independent);
        }
    }

    #[test]
    fn a_pixel_is_well_spread_over_frames() {
        for dimension in 0..8 {
            for pixel in [(0, 0), (17, 5), (300, 211)] {
                let mut seen = [0u32; 8];
                for frame in 0..64 {
                    let sampler = Sampler::at(SamplerKind::Blue, 1, pixel, 640, frame);
                    seen[(sampler.get_1d(dimension) * 8.0) as usize] += 1;
                }
                assert!(seen.iter().all(|n| (6..=10).contains(n)), "{dimension}: {seen:?}");
            }
        }
    }
}
