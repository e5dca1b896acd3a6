//! Accumulation over time: a mean that follows the surfaces of the picture, and how much samples vary.
//!
//! The first frames that see a surface are averaged with equal weights; from then on the newest sample has
//! at least a weight of `alpha`, so that what changes is seen (Schied et al.: "Spatiotemporal
//! Variance-Guided Filtering", HPG 2017, section 4.1).

use rayburst_image::Plane;
use rayburst_simd::IsaLevel;
use rayon::prelude::*;

use crate::{
    Result,
    error::check,
    reprojection::{Taps, same_size},
    stack::{BAND, BLOCK, Stack},
    temporal_kernel::Accumulate,
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
#[derive(Clone, Debug)]
pub struct Temporal<const C: usize> {
    isa: IsaLevel,
    /// C channels, then mean and variance of the measure and the length. Always finite.
    now: Stack,
    before: Stack,
}

impl<const C: usize> Temporal<C> {
    pub(crate) const MEAN: usize = C;
    pub(crate) const VARIANCE: usize = C + 1;
    pub(crate) const LENGTH: usize = C + 2;

    /// Without a history, for the best instruction set.
    pub fn new() -> Self {
        Self::with_isa(IsaLevel::detect())
    }

    /// Without a history, for an instruction set.
    pub fn with_isa(isa: IsaLevel) -> Self {
        Self { isa, now: Stack::default(), before: Stack::default() }
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
        let (isa, before, length) = (self.isa, &self.before, self.now.band_len(BAND));
        self.now.values_mut().par_chunks_mut(length).enumerate().for_each(|(band, rows)| {
            let top = band * BAND;
            isa.dispatch(Accumulate {
                taps,
                samples,
                measure,
                change,
                settings,
                before,
                top,
                rows,
            });
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

impl<const C: usize> Default for Temporal<C> {
    fn default() -> Self {
        Self::new()
    }
}
