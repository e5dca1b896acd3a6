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
    lanes::{LANES, greater, load, store},
    neighbourhood::Neighbourhood,
    scratch::{BAND, MARGIN, band_rows, fit},
    taa::check_jitter,
    texels::{Texel, Texels, fold},
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
    columns: Vec<Place>,
    rows: Vec<Place>,
    /// Luma, chromas and weight.
    now: Texels,
    before: Texels,
}

/// What the frame is at rendered pixels, with one more pixel around, and another one to the right.
#[derive(Clone, Debug, Default)]
struct Packed {
    /// Luma, chromas, and whether the surface was found in the frame before.
    colour: Texels,
    /// Mean of the 3×3 pixels around, and the motion to the right.
    mean: Texels,
    /// Their deviation, and the motion down.
    deviation: Texels,
}

/// Where an output pixel is among the rendered ones, along an axis.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// The rendered pixel before the one whose sample is nearest, counted from the one around the picture.
    first: usize,
    /// Weights of three samples, under an output pixel's kernel and under a rendered pixel's; then zero.
    narrow: [f32; 4],
    wide: [f32; 4],
    /// Sums of the weights.
    totals: [f32; 2],
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
            columns: Vec::new(),
            rows: Vec::new(),
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
        place(&mut self.columns, small.0, size.0, jitter.x, settings.radius);
        place(&mut self.rows, small.1, size.1, jitter.y, settings.radius);
        let scale =
            Vec2::new(size.0 as f32 / small.0.max(1) as f32, size.1 as f32 / small.1.max(1) as f32);
        // As much as so many frames bring.
        let longest = settings.longest / (scale.x * scale.y);
        let UpscaleSettings { deviations, dimming, .. } = *settings;
        let blend = Blend { deviations, longest, dimming };
        let (isa, packed, before) = (self.isa, &self.packed, &self.before);
        let (columns, rows) = (&self.columns, &self.rows);
        let [r, g, b] = &mut out.channels;
        let bands = band_rows(r).zip(band_rows(g)).zip(band_rows(b)).zip(self.now.bands_mut());
        bands.enumerate().for_each(|(i, (((r, g), b), now))| {
            let (top, out) = (i * BAND, [r, g, b]);
            isa.dispatch(Resolve { packed, before, columns, rows, scale, blend, top, out, now });
        });
        Ok(())
    }
}

/// Finds the output pixels of an axis among the rendered ones.
fn place(places: &mut Vec<Place>, small: u32, size: u32, jitter: f32, radius: f32) {
    let step = f64::from(small) / f64::from(size);
    let radius = radius * step as f32;
    places.clear();
    places.extend((0..size).map(|x| {
        // In rendered pixels from the first sample.
        let at = ((f64::from(x) + 0.5) * step - 0.5 - f64::from(jitter)) as f32;
        let nearest = at.round().clamp(0.0, small as f32 - 1.0);
        let weights = |radius: f32| {
            [-1.0, 0.0, 1.0, 2.0].map(|i| {
                let sample = nearest + i;
                let inside = i < 2.0 && sample >= 0.0 && sample < small as f32;
                if inside { bell(sample - at, radius) } else { 0.0 }
            })
        };
        let mut wide = weights(1.2);
        wide[1] = wide[1].max(0.01);
        let narrow = weights(radius);
        let totals = [narrow.iter().sum(), wide.iter().sum()];
        Place { first: nearest as usize, narrow, wide, totals }
    }));
}

impl Packed {
    fn fill(&mut self, isa: IsaLevel, frame: &Neighbourhood, taps: Option<&Plane<Taps>>) {
        let (width, height) = (frame.colour().width() as u32, frame.colour().height() as u32);
        let size = (width + 3, height + 2);
        for texels in [&mut self.colour, &mut self.mean, &mut self.deviation] {
            texels.resize(size);
        }
        let bands = self.colour.bands_mut().zip(self.mean.bands_mut());
        bands.zip(self.deviation.bands_mut()).enumerate().for_each(|(i, ((colour, mean), dev))| {
            isa.dispatch(Pack { frame, taps, top: i * BAND, out: [colour, mean, dev] });
        });
    }
}

