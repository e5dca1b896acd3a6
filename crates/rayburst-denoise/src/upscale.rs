//! Temporal upscaling: frames of fewer pixels, whose rays go through other points each time, are gathered
//! in a history of full size (Yang, Liu, Salvi: "A Survey of Temporal Antialiasing Techniques",
//! Eurographics 2020, section 5; Karis: "High Quality Temporal Supersampling", SIGGRAPH 2014 courses).
//!
//! A sample counts for an output pixel by its distance to the pixel's centre, under a kernel of an output
//! pixel's width: over the frames samples fall everywhere, and a still picture converges to what a frame of
//! full size converges to. Pixels that have seen nothing yet show the frame under a kernel of a rendered
//! pixel's width.

use glam::Vec2;
use rayburst_image::{Plane, Plane3};
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Guides, Result, Taps, checks,
    clip::{Blend, Blended, bell, from_ycocg},
    lanes::{LANES, Lanes, greater, load, store},
    neighbourhood::{AWAY, Neighbourhood},
    scratch::{BAND, MARGIN, band_rows, fit},
    taa::check_jitter,
    texels::{Texel, Texels},
};

/// How [`TemporalUpscaling`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpscaleSettings {
    /// Deviations of the 3×3 rendered pixels around that the history may be off their mean.
    pub deviations: f32,
    /// The most frames that a history counts for.
    pub longest: f32,
    /// Radius of the kernel that samples count by, output pixels.
    pub radius: f32,
    /// Weights of colours are divided by one plus this times their luma: the reciprocal of what is shown as
    /// white, or 0 for a plain mean.
    pub dimming: f32,
}

impl Default for UpscaleSettings {
    fn default() -> Self {
        Self { deviations: 2.0, longest: 64.0, radius: 1.0, dimming: 0.0 }
    }
}

impl UpscaleSettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        checks::setting("the deviations", self.deviations, (0.0, 1e6), "from 0 to 1000000")?;
        checks::setting("the longest history", self.longest, (0.0, 65536.0), "from 0 to 65536")?;
        checks::setting("the radius", self.radius, (0.6, 1.5), "from 0.6 to 1.5")?;
        checks::setting("the dimming", self.dimming, (0.0, 1e12), "not negative")
    }
}

/// Gathers frames of fewer pixels in a picture of full size.
#[derive(Clone, Debug)]
pub struct TemporalUpscaling {
    isa: IsaLevel,
    frame: Neighbourhood,
    packed: Packed,
    columns: Places,
    rows: Places,
    /// Luma, chromas and weight.
    now: Texels,
    before: Texels,
}

/// What the frame is around rendered pixels.
#[derive(Clone, Debug, Default)]
struct Packed {
    /// Mean of the 3×3 pixels around, and the motion to the right.
    mean: Texels,
    /// Their deviation, and the motion down.
    deviation: Texels,
}

/// Where output pixels are among the rendered ones, along an axis; as many as whole vectors hold.
#[derive(Clone, Debug, Default)]
struct Places {
    /// The rendered pixel whose sample is nearest.
    nearest: Vec<usize>,
    /// Weights of its sample and of those on both sides, under an output pixel's kernel and under a rendered
    /// pixel's.
    narrow: [Vec<f32>; 3],
    wide: [Vec<f32>; 3],
}

impl Places {
    /// Finds the output pixels of an axis.
    fn find(&mut self, small: u32, size: u32, jitter: f32, radius: f32) {
        let step = f64::from(small) / f64::from(size);
        self.nearest.clear();
        for weights in self.narrow.iter_mut().chain(&mut self.wide) {
            weights.clear();
        }
        for x in 0..(size as usize).next_multiple_of(LANES) {
            // In rendered pixels from the first sample.
            let at =
                ((x.min(size as usize - 1) as f64 + 0.5) * step - 0.5 - f64::from(jitter)) as f32;
            let nearest = at.round().clamp(0.0, small as f32 - 1.0);
            self.nearest.push(nearest as usize);
            for k in 0..3 {
                let sample = nearest + k as f32 - 1.0;
                let inside = sample >= 0.0 && sample < small as f32;
                let weight = |radius| if inside { bell(sample - at, radius) } else { 0.0 };
                self.narrow[k].push(weight(radius * step as f32));
                // The nearest one counts in any case.
                self.wide[k].push(weight(1.2).max(if k == 1 { 0.01 } else { 0.0 }));
            }
        }
    }
}

