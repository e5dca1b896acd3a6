//! Accumulation over time: a mean that follows the surfaces of the picture, and how much samples vary.
//!
//! The first frames that see a surface are averaged with equal weights; from then on the newest sample has
//! at least a weight of `alpha`, so that what changes is seen (Schied et al.: "Spatiotemporal
//! Variance-Guided Filtering", HPG 2017, section 4.1).

use rayburst_image::Plane;
use rayon::prelude::*;

use crate::{
    Result,
    error::check,
    reprojection::{Taps, same_size},
    stack::{BAND, BLOCK, Stack},
    variance::blend_variance,
};

/// Finite samples are clamped to this magnitude, so that squares and sums of them stay finite.
pub const LARGEST: f32 = 1e16;

/// How samples are accumulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accumulation {
    /// Least weight of the newest sample: 0 (a plain mean) to 1 (no history).
    pub alpha: f32,
    /// The same for the mean and the variance of the measure.
    pub measure_alpha: f32,
    /// Most frames that a history counts for: 1 to 65536.
    pub longest: f32,
}

impl Default for Accumulation {
    fn default() -> Self {
        Self { alpha: 0.1, measure_alpha: 0.2, longest: 64.0 }
    }
}

impl Accumulation {
    /// Fails where a setting is out of range.
    pub fn check(&self) -> Result<()> {
        check("the newest sample's weight", self.alpha, 0.0..=1.0, "from 0 to 1")?;
        let name = "the newest sample's weight in the variance";
        check(name, self.measure_alpha, 0.0..=1.0, "from 0 to 1")?;
        check("the longest history", self.longest, 1.0..=65536.0, "from 1 to 65536")
    }
}

/// A history of C planes (a colour's channels, say), of the mean and the variance of a measure of them (its
/// luminance), and of how many frames it counts for.
#[derive(Clone, Debug, Default)]
pub struct Temporal<const C: usize> {
    /// C channels, then mean and variance of the measure and the length. Always finite.
    now: Stack,
    before: Stack,
}

impl<const C: usize> Temporal<C> {
    pub(crate) const MEAN: usize = C;
    pub(crate) const VARIANCE: usize = C + 1;
    pub(crate) const LENGTH: usize = C + 2;

    /// Without a history.
    pub fn new() -> Self {
        Self::default()
    }

    /// Forgets the history.
    pub fn reset(&mut self) {
        self.now.fill(0.0);
    }

    /// Takes a frame's samples in. `taps` are where its surfaces were in the frame before; the measure is
    /// the sum of the samples times its coefficients. `change`, if any, says how much of the history is no
    /// longer true: 0 (none) to 1 (all, it starts afresh).
    ///
    /// A pixel with a sample that is not finite keeps its history as it is, and has zero and a length of
    /// zero without one. Finite samples are clamped to ±[`LARGEST`]. After a change of size there is no history.
    pub fn accumulate(
        &mut self,
        taps: &Plane<Taps>,
        samples: [&Plane; C],
        measure: [f32; C],
        change: Option<&Plane>,
        settings: &Accumulation,
    ) -> Result<()> {
        settings.check()?;
        let size = taps.size();
        for plane in samples {
            same_size("a sample", plane.size(), size)?;
        }
        if let Some(change) = change {
            same_size("the change", change.size(), size)?;
        }
        if self.now.size() != size {
            self.before = Stack::new(size, C + 3, BLOCK)?;
            self.now = self.before.clone();
        }
        std::mem::swap(&mut self.now, &mut self.before);
        let (before, width) = (&self.before, size.0 as usize);
        let (margin, stride, length) = (self.now.margin(), self.now.stride(), self.now.band_len(1));
        let bands = self.now.values_mut().par_chunks_mut(length * BAND);
        bands.enumerate().for_each(|(band, rows)| {
            for (y, row) in (band * BAND..).zip(rows.chunks_mut(length)) {
                let index = y * taps.stride();
                let taps = &taps.values()[index..index + width];
                for (x, taps) in taps.iter().enumerate() {
                    let mut sample = [0.0; C];
                    for (value, plane) in sample.iter_mut().zip(samples) {
                        *value = plane.at(index + x);
                    }
                    let change = change.map_or(0.0, |plane| plane.at(index + x));
                    let pixel =
                        Pixel::before(before, taps, change).accumulate(sample, measure, settings);
                    for (channel, value) in pixel.values.into_iter().enumerate() {
                        row[channel * stride + margin + x] = value;
                    }
                    row[Self::MEAN * stride + margin + x] = pixel.mean;
                    row[Self::VARIANCE * stride + margin + x] = pixel.variance;
                    row[Self::LENGTH * stride + margin + x] = pixel.length;
                }
            }
        });
        Ok(())
    }

