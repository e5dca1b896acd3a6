//! The inner loops of accumulation over time.

use rayburst_image::Plane;
use rayburst_simd::{Isa, Kernel};

use crate::{
    Accumulation, LARGEST,
    reprojection::Taps,
    stack::{AHEAD, BLOCK, Lanes, Stack, lanes, prefetch},
    temporal::Temporal,
    variance::blend_variance,
};

/// Some rows of a [`Temporal`].
pub(crate) struct Accumulate<'a, const C: usize> {
    pub(crate) taps: &'a Plane<Taps>,
    pub(crate) samples: [&'a Plane; C],
    pub(crate) measure: [f32; C],
    pub(crate) change: Option<&'a Plane>,
    pub(crate) settings: &'a Accumulation,
    /// What the frame before knew.
    pub(crate) before: &'a Stack,
    /// The number of the first row.
    pub(crate) top: usize,
    /// The rows, laid out like those of `before`.
    pub(crate) rows: &'a mut [f32],
}

/// What is known of a block of pixels.
struct Block<const C: usize> {
    values: [Lanes; C],
    mean: Lanes,
    variance: Lanes,
    length: Lanes,
}

impl<const C: usize> Kernel for Accumulate<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        let rows = std::mem::take(&mut self.rows);
        let (margin, stride) = (self.before.margin(), self.before.stride());
        let (width, height) = (self.before.size().0 as usize, self.before.size().1);
        for (y, rows) in (self.top..).zip(rows.chunks_exact_mut(self.before.band_len(1))) {
            for x in (0..width).step_by(BLOCK) {
                let ahead = margin + x + AHEAD;
                let below = self.before.rows((y as u32 + 1).min(height - 1));
                prefetch(isa, below, ahead, stride, C + 3);
                prefetch(isa, rows, ahead, stride, C + 3);
                let at = y * self.taps.stride() + x + AHEAD;
                for plane in self.samples {
                    prefetch(isa, plane.values(), at, 0, 1);
                }
                let block = self.accumulate(y * self.taps.stride() + x);
                let mut store = |channel: usize, values: &Lanes| {
                    rows[channel * stride + margin + x..][..BLOCK].copy_from_slice(values);
                };
                for c in 0..C {
                    store(c, &block.values[c]);
                }
                store(Temporal::<C>::MEAN, &block.mean);
                store(Temporal::<C>::VARIANCE, &block.variance);
                store(Temporal::<C>::LENGTH, &block.length);
            }
        }
    }
}