/// What a pixel that has seen nothing counts the frame for.
const FIRST: f32 = 0.3;

impl TemporalUpscaling {
    /// Without a history, for an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        Self {
            isa,
            frame: Neighbourhood::default(),
            packed: Packed::default(),
            columns: Places::default(),
            rows: Places::default(),
            now: Texels::default(),
            before: Texels::default(),
        }
    }

    /// Forgets the history: for cuts.
    pub fn reset(&mut self) {
        self.now.fill([0.0; 4]);
    }

    /// Takes a frame of radiance in, and gives the picture in another size, which is from 1 to 2 times as
    /// wide and as high (a pixel more or less does not matter).
    ///
    /// Guides, `taps` and `jitter` are those of the frame, in its pixels: `jitter` is where rays go through
    /// pixels, relative to their centres; `taps`, if any, are where surfaces were found in the frame before,
    /// and where none was there is no history. After a change of size there is none, either. What is not a
    /// number, or negative, counts as black.
    pub fn resolve(
        &mut self,
        colour: &Plane3,
        guides: &Guides<'_>,
        jitter: Vec2,
        taps: Option<&Plane<Taps>>,
        settings: &UpscaleSettings,
        size: (u32, u32),
        out: &mut Plane3,
    ) -> Result<()> {
        settings.check()?;
        check_jitter(jitter)?;
        checks::picture(size)?;
        let small = guides.size();
        if let Some(taps) = taps {
            checks::size("the taps", taps.size(), small)?;
        }
        for (found, wanted) in [(small.0, size.0), (small.1, size.1)] {
            if found > wanted || wanted > 2 * found + 1 {
                let scale = f64::from(found) / f64::from(wanted);
                let range = "from 0.5 to 1";
                return Err(crate::DenoiseError::Setting {
                    name: "the scale",
                    value: scale,
                    range,
                });
            }
        }
        self.frame.take(self.isa, colour, guides)?;
        for channel in &mut out.channels {
            fit(channel, size)?;
        }
        std::mem::swap(&mut self.now, &mut self.before);
        if self.before.resize(size) {
            self.before.fill([0.0; 4]);
        }
        self.now.resize(size);
        self.packed.fill(self.isa, &self.frame, taps);
        self.columns.find(small.0, size.0, jitter.x, settings.radius);
        self.rows.find(small.1, size.1, jitter.y, settings.radius);
        let scale =
            Vec2::new(size.0 as f32 / small.0.max(1) as f32, size.1 as f32 / small.1.max(1) as f32);
        // As much as so many frames bring.
        let longest = settings.longest / (scale.x * scale.y);
        let UpscaleSettings { deviations, dimming, .. } = *settings;
        let blend = Blend { deviations, longest, dimming };
        let (isa, frame, packed, before) = (self.isa, &self.frame, &self.packed, &self.before);
        let (columns, rows) = (&self.columns, &self.rows);
        let [r, g, b] = &mut out.channels;
        let bands = band_rows(r).zip(band_rows(g)).zip(band_rows(b)).zip(self.now.bands_mut());
        bands.enumerate().for_each(|(i, (((r, g), b), now))| {
            let (top, out) = (i * BAND, [r, g, b]);
            isa.dispatch(Resolve {
                frame,
                packed,
                before,
                columns,
                rows,
                scale,
                blend,
                top,
                out,
                now,
            });
        });
        Ok(())
    }
}