    /// Width and height; zero before the first frame.
    pub fn size(&self) -> (u32, u32) {
        self.now.size()
    }

    /// A row of the mean of a channel.
    pub fn row(&self, channel: usize, y: u32) -> &[f32] {
        self.now.row(channel.min(C - 1), y)
    }

    /// A row of the mean of the measure.
    pub fn mean_row(&self, y: u32) -> &[f32] {
        self.now.row(Self::MEAN, y)
    }

    /// A row of the variance of the measure of single samples (divided by n).
    pub fn variance_row(&self, y: u32) -> &[f32] {
        self.now.row(Self::VARIANCE, y)
    }

    /// A row of how many frames the history counts for, this one included.
    pub fn length_row(&self, y: u32) -> &[f32] {
        self.now.row(Self::LENGTH, y)
    }

    /// All of it: C channels, then mean, variance and length.
    pub fn stack(&self) -> &Stack {
        &self.now
    }

    /// The same, to be changed into what the next frame shall find. Values must stay finite.
    pub fn stack_mut(&mut self) -> &mut Stack {
        &mut self.now
    }
}

/// The state of a pixel.
struct Pixel<const C: usize> {
    values: [f32; C],
    mean: f32,
    variance: f32,
    length: f32,
    /// How much of it is no longer true.
    change: f32,
}

impl<const C: usize> Pixel<C> {
    /// What the frame before knew.
    #[inline(always)]
    fn before(stack: &Stack, taps: &Taps, change: f32) -> Self {
        let mut pixel = Self { values: [0.0; C], mean: 0.0, variance: 0.0, length: 0.0, change };
        // Where it is NaN nothing is known.
        pixel.change = if change.is_nan() { 1.0 } else { change.clamp(0.0, 1.0) };
        if taps.is_some() {
            for (channel, value) in pixel.values.iter_mut().enumerate() {
                *value = taps.of_channel(stack, channel);
            }
            pixel.mean = taps.of_channel(stack, Temporal::<C>::MEAN);
            pixel.variance = taps.of_channel(stack, Temporal::<C>::VARIANCE);
            pixel.length = (1.0 - pixel.change) * taps.of_channel(stack, Temporal::<C>::LENGTH);
        }
        pixel
    }

    #[inline(always)]
    fn accumulate(mut self, sample: [f32; C], measure: [f32; C], settings: &Accumulation) -> Self {
        let mut sum = 0.0;
        let mut finite = true;
        for channel in 0..C {
            let value = sample[channel];
            finite &= value.is_finite();
            sum += measure[channel] * value.clamp(-LARGEST, LARGEST);
        }
        if !finite {
            return self;
        }
        self.length = (self.length + 1.0).min(settings.longest);
        let least = 1.0 / self.length;
        let weight = |alpha: f32| (alpha + (1.0 - alpha) * self.change).max(least).min(1.0);
        let alpha = weight(settings.alpha);
        for (value, sample) in self.values.iter_mut().zip(sample) {
            *value += alpha * (sample.clamp(-LARGEST, LARGEST) - *value);
        }
        let alpha = weight(settings.measure_alpha);
        (self.mean, self.variance) = blend_variance(self.mean, self.variance, sum, alpha);
        self
    }
}
