//! The sequences of sixteen pixels: twins of [`crate::Sampler`].

use super::{F32x16, LANES, U32x16, Vec2x16};
use crate::{
    hash,
    sampler::{SOBOL, Sampler, SamplerKind, owen_scramble, sobol},
};

/// The sequences of one sample of sixteen pixels each.
#[derive(Clone, Copy, Debug)]
pub struct Sampler16 {
    first: Sampler,
    keys: U32x16,
    /// The pixels' places on the Z curve.
    places: U32x16,
}

impl Sampler16 {
    /// Those of pixels of a picture; see [`Sampler::at`].
    #[inline(always)]
    pub fn at(
        kind: SamplerKind,
        seed: u32,
        x: [u32; LANES],
        y: [u32; LANES],
        width: u32,
        sample: u32,
    ) -> Self {
        let first = Sampler::at(kind, seed, (x[0], y[0]), width, sample);
        let places = spread(U32x16(x)) | spread(U32x16(y)).shifted_left(1);
        let mut keys = U32x16::splat(first.key);
        if kind != SamplerKind::Blue {
            for i in 0..LANES {
                keys.0[i] = Sampler::at(kind, seed, (x[i], y[i]), width, sample).key;
            }
        }
        Self { first, keys, places }
    }

    /// Sixteen sequences, all of the same kind, seed and sample.
    #[inline(always)]
    pub fn of(samplers: &[Sampler; LANES]) -> Self {
        let mut out = Self { first: samplers[0], keys: U32x16::splat(0), places: U32x16::splat(0) };
        for i in 0..LANES {
            out.keys.0[i] = samplers[i].key;
            out.places.0[i] = samplers[i].place;
        }
        out
    }

    /// The sequence of one of the pixels.
    #[inline]
    pub fn lane(&self, i: usize) -> Sampler {
        let place = if self.first.kind == SamplerKind::Blue { self.places.0[i] } else { 0 };
        Sampler { key: self.keys.0[i], place, ..self.first }
    }

    /// The numbers of one dimension, in [0, 1): with the bits of [`Sampler::get_1d`].
    #[inline(always)]
    pub fn get_1d(&self, dimension: u32) -> F32x16 {
        match self.first.kind {
            SamplerKind::Blue => {
                let bits = self.blue(dimension);
                (bits >> 8).to_f32() * (1.0 / 16_777_216.0)
            }
            SamplerKind::Sobol | SamplerKind::Independent => self.one_by_one(dimension),
        }
    }

    /// The numbers of dimensions `dimension` and `dimension + 1`, see [`Sampler::get_2d`].
    #[inline(always)]
    pub fn get_2d(&self, dimension: u32) -> Vec2x16 {
        Vec2x16 { x: self.get_1d(dimension), y: self.get_1d(dimension + 1) }
    }

    #[inline(never)]
    fn one_by_one(&self, dimension: u32) -> F32x16 {
        let mut out = F32x16::ZERO;
        for i in 0..LANES {
            out.0[i] = self.lane(i).get_1d(dimension);
        }
        out
    }

    #[inline(always)]
    fn blue(&self, dimension: u32) -> U32x16 {
        let group = hash::combine(self.first.key, dimension >> 2);
        let within = dimension & 3;
        let index = scrambled(self.places, group);
        let point = scrambled(point_of(index, within), hash::combine(group, within));
        let group = hash::combine(!self.first.key, dimension >> 2);
        let index = owen_scramble(self.first.sample, group);
        let shift = owen_scramble(sobol(index, within as usize), hash::combine(group, within));
        point + U32x16::splat(shift)
    }
}

/// Every other bit, of numbers of 16 bits.
#[inline(always)]
fn spread(v: U32x16) -> U32x16 {
    let v = v & U32x16::splat(0xffff);
    let v = (v | v.shifted_left(8)) & U32x16::splat(0x00ff_00ff);
    let v = (v | v.shifted_left(4)) & U32x16::splat(0x0f0f_0f0f);
    let v = (v | v.shifted_left(2)) & U32x16::splat(0x3333_3333);
    (v | v.shifted_left(1)) & U32x16::splat(0x5555_5555)
}

#[inline(always)]
fn scrambled(x: U32x16, seed: u32) -> U32x16 {
    let mut x = x.reverse_bits();
    x = x ^ (x * U32x16::splat(0x3d20_adea));
    x = x + U32x16::splat(seed);
    x = x * U32x16::splat((seed >> 16) | 1);
    x = x ^ (x * U32x16::splat(0x0552_6c56));
    x = x ^ (x * U32x16::splat(0x53a2_2864));
    x.reverse_bits()
}

/// Points of a dimension of the Sobol' sequence.
#[inline(always)]
fn point_of(index: U32x16, dimension: u32) -> U32x16 {
    if dimension == 0 {
        return index.reverse_bits();
    }
    let numbers = &SOBOL[dimension as usize % 4];
    let (mut sum, one, zero) = (U32x16::splat(0), U32x16::splat(1), U32x16::splat(0));
    for bit in 0..32 {
        let all = zero - ((index >> bit) & one);
        sum = sum ^ (all & U32x16::splat(numbers[bit as usize]));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_single_pixels() {
        for (_, kind) in SamplerKind::ALL {
            for (left, top, sample) in [(0, 0, 0), (16, 3, 1), (624, 359, 77), (70_000, 2, 5)] {
                let (mut x, mut y) = ([0; LANES], [0; LANES]);
                for i in 0..LANES {
                    (x[i], y[i]) = (left + i as u32, top + 7 * (i as u32 % 3));
                }
                let samplers = Sampler16::at(kind, 9, x, y, 640, sample);
                for dimension in [0, 1, 2, 3, 4, 14, 1 << 24, (1 << 24) + 3] {
                    let numbers = samplers.get_1d(dimension);
                    let mut singles = [samplers.lane(0); LANES];
                    for i in 0..LANES {
                        let one = Sampler::at(kind, 9, (x[i], y[i]), 640, sample);
                        assert_eq!(numbers.0[i], one.get_1d(dimension), "{kind:?} {dimension}");
                        assert_eq!(samplers.lane(i), one);
                        singles[i] = one;
                    }
                    assert_eq!(Sampler16::of(&singles).get_1d(dimension), numbers);
                }
            }
        }
    }
}