impl Packed {
    fn fill(&mut self, isa: IsaLevel, frame: &Neighbourhood, taps: Option<&Plane<Taps>>) {
        let size = (frame.colour().width() as u32, frame.colour().height() as u32);
        self.mean.resize(size);
        self.deviation.resize(size);
        let bands = self.mean.bands_mut().zip(self.deviation.bands_mut());
        bands.enumerate().for_each(|(i, (mean, deviation))| {
            isa.dispatch(Pack { frame, taps, top: i * BAND, out: [mean, deviation] });
        });
    }
}

/// Packs some rows.
struct Pack<'a> {
    frame: &'a Neighbourhood,
    taps: Option<&'a Plane<Taps>>,
    top: usize,
    out: [&'a mut [Texel]; 2],
}

impl Kernel for Pack<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let width = self.frame.colour().width();
        let [means, deviations] = self.out;
        let (mut mean, mut deviation) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for row in 0..means.len() / width {
            let y = self.top + row;
            for x in (0..width).step_by(LANES) {
                let at = MARGIN + x;
                self.frame.statistics(y, at, &mut mean, &mut deviation);
                let nearest = self.frame.nearest(y, at);
                let mut found = [true; LANES];
                if let Some(taps) = self.taps {
                    let taps = &taps.values()[y * taps.stride() + x..][..LANES];
                    for i in 0..LANES {
                        found[i] = taps[i].is_some();
                    }
                }
                let start = row * width + x;
                for i in 0..LANES.min(width - x) {
                    let [mx, my] = self.frame.motion(nearest[i], y, at + i);
                    // What was not seen before was out of the picture.
                    let mx = if found[i] { mx } else { AWAY };
                    means[start + i] = [mean[0][i], mean[1][i], mean[2][i], mx];
                    deviations[start + i] = [deviation[0][i], deviation[1][i], deviation[2][i], my];
                }
            }
        }
    }
}

struct Resolve<'a> {
    frame: &'a Neighbourhood,
    packed: &'a Packed,
    before: &'a Texels,
    columns: &'a Places,
    rows: &'a Places,
    scale: Vec2,
    blend: Blend,
    top: usize,
    out: [&'a mut [f32]; 3],
    now: &'a mut [Texel],
}

impl Kernel for Resolve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let width = self.before.width();
        let stride = self.out[0].len() / (self.now.len() / width);
        let mut gathered = Blended::EMPTY;
        let mut blended = [[0.0; LANES]; 4];
        for row in 0..self.now.len() / width {
            for x in (0..width).step_by(LANES) {
                self.gather(self.top + row, x, &mut gathered);
                gathered.blend(&self.blend, &mut blended);
                let mut colour = [[0.0; LANES]; 3];
                for i in 0..LANES {
                    let rgb = from_ycocg([blended[0][i], blended[1][i], blended[2][i]]);
                    for c in 0..3 {
                        colour[c][i] = greater(rgb[c], 0.0);
                    }
                }
                for c in 0..3 {
                    store(self.out[c], row * stride + x, &colour[c]);
                }
                let texels = &mut self.now[row * width..][..width];
                for i in 0..LANES.min(width - x) {
                    texels[x + i] = [blended[0][i], blended[1][i], blended[2][i], blended[3][i]];
                }
            }
        }
    }
}

