//! Ordered dither between the two palette entries that a colour lies between.
//!
//! After Yliluoma ("Arbitrary-palette positional dithering", 2011): the entry nearest to the colour,
//! and the one with which it mixes best, counting the error of the mixture and how rough it looks.
//! Which of them is shown depends on their shares and on Bayer's 8 × 8 threshold of the pixel
//! (Bayer 1973): the strength follows the palette, and nothing moves while the colour stays.

use super::palette::{TRANSPARENT, WEIGHTS};
use crate::Rgb8Image;

pub(super) struct Ditherer<'a> {
    palette: &'a [[u8; 3]; 256],
    /// For each colour of 6 bits a channel: nearest entry, other entry, share of the other in
    /// 1/64; the share is `UNKNOWN` until it is needed.
    choices: Vec<[u8; 3]>,
}

const UNKNOWN: u8 = 255;

/// What a mixture's variance costs, relative to the error of its mean.
const ROUGHNESS: f32 = 0.05;

impl<'a> Ditherer<'a> {
    pub(super) fn new(palette: &'a [[u8; 3]; 256]) -> Self {
        Self { palette, choices: vec![[0, 0, UNKNOWN]; 1 << 18] }
    }

    /// The palette index of each pixel.
    pub(super) fn indices(&mut self, picture: &Rgb8Image) -> Vec<u8> {
        let width = picture.width as usize;
        let pixels = picture.data.as_chunks::<3>().0;
        let index = |(i, &pixel): (usize, &[u8; 3])| {
            let [first, second, share] = self.choice(pixel);
            if threshold(i % width, i / width) < share { second } else { first }
        };
        pixels.iter().enumerate().map(index).collect()
    }

    fn choice(&mut self, pixel: [u8; 3]) -> [u8; 3] {
        let [r, g, b] = pixel.map(|v| usize::from(v >> 2));
        let at = r << 12 | g << 6 | b;
        if self.choices[at][2] == UNKNOWN {
            // The cell's middle, spread so that black and white stay pure.
            self.choices[at] = self.choose([r, g, b].map(|v| v as f32 * (255.0 / 63.0)));
        }
        self.choices[at]
    }

    fn choose(&self, colour: [f32; 3]) -> [u8; 3] {
        let entries = &self.palette[..usize::from(TRANSPARENT)];
        let difference = |entry: &[u8; 3]| -> [f32; 3] {
            std::array::from_fn(|i| (f32::from(entry[i]) - colour[i]) * WEIGHTS[i].sqrt())
        };
        let nearest = (0..entries.len())
            .map(|i| (square(difference(&entries[i])), i))
            .reduce(|a, b| if b.0 < a.0 { b } else { a });
        let Some((alone, first)) = nearest else { return [0; 3] };
        let near = difference(&entries[first]);
        let (mut best, mut choice) = (alone, [first as u8, first as u8, 0]);
        for (i, entry) in entries.iter().enumerate() {
            let far = difference(entry);
            let step: [f32; 3] = std::array::from_fn(|i| far[i] - near[i]);
            let length = square(step);
            if length == 0.0 {
                continue;
            }
            let along: f32 = (0..3).map(|i| -near[i] * step[i]).sum();
            let share = (along / length).clamp(0.0, 1.0);
            let left = square(std::array::from_fn(|i| near[i] + share * step[i]));
            let cost = left + ROUGHNESS * length * share * (1.0 - share);
            if cost < best {
                (best, choice) = (cost, [first as u8, i as u8, (share * 64.0 + 0.5) as u8]);
            }
        }
        choice
    }
}

fn square(v: [f32; 3]) -> f32 {
    v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
}

/// Bayer's matrix: the bits of x ^ y and y, reversed and interleaved; 0 to 63.
fn threshold(x: usize, y: usize) -> u8 {
    let (a, b) = (x ^ y, y);
    let bit = |v: usize, i: usize| (v >> i & 1) as u8;
    (0..3).fold(0, |t, i| t << 2 | bit(a, i) << 1 | bit(b, i))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_threshold_occurs_once_in_a_square() {
        let mut seen = [0; 64];
        for i in 0..64 {
            seen[usize::from(threshold(i % 8, i / 8))] += 1;
        }
        assert_eq!(seen, [1; 64]);
    }

    #[test]
    fn two_entries_mix_to_the_colour_between() {
        let mut palette = [[0; 3]; 256];
        palette[1] = [200, 200, 200];
        let mut ditherer = Ditherer::new(&palette);
        for (grey, share) in [(0u8, 0.0), (48, 0.25), (100, 0.5), (152, 0.75), (200, 1.0)] {
            let flat = Rgb8Image { width: 8, height: 8, data: vec![grey; 192] };
            let ones = ditherer.indices(&flat).iter().filter(|&&i| i == 1).count() as f32;
            assert!((ones / 64.0 - share).abs() < 0.04, "{grey}: {ones}");
        }
    }
}
