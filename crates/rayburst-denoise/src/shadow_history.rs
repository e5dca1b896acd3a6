//! Shadows are accumulated over time, until they move.
//!
//! A shadow moves over surfaces that rest, and no motion vector tells of it. Where the history is farther
//! off what the frame's filtered shadow is around a pixel than noise explains, it counts for less: the box of
//! mean and deviation of temporal anti-aliasing (Salvi: "An Excursion in Temporal Supersampling", GDC
//! 2016), as a measure of change.

use rayburst_image::Plane;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Accumulation, Result, Taps, Temporal, checks,
    lanes::{LANES, Lanes, greater, lesser, load},
    scratch::{BAND, MARGIN, Scratch, ScratchBand, band_rows, fit, padded_row},
};

/// How a [`ShadowHistory`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowHistorySettings {
    /// How frames are averaged.
    pub accumulation: Accumulation,
    /// Deviations of the 5×5 pixels around that the history may be off their mean.
    pub deviations: f32,
    /// What it may be off besides: noise that the filter in space has left is smooth. Where it is off as much
    /// again, the history is forgotten.
    pub slack: f32,
}

impl Default for ShadowHistorySettings {
    fn default() -> Self {
        Self { accumulation: Accumulation::default(), deviations: 1.5, slack: 0.1 }
    }
}

impl ShadowHistorySettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        self.accumulation.check()?;
        checks::setting("the deviations", self.deviations, (0.0, 1e6), "from 0 to 1000000")?;
        checks::setting("the slack", self.slack, (1e-3, 1e6), "from 0.001 to 1000000")
    }
}

/// Accumulates filtered shadows, or ambient occlusion: shares between 0 and 1.
#[derive(Clone, Debug)]
pub struct ShadowHistory {
    isa: IsaLevel,
    value: Scratch,
    change: Plane,
    temporal: Temporal<1>,
}

impl ShadowHistory {
    /// Without a history, for an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        let (value, change) = (Scratch::default(), Plane::default());
        Self { isa, value, change, temporal: Temporal::new() }
    }

    /// Forgets the history: for cuts.
    pub fn reset(&mut self) {
        self.temporal.reset();
    }

    /// Takes a frame's filtered share in, and gives the accumulated one; `out` gets its size. `taps` are
    /// where surfaces were found in the frame before. After a change of size there is no history. What is
    /// not a number counts as lit.
    pub fn accumulate(
        &mut self,
        share: &Plane,
        taps: &Plane<Taps>,
        settings: &ShadowHistorySettings,
        out: &mut Plane,
    ) -> Result<()> {
        settings.check()?;
        let size = share.size();
        checks::picture(size)?;
        checks::size("the taps", taps.size(), size)?;
        fit(out, size)?;
        fit(&mut self.change, size)?;
        self.value.resize(size, 1);
        let isa = self.isa;
        self.value.bands_mut().for_each(|band| isa.dispatch(Take { share, band }));
        let (value, temporal) = (&self.value, &self.temporal);
        if temporal.size() == size {
            band_rows(&mut self.change).enumerate().for_each(|(i, out)| {
                isa.dispatch(Change { value, temporal, taps, settings, top: i * BAND, out });
            });
        }
        // The plane of numbers without those that are none.
        value.copy_to(0, out);
        let change = Some(&self.change);
        self.temporal.accumulate(taps, [&*out], [1.0], change, &settings.accumulation)?;
        for y in 0..size.1 {
            out.row_mut(y).copy_from_slice(self.temporal.row(0, y));
        }
        Ok(())
    }
}

struct Take<'a> {
    share: &'a Plane,
    band: ScratchBand<'a>,
}

impl Kernel for Take<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for y in self.band.rows() {
            let share = padded_row(self.share, y);
            let out = &mut self.band.row_mut(y, 0)[MARGIN..][..share.len()];
            for x in 0..share.len() {
                out[x] = greater(lesser(share[x], 1.0), 0.0);
            }
            self.band.extend(y);
        }
    }
}

/// How much of the history is no longer true.
struct Change<'a> {
    value: &'a Scratch,
    temporal: &'a Temporal<1>,
    taps: &'a Plane<Taps>,
    settings: &'a ShadowHistorySettings,
    top: usize,
    out: &'a mut [f32],
}

impl Kernel for Change<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let stride = self.taps.stride();
        for row in 0..self.out.len() / stride {
            let y = self.top + row;
            for x in (0..stride).step_by(LANES) {
                let [mean, deviation] = self.statistics(y, MARGIN + x);
                let taps = &self.taps.values()[y * stride + x..][..LANES];
                let mut before = mean;
                for i in 0..LANES {
                    if taps[i].is_some() {
                        before[i] = taps[i].of_channel(self.temporal.stack(), 0);
                    }
                }
                let out = &mut self.out[row * stride + x..][..LANES];
                for i in 0..LANES {
                    let room = self.settings.deviations * deviation[i] + self.settings.slack;
                    let beyond = (before[i] - mean[i]).abs() - room;
                    out[i] = lesser(greater(beyond / self.settings.slack, 0.0), 1.0);
                }
            }
        }
    }
}

impl Change<'_> {
    /// Mean and deviation of nine of the 5×5 pixels around.
    #[inline(always)]
    fn statistics(&self, y: usize, at: usize) -> [Lanes; 2] {
        let mut sum = [0.0; LANES];
        let mut squares = [0.0; LANES];
        for j in 0..3 {
            let row = self.value.near_row(y as isize + 2 * j - 2, 0);
            for i in 0..3 {
                let near = load(row, at + 2 * i - 2);
                for lane in 0..LANES {
                    sum[lane] += near[lane];
                    squares[lane] += near[lane] * near[lane];
                }
            }
        }
        let mut deviation = [0.0; LANES];
        for lane in 0..LANES {
            sum[lane] *= 1.0 / 9.0;
            let variance = squares[lane] * (1.0 / 9.0) - sum[lane] * sum[lane];
            deviation[lane] = greater(variance, 0.0).sqrt();
        }
        [sum, deviation]
    }
}