impl Resolve<'_> {
    /// What is known of sixteen output pixels.
    #[inline(always)]
    fn gather(&self, y: usize, x: usize, blended: &mut Blended) {
        let mut wide = [[0.0; LANES]; 3];
        let totals = self.samples(y, x, &mut blended.now, &mut wide);
        let (means, deviations) = (
            self.packed.mean.row(self.rows.nearest[y]),
            self.packed.deviation.row(self.rows.nearest[y]),
        );
        let columns = &self.columns.nearest[x..x + LANES];
        let mut at = [[0.0; LANES]; 2];
        for i in 0..LANES {
            let (mean, deviation) = (means[columns[i]], deviations[columns[i]]);
            for c in 0..3 {
                blended.mean[c][i] = mean[c];
                blended.deviation[c][i] = deviation[c];
            }
            at[0][i] = (x + i) as f32 + mean[3] * self.scale.x;
            at[1][i] = y as f32 + deviation[3] * self.scale.y;
        }
        for c in 0..4 {
            blended.history[c] = [0.0; LANES];
        }
        for i in 0..LANES.min(self.before.width() - x) {
            if self.before.contains(at[0][i], at[1][i]) {
                let texel = self.before.cubic(at[0][i], at[1][i]);
                for c in 0..4 {
                    blended.history[c][i] = texel[c];
                }
            }
        }
        for i in 0..LANES {
            let counts = totals[0][i] > 1e-4;
            blended.weight[i] = if counts { totals[0][i] } else { 0.0 };
            let share = 1.0 / greater(totals[0][i], 1e-4);
            let wide_share = 1.0 / totals[1][i];
            let weight = greater(blended.history[3][i], 0.0);
            let missing = greater(FIRST - weight, 0.0);
            let first = missing / (weight + missing);
            for c in 0..3 {
                let (near, around) = (blended.now[c][i] * share, wide[c][i] * wide_share);
                blended.now[c][i] = if counts { near } else { around };
                let history = blended.history[c][i];
                blended.history[c][i] = history + first * (around - history);
            }
            blended.history[3][i] = weight + missing;
        }
    }

    /// The frame's samples around sixteen output pixels, added up under both kernels; returns the sums of the
    /// weights. First down the columns, then along the rows.
    #[inline(always)]
    fn samples(
        &self,
        y: usize,
        x: usize,
        near: &mut [Lanes; 3],
        around: &mut [Lanes; 3],
    ) -> [Lanes; 2] {
        let (columns, rows) = (self.columns, self.rows);
        let nearest = &columns.nearest[x..x + LANES];
        let first = nearest[0];
        let mut weights = [[0.0; LANES]; 6];
        for k in 0..3 {
            weights[k] = load(&columns.narrow[k], x);
            weights[3 + k] = load(&columns.wide[k], x);
        }
        for c in 0..3 {
            // Output pixels are no wider than rendered ones: all samples are in two vectors.
            let mut narrow = [0.0; 2 * LANES];
            let mut wide = [0.0; 2 * LANES];
            for j in 0..3 {
                let row = self.frame.colour().near_row((rows.nearest[y] + j) as isize - 1, c);
                let row = &row[MARGIN + first - 1..][..2 * LANES];
                let (n, w) = (rows.narrow[j][y], rows.wide[j][y]);
                for i in 0..2 * LANES {
                    narrow[i] += n * row[i];
                    wide[i] += w * row[i];
                }
            }
            near[c] = [0.0; LANES];
            around[c] = [0.0; LANES];
            for k in 0..3 {
                let mut picked = [[0.0; LANES]; 2];
                for i in 0..LANES {
                    let from = (nearest[i] - first + k) % (2 * LANES);
                    picked[0][i] = narrow[from];
                    picked[1][i] = wide[from];
                }
                for i in 0..LANES {
                    near[c][i] += weights[k][i] * picked[0][i];
                    around[c][i] += weights[3 + k][i] * picked[1][i];
                }
            }
        }
        let down = |weights: &[Vec<f32>; 3]| weights[0][y] + weights[1][y] + weights[2][y];
        let (narrow, wide) = (down(&rows.narrow), down(&rows.wide));
        let mut totals = [[0.0; LANES]; 2];
        for i in 0..LANES {
            totals[0][i] = narrow * (weights[0][i] + weights[1][i] + weights[2][i]);
            totals[1][i] = wide * (weights[3][i] + weights[4][i] + weights[5][i]);
        }
        totals
    }
}
