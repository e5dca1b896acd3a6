//! Temporal gradients: how much the light on a surface has changed since the frame before.
//!
//! One pixel in every stratum of 3×3 pixels has a surface point of the frame before shaded again with the
//! same random numbers; what differs is a change and not noise. The sparse differences are made dense by an
//! edge-avoiding wavelet transform over strata (Schied, Peters, Dachsbacher: "Gradient Estimation for
//! Real-Time Adaptive Temporal Filtering", HPG 2018, sections 4.2 and 4.3).

use rayburst_image::{Plane, Plane3};
use rayburst_simd::IsaLevel;
use rayon::prelude::*;

use crate::{
    EdgeStopping, Guides, Reprojection, Result, Stack, Temporal, WaveletKernel,
    atrous::{check_levels, filter_level, margin},
    atrous_kernel::{SIGNAL, luminance},
    error::check,
    geometry,
    reprojection::same_size,
    stack::BAND,
    temporal::LARGEST,
};

/// Pixels along a side of a stratum.
pub const STRATUM: u32 = 3;

/// No pixel of the stratum was shaded again.
pub const NO_SAMPLE: u32 = u32::MAX;

/// Width and height of the planes of gradient samples of a picture.
pub fn strata((width, height): (u32, u32)) -> (u32, u32) {
    (width.div_ceil(STRATUM), height.div_ceil(STRATUM))
}

/// A signal's gradient samples, one a stratum; planes of the size that [`strata`] says.
#[derive(Clone, Copy, Debug)]
pub struct GradientSamples<'a> {
    /// Luminance of the point's shading in this frame minus that in the frame before, with the same random
    /// numbers.
    pub difference: &'a Plane,
    /// The larger one of the two luminances.
    pub largest: &'a Plane,
    /// The pixel of this frame that shows the point: x + y times the picture's width; [`NO_SAMPLE`] if
    /// there is none.
    pub pixel: &'a Plane<u32>,
}

/// How gradients become a change of 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientSettings {
    /// Levels of the transform over strata: 0 to [`crate::MOST_LEVELS`].
    pub levels: u32,
    /// What stops it; differences of luminance do not.
    pub stopping: EdgeStopping,
    /// Changes up to this count as none, and larger ones are scaled so that one remains one: 0 to 0.99.
    pub dead_zone: f32,
}

impl Default for GradientSettings {
    fn default() -> Self {
        let kernel = WaveletKernel::Binomial;
        let stopping = EdgeStopping { depth: 2.0, normal: 32.0, kernel, ..EdgeStopping::default() };
        Self { levels: 4, stopping, dead_zone: 0.0 }
    }
}

impl GradientSettings {
    /// Fails where a setting is out of range.
    pub fn check(&self) -> Result<()> {
        self.stopping.check()?;
        check_levels(self.levels)?;
        check("the dead zone of changes", self.dead_zone, 0.0..=0.99, "from 0 to 0.99")
    }
}

/// Makes dense changes of gradient samples. Keeps its working memory.
#[derive(Clone, Debug)]
pub struct Gradients {
    isa: IsaLevel,
    depth: Plane,
    normal: Plane3,
    object: Plane<u32>,
    geometry: Stack,
    signals: [Stack; 2],
    change: Plane,
}

/// A stratum's difference and the larger luminance.
type Sample = (f32, f32);

impl Gradients {
    /// Without working memory.
    pub fn new(isa: IsaLevel) -> Self {
        Self {
            isa,
            depth: Plane::default(),
            normal: Plane3::default(),
            object: Plane::default(),
            geometry: Stack::default(),
            signals: Default::default(),
            change: Plane::default(),
        }
    }

    /// How much of a signal's history is no longer true, from 0 to 1 for every pixel: the filtered
    /// difference over the filtered luminance. Strata without a sample, and samples that are not finite,
    /// count for nothing.
    pub fn reconstruct(
        &mut self,
        guides: &Guides<'_>,
        samples: &GradientSamples<'_>,
        settings: &GradientSettings,
    ) -> Result<&Plane> {
        guides.check()?;
        let size @ (width, height) = guides.size();
        let expected = strata(size);
        same_size("the differences", samples.difference.size(), expected)?;
        same_size("the largest luminances", samples.largest.size(), expected)?;
        same_size("the gradients' pixels", samples.pixel.size(), expected)?;
        let sample = |x: u32, y: u32| {
            let pixel = samples.pixel.get(x, y);
            let place = (pixel % width, pixel / width);
            if pixel == NO_SAMPLE || place.1 >= height {
                return (None, (0.0, 0.0));
            }
            (Some(place), (samples.difference.get(x, y), samples.largest.get(x, y)))
        };
        self.run(guides, sample, settings)
    }

