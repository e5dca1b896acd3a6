//! Pixels that are far brighter than all around are dimmed before a history learns of them.
//!
//! A pixel's luminance is limited by the mean and the deviation of its neighbours, itself left out; the
//! brightest neighbour counts no more than the second, so that two such pixels side by side do not vouch
//! for each other (a Winsorised mean: Tukey, "The Future of Data Analysis", 1962). Neighbours are the 5×5
//! pixels around and 5×5 at three times the distance, so that light that few pixels found is not taken for
//! a mistake.
//!
//! What is lost is bounded: of noise with deviation σ, a limit of k deviations over the mean cuts off at
//! most (√(1 + k²) − k)/2 · σ on average, whatever its distribution (Scarf, "A Min-Max Solution of an
//! Inventory Problem", 1958). With k = 4 that is 6.2 % of σ.

use rayburst_image::Plane3;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Result, checks,
    lanes::{LANES, Lanes, greater, lesser, light, load, luminance, store},
    scratch::{BAND, MARGIN, Scratch, ScratchBand, band_rows, fit, padded_row},
};

/// How a [`FireflyFilter`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FireflySettings {
    /// Pixels from one neighbour to the next: 1, or 2 for a signal that blocks of 2×2 pixels share.
    pub spacing: u32,
    /// Deviations over the mean of the neighbours that a pixel may be.
    pub deviations: f32,
}

impl Default for FireflySettings {
    fn default() -> Self {
        Self { spacing: 1, deviations: 4.0 }
    }
}

impl FireflySettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        checks::setting("the spacing", self.spacing as f32, (1.0, 2.0), "1 or 2")?;
        checks::setting("the deviations", self.deviations, (0.0, 1e3), "from 0 to 1000")
    }

    /// The most that is lost of noise, on average, as a share of its deviation.
    pub fn loss(&self) -> f32 {
        let k = self.deviations;
        0.5 / ((1.0 + k * k).sqrt() + k)
    }
}

/// Dims pixels that are far brighter than their neighbours.
#[derive(Clone, Debug)]
pub struct FireflyFilter {
    isa: IsaLevel,
    luminance: Scratch,
}

impl FireflyFilter {
    /// A filter for an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        Self { isa, luminance: Scratch::default() }
    }

    /// Filters a picture of radiance into another one, which gets its size. What is not a number, or
    /// negative, counts as black.
    pub fn filter(
        &mut self,
        colour: &Plane3,
        settings: &FireflySettings,
        out: &mut Plane3,
    ) -> Result<()> {
        settings.check()?;
        let size = colour.size();
        checks::picture(size)?;
        for channel in &colour.channels {
            checks::size("a channel", channel.size(), size)?;
        }
        for channel in &mut out.channels {
            fit(channel, size)?;
        }
        self.luminance.resize(size, 1);
        let isa = self.isa;
        self.luminance.bands_mut().for_each(|band| isa.dispatch(Luminance { colour, band }));
        let luminance = &self.luminance;
        let [r, g, b] = &mut out.channels;
        let rows = band_rows(r).zip(band_rows(g)).zip(band_rows(b));
        rows.enumerate().for_each(|(i, ((r, g), b))| {
            let limit = Limit { colour, luminance, settings, top: i * BAND, out: [r, g, b] };
            isa.dispatch(limit);
        });
        Ok(())
    }
}

/// Fills in the luminance.
struct Luminance<'a> {
    colour: &'a Plane3,
    band: ScratchBand<'a>,
}

impl Kernel for Luminance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let width = self.colour.channels[0].width() as usize;
        for y in self.band.rows() {
            let r = padded_row(&self.colour.channels[0], y);
            let g = padded_row(&self.colour.channels[1], y);
            let b = padded_row(&self.colour.channels[2], y);
            let row = self.band.row_mut(y, 0);
            let out = &mut row[MARGIN..][..r.len()];
            for x in 0..out.len() {
                out[x] = luminance(light(r[x]), light(g[x]), light(b[x]));
            }
            // Mirrored, so that no pixel is its own neighbour.
            for i in 1..=REACH {
                row[MARGIN - i] = row[MARGIN + i.min(width - 1)];
                row[MARGIN + width - 1 + i] = row[MARGIN + width - 1 - i.min(width - 1)];
            }
        }
    }
}