/// Packs some rows.
struct Pack<'a> {
    frame: &'a Neighbourhood,
    taps: Option<&'a Plane<Taps>>,
    top: usize,
    out: [&'a mut [Texel]; 3],
}

impl Kernel for Pack<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let (width, height) = (self.frame.colour().width(), self.frame.colour().height());
        let stride = width + 3;
        let [colours, means, deviations] = self.out;
        let (mut mean, mut deviation) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for row in 0..colours.len() / stride {
            let y = self.top + row;
            if y == 0 || y > height {
                continue;
            }
            let y = y - 1;
            for x in (0..width).step_by(LANES) {
                let at = MARGIN + x;
                self.frame.statistics(y, at, &mut mean, &mut deviation);
                let nearest = self.frame.nearest(y, at);
                let mut own = [[0.0; LANES]; 3];
                for c in 0..3 {
                    own[c] = load(self.frame.colour().row(y, c), at);
                }
                let mut found = [1.0; LANES];
                if let Some(taps) = self.taps {
                    let taps = &taps.values()[y * taps.stride() + x..][..LANES];
                    for i in 0..LANES {
                        found[i] = if taps[i].is_some() { 1.0 } else { 0.0 };
                    }
                }
                let start = row * stride + x + 1;
                for i in 0..LANES.min(width - x) {
                    colours[start + i] = [own[0][i], own[1][i], own[2][i], found[i]];
                    let [mx, my] = self.frame.motion(nearest[i], y, at + i);
                    means[start + i] = [mean[0][i], mean[1][i], mean[2][i], mx];
                    deviations[start + i] = [deviation[0][i], deviation[1][i], deviation[2][i], my];
                }
            }
        }
    }
}

struct Resolve<'a> {
    packed: &'a Packed,
    before: &'a Texels,
    columns: &'a [Place],
    rows: &'a [Place],
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
        for c in 0..4 {
            blended.history[c] = [0.0; LANES];
        }
        let mut wide = [[0.0; LANES]; 3];
        let down = &self.rows[y];
        let width = self.before.width();
        for i in 0..LANES.min(width - x) {
            let across = &self.columns[x + i];
            let (mut near, mut around) = ([0.0; LANES], [0.0; LANES]);
            for j in 0..3 {
                let row = self.packed.colour.row(down.first + j);
                let texels = load(row.as_flattened(), 4 * across.first);
                for k in 0..LANES {
                    near[k] += down.narrow[j] * texels[k];
                    around[k] += down.wide[j] * texels[k];
                }
            }
            let (near, around) = (fold(&near, &across.narrow), fold(&around, &across.wide));
            let total = down.totals[0] * across.totals[0];
            let around_total = down.totals[1] * across.totals[1];
            let mean = self.packed.mean.row(down.first + 1)[across.first + 1];
            let deviation = self.packed.deviation.row(down.first + 1)[across.first + 1];
            let found = self.packed.colour.row(down.first + 1)[across.first + 1][3] > 0.0;
            let counts = total > 1e-4;
            let (share, around_share) = (1.0 / greater(total, 1e-4), 1.0 / around_total);
            blended.weight[i] = if counts { total } else { 0.0 };
            for c in 0..3 {
                wide[c][i] = around[c] * around_share;
                blended.now[c][i] = if counts { near[c] * share } else { wide[c][i] };
                blended.mean[c][i] = mean[c];
                blended.deviation[c][i] = deviation[c];
            }
            let px = (x + i) as f32 + mean[3] * self.scale.x;
            let py = y as f32 + deviation[3] * self.scale.y;
            if found && self.before.contains(px, py) {
                let texel = self.before.cubic(px, py);
                for c in 0..4 {
                    blended.history[c][i] = texel[c];
                }
            }
        }
        for i in 0..LANES {
            let weight = greater(blended.history[3][i], 0.0);
            let missing = greater(FIRST - weight, 0.0);
            let share = missing / (weight + missing);
            for c in 0..3 {
                let history = blended.history[c][i];
                blended.history[c][i] = history + share * (wide[c][i] - history);
            }
            blended.history[3][i] = weight + missing;
        }
    }
}