    /// The same without shading anything again: a stratum's difference is that of the mean luminance of its
    /// samples and of what the history expects there. As samples are new ones, noise counts as change, and
    /// only its mean over many strata is small: changes are less certain and less local than those of
    /// [`Gradients::reconstruct`], and a dead zone is advisable.
    pub fn estimate(
        &mut self,
        guides: &Guides<'_>,
        signal: &Plane3,
        reprojection: &Reprojection,
        history: &Temporal<3>,
        settings: &GradientSettings,
    ) -> Result<&Plane> {
        guides.check()?;
        let size @ (width, height) = guides.size();
        same_size("the signal", signal.size(), size)?;
        if history.size() != size || reprojection.taps().size() != size {
            self.fit(size, settings)?;
            self.change.fill(0.0);
            return Ok(&self.change);
        }
        let taps = reprojection.taps();
        let sample = |x: u32, y: u32| {
            let (mut now, mut before, mut count, mut place) = (0.0, 0.0, 0.0, None);
            for y in y * STRATUM..(y * STRATUM + STRATUM).min(height) {
                for x in x * STRATUM..(x * STRATUM + STRATUM).min(width) {
                    let value = luminance(signal.get(x, y).to_array());
                    let taps = taps.get(x, y);
                    if taps.is_some() && value.is_finite() {
                        now += value.clamp(0.0, LARGEST);
                        before += taps.of_channel(history.stack(), Temporal::<3>::MEAN).max(0.0);
                        count += 1.0;
                        place = Some((x, y));
                    }
                }
            }
            if count > 0.0 {
                (place, ((now - before) / count, now.max(before) / count))
            } else {
                (None, (0.0, 0.0))
            }
        };
        self.run(guides, sample, settings)
    }

    /// What was found last; empty before.
    pub fn change(&self) -> &Plane {
        &self.change
    }

    fn fit(&mut self, size: (u32, u32), settings: &GradientSettings) -> Result<()> {
        settings.check()?;
        let strata @ (width, height) = strata(size);
        if self.depth.size() != strata || self.change.size() != size {
            self.depth = Plane::new(width, height)?;
            self.normal = Plane3::new(width, height)?;
            self.object = Plane::new(width, height)?;
            self.change = Plane::new(size.0, size.1)?;
        }
        let margin = margin(settings.levels);
        geometry::fit(&mut self.geometry, strata, geometry::CHANNELS, margin)?;
        for stack in &mut self.signals {
            geometry::fit(stack, strata, SIGNAL, margin)?;
        }
        Ok(())
    }

    fn run(
        &mut self,
        guides: &Guides<'_>,
        sample: impl Fn(u32, u32) -> (Option<(u32, u32)>, Sample) + Sync,
        settings: &GradientSettings,
    ) -> Result<&Plane> {
        let size = guides.size();
        self.fit(size, settings)?;
        let (width, height) = strata(size);
        let first = &mut self.signals[0];
        let (margin, stride, length) = (first.margin(), first.stride(), first.band_len(1));
        let padded = self.depth.stride();
        let [nx, ny, nz] = &mut self.normal.channels;
        let rows = first.values_mut().par_chunks_mut(length);
        let rows = rows.zip(self.depth.values_mut().par_chunks_mut(padded));
        let rows = rows.zip(self.object.values_mut().par_chunks_mut(padded));
        let rows = rows.zip(nx.values_mut().par_chunks_mut(padded));
        let rows = rows.zip(ny.values_mut().par_chunks_mut(padded));
        let rows = rows.zip(nz.values_mut().par_chunks_mut(padded)).zip(0..height);
        rows.for_each(|((((((row, depth), object), nx), ny), nz), y)| {
            for x in 0..width as usize {
                let (place, (difference, largest)) = sample(x as u32, y);
                let good = difference.is_finite() && largest.is_finite() && place.is_some();
                let [difference, largest] = [difference, largest]
                    .map(|value| if good { value.clamp(-LARGEST, LARGEST) } else { 0.0 });
                row[margin + x] = difference;
                row[stride + margin + x] = largest.max(difference.abs());
                // The surface of a stratum is that of its sample, or of its middle.
                let middle = |i: u32, size: u32| (i * STRATUM + STRATUM / 2).min(size - 1);
                let (px, py) = place.unwrap_or((middle(x as u32, size.0), middle(y, size.1)));
                depth[x] = guides.depth.get(px, py);
                object[x] = guides.object.get(px, py);
                [nx[x], ny[x], nz[x]] = guides.normal.get(px, py).to_array();
            }
        });
        let motion = [Plane::default(), Plane::default()];
        let strata = Guides {
            depth: &self.depth,
            normal: &self.normal,
            object: &self.object,
            motion: &motion,
            depth_motion: None,
        };
        let stopping = EdgeStopping { luminance: 1e9, ..settings.stopping };
        geometry::prepare(self.isa, &strata, stopping.object, &mut self.geometry);
        for level in 0..settings.levels {
            let [from, to] = &mut self.signals;
            filter_level::<1>(self.isa, &self.geometry, from, to, level, &stopping, true);
            self.signals.swap(0, 1);
        }
        let (filtered, dead) = (&self.signals[0], settings.dead_zone);
        let (width, stride) = (size.0 as usize, self.change.stride());
        let bands = self.change.values_mut().par_chunks_mut(stride * BAND);
        bands.enumerate().for_each(|(band, rows)| {
            for (y, row) in (band * BAND..).zip(rows.chunks_mut(stride)) {
                let y = y as u32 / STRATUM;
                let (differences, largest) = (filtered.row(0, y), filtered.row(1, y));
                for (x, value) in row[..width].iter_mut().enumerate() {
                    let x = x / STRATUM as usize;
                    *value = change(differences[x], largest[x], dead);
                }
            }
        });
        Ok(&self.change)
    }
}

/// The share of the history that is no longer true.
#[inline(always)]
fn change(difference: f32, largest: f32, dead: f32) -> f32 {
    let share = if largest > 0.0 { (difference.abs() / largest).min(1.0) } else { 0.0 };
    ((share - dead) / (1.0 - dead)).max(0.0)
}