/// How far away neighbours may be.
const REACH: usize = 12;

/// Limits the luminance of some rows.
struct Limit<'a> {
    colour: &'a Plane3,
    luminance: &'a Scratch,
    settings: &'a FireflySettings,
    top: usize,
    out: [&'a mut [f32]; 3],
}

impl Kernel for Limit<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let stride = self.colour.channels[0].stride();
        for row in 0..self.out[0].len() / stride {
            let y = self.top + row;
            let mut rows: [&[f32]; 10] = [&[]; 10];
            for i in 0..10 {
                let down = (i as isize % 5 - 2) * self.distance(i / 5) as isize;
                rows[i] = self.luminance.row(self.mirrored(y as isize + down), 0);
            }
            for x in (0..stride).step_by(LANES) {
                let limit = self.limit(&rows, MARGIN + x);
                let own = load(rows[2], MARGIN + x);
                let mut scale = [1.0; LANES];
                for i in 0..LANES {
                    scale[i] = if own[i] > limit[i] { limit[i] / own[i] } else { 1.0 };
                }
                for channel in 0..3 {
                    let mut value = load(padded_row(&self.colour.channels[channel], y), x);
                    for i in 0..LANES {
                        value[i] = light(value[i]) * scale[i];
                    }
                    store(self.out[channel], row * stride + x, &value);
                }
            }
        }
    }
}

impl Limit<'_> {
    /// Pixels from one neighbour to the next, of those near and those far.
    #[inline(always)]
    fn distance(&self, ring: usize) -> usize {
        self.settings.spacing as usize * [1, 3][ring]
    }

    /// A row, or the one as far within the picture as it is beyond its end.
    #[inline(always)]
    fn mirrored(&self, y: isize) -> usize {
        let last = self.luminance.height() as isize - 1;
        let inside = if y > last { 2 * last - y } else { y.abs() };
        inside.clamp(0, last) as usize
    }

    /// The most luminance that pixels may have.
    #[inline(always)]
    fn limit(&self, rows: &[&[f32]; 10], at: usize) -> Lanes {
        let mut first = [0.0f32; LANES];
        let mut second = [0.0f32; LANES];
        for j in 0..10 {
            let distance = self.distance(j / 5);
            for i in 0..5 {
                if i == 2 && j % 5 == 2 {
                    continue;
                }
                let near = load(rows[j], at + i * distance - 2 * distance);
                for lane in 0..LANES {
                    second[lane] = greater(second[lane], lesser(first[lane], near[lane]));
                    first[lane] = greater(first[lane], near[lane]);
                }
            }
        }
        // Relative to the second brightest, so that nothing cancels.
        let mut sum = [0.0f32; LANES];
        let mut squares = [0.0f32; LANES];
        for j in 0..10 {
            let distance = self.distance(j / 5);
            for i in 0..5 {
                if i == 2 && j % 5 == 2 {
                    continue;
                }
                let near = load(rows[j], at + i * distance - 2 * distance);
                for lane in 0..LANES {
                    let off = lesser(near[lane] - second[lane], 0.0);
                    sum[lane] += off;
                    squares[lane] += off * off;
                }
            }
        }
        let mut limit = [0.0f32; LANES];
        for lane in 0..LANES {
            let mean = sum[lane] / 48.0;
            let variance = greater(squares[lane] / 48.0 - mean * mean, 0.0);
            let most = second[lane] + mean + self.settings.deviations * variance.sqrt();
            limit[lane] = greater(most, 0.0);
        }
        limit
    }
}