impl<const C: usize> Accumulate<'_, C> {
    /// Takes in the samples from an index of their planes on.
    #[inline(always)]
    fn accumulate(&self, at: usize) -> Block<C> {
        let mut block = self.reprojected(at);
        let none = [0.0; BLOCK];
        let change = self.change.map_or(&none, |plane| lanes(plane.values(), at));
        let samples = self.samples.map(|plane| lanes(plane.values(), at));
        let Accumulation { alpha, measure_alpha, longest } = *self.settings;
        let mut weight = [0.0; BLOCK];
        for i in 0..BLOCK {
            let mut is_finite = true;
            let mut sum = 0.0;
            for c in 0..C {
                is_finite &= samples[c][i].abs() <= f32::MAX;
                sum += self.measure[c] * samples[c][i].clamp(-LARGEST, LARGEST);
            }
            // Where the change is NaN nothing is known.
            let known = if change[i] < 1.0 { 1.0 - change[i].max(0.0) } else { 0.0 };
            let before = block.length[i] * known;
            let length = (before + 1.0).min(longest);
            let least = 1.0 / length;
            let newest = (1.0 - (1.0 - alpha) * known).max(least).min(1.0);
            weight[i] = if is_finite { newest } else { 0.0 };
            block.length[i] = if is_finite { length } else { before };
            let newest = (1.0 - (1.0 - measure_alpha) * known).max(least).min(1.0);
            let (mean, variance) = blend_variance(block.mean[i], block.variance[i], sum, newest);
            block.mean[i] = if is_finite { mean } else { block.mean[i] };
            block.variance[i] = if is_finite { variance } else { block.variance[i] };
        }
        for c in 0..C {
            for i in 0..BLOCK {
                let value = block.values[c][i];
                let sample = samples[c][i].clamp(-LARGEST, LARGEST);
                // Exact where all of the weight is the sample's, however large the history is.
                let newest = (1.0 - weight[i]) * value + weight[i] * sample;
                block.values[c][i] = if weight[i] > 0.0 { newest } else { value };
            }
        }
        block
    }

    /// What the frame before knew of the pixels; zero without a history.
    #[inline(always)]
    fn reprojected(&self, at: usize) -> Block<C> {
        let taps: &[Taps; BLOCK] =
            self.taps.values()[at..at + BLOCK].first_chunk().expect("a block");
        let mut block = Block {
            values: [[0.0; BLOCK]; C],
            mean: [0.0; BLOCK],
            variance: [0.0; BLOCK],
            length: [0.0; BLOCK],
        };
        match together(taps) {
            Together::No => {
                for (i, taps) in taps.iter().enumerate().filter(|(_, taps)| taps.is_some()) {
                    for c in 0..C {
                        block.values[c][i] = taps.of_channel(self.before, c);
                    }
                    block.mean[i] = taps.of_channel(self.before, Temporal::<C>::MEAN);
                    block.variance[i] = taps.of_channel(self.before, Temporal::<C>::VARIANCE);
                    block.length[i] = taps.of_channel(self.before, Temporal::<C>::LENGTH);
                }
            }
            Together::At(x, y) => {
                let mut weights = [[0.0; BLOCK]; 4];
                for i in 0..BLOCK {
                    for tap in 0..4 {
                        weights[tap][i] = taps[i].weights[tap];
                    }
                }
                for c in 0..C {
                    self.average(c, x, y, &weights, &mut block.values[c]);
                }
                self.average(Temporal::<C>::MEAN, x, y, &weights, &mut block.mean);
                self.average(Temporal::<C>::VARIANCE, x, y, &weights, &mut block.variance);
                self.average(Temporal::<C>::LENGTH, x, y, &weights, &mut block.length);
            }
            Together::Nowhere => {}
        }
        block
    }

    /// The weighted average of the four blocks at a place of a channel.
    #[inline(always)]
    fn average(&self, channel: usize, x: usize, y: u32, weights: &[Lanes; 4], to: &mut Lanes) {
        let last = self.before.size().1 - 1;
        let x = self.before.margin() + x;
        let upper = self.before.padded_row(channel, y.min(last));
        let lower = self.before.padded_row(channel, (y + 1).min(last));
        let (a, b) = (lanes(upper, x), lanes(upper, x + 1));
        let (c, d) = (lanes(lower, x), lanes(lower, x + 1));
        for i in 0..BLOCK {
            to[i] = (weights[0][i] * a[i] + weights[1][i] * b[i])
                + (weights[2][i] * c[i] + weights[3][i] * d[i]);
        }
    }
}

/// Where the histories of a block of pixels are.
enum Together {
    /// There are none.
    Nowhere,
    /// Side by side like the pixels, the first one here.
    At(usize, u32),
    /// In several places.
    No,
}

#[inline(always)]
fn together(taps: &[Taps; BLOCK]) -> Together {
    let Some(first) = taps.iter().position(Taps::is_some) else { return Together::Nowhere };
    let (x, y) = (taps[first].x.wrapping_sub(first as u32), taps[first].y);
    let mut apart = false;
    for i in 0..BLOCK {
        let is_next = taps[i].x == x.wrapping_add(i as u32) && taps[i].y == y;
        apart |= taps[i].is_some() && !is_next;
    }
    if apart || taps[first].x < first as u32 { Together::No } else { Together::At(x as usize, y) }
}
