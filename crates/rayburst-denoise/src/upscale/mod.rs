//! Temporal upscaling: frames of fewer pixels, whose rays go through other points each time, are gathered
//! in a history of full size (Yang, Liu, Salvi: "A Survey of Temporal Antialiasing Techniques",
//! Eurographics 2020, section 5; Karis: "High Quality Temporal Supersampling", SIGGRAPH 2014 courses).
//!
//! A sample counts for an output pixel by its distance to the pixel's centre, under a kernel of an output
//! pixel's width: over the frames samples fall everywhere, and a still picture converges to what a frame of
//! full size converges to. Pixels that have seen nothing yet show the frame under a kernel of a rendered
//! pixel's width.

mod packed;
mod places;
mod resolve;

use glam::Vec2;
use rayburst_image::{Plane, Plane3};
use rayburst_simd::IsaLevel;
use rayon::prelude::*;

use self::{packed::Packed, places::Places, resolve::Resolve};
use crate::{
    Guides, Result, Taps, checks,
    clip::Blend,
    neighbourhood::Neighbourhood,
    scratch::{BAND, band_rows, fit},
    taa::check_jitter,
    texels::Texels,
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
