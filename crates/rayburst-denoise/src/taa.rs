//! Temporal anti-aliasing: frames whose rays go through other points of the pixels each time are averaged
//! along the motion (Yang, Liu, Salvi: "A Survey of Temporal Antialiasing Techniques", Eurographics 2020).
//!
//! A frame's sample counts by its distance to the pixel's centre, and so do its neighbours' samples: what a
//! still picture converges to is the scene convolved with that kernel. The history is read with cubic
//! interpolation, and clipped to the mean and the deviation of the frame's 3×3 pixels around, so that what
//! is no longer there does not stay as a ghost.

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
    texels::{Texel, Texels},
};

/// How [`TemporalAntialiasing`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaaSettings {
    /// Deviations of the 3×3 pixels around that the history may be off their mean.
    pub deviations: f32,
    /// The most frames that a history counts for.
    pub longest: f32,
    /// Radius of the kernel that samples count by, pixels.
    pub radius: f32,
    /// Weights of colours are divided by one plus this times their luma, so that lone bright samples do not
    /// flicker: the reciprocal of what is shown as white, or 0 for a plain mean.
    pub dimming: f32,
}

impl Default for TaaSettings {
    fn default() -> Self {
        Self { deviations: 1.5, longest: 32.0, radius: 1.0, dimming: 0.0 }
    }
}

impl TaaSettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        checks::setting("the deviations", self.deviations, (0.0, 1e6), "from 0 to 1000000")?;
        checks::setting("the longest history", self.longest, (0.0, 65536.0), "from 0 to 65536")?;
        checks::setting("the radius", self.radius, (0.6, 1.5), "from 0.6 to 1.5")?;
        checks::setting("the dimming", self.dimming, (0.0, 1e12), "not negative")
    }

    fn blend(&self) -> Blend {
        let Self { deviations, longest, dimming, .. } = *self;
        Blend { deviations, longest, dimming }
    }
}

/// Fails unless rays go through their pixels.
pub(crate) fn check_jitter(jitter: Vec2) -> Result<()> {
    checks::setting("the jitter", jitter.x, (-0.5, 0.5), "from −½ to ½")?;
    checks::setting("the jitter", jitter.y, (-0.5, 0.5), "from −½ to ½")
}

/// Averages frames along their motion.
#[derive(Clone, Debug)]
pub struct TemporalAntialiasing {
    isa: IsaLevel,
    frame: Neighbourhood,
    /// Luma, chromas and weight.
    now: Texels,
    before: Texels,
}

impl TemporalAntialiasing {
    /// Without a history, for an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        let (now, before) = (Texels::default(), Texels::default());
        Self { isa, frame: Neighbourhood::default(), now, before }
    }

    /// Forgets the history: for cuts.
    pub fn reset(&mut self) {
        self.now.fill([0.0; 4]);
    }

    /// Takes a frame of radiance in, and gives the picture without edges of stairs; `out` gets its size.
    ///
    /// `jitter` is where the frame's rays go through pixels, relative to their centres. `taps`, if any, are
    /// where surfaces were found in the frame before: where none was, the history counts for one frame at
    /// most. After a change of size there is no history. What is not a number, or negative, counts as black.
    pub fn resolve(
        &mut self,
        colour: &Plane3,
        guides: &Guides<'_>,
        jitter: Vec2,
        taps: Option<&Plane<Taps>>,
        settings: &TaaSettings,
        out: &mut Plane3,
    ) -> Result<()> {
        settings.check()?;
        check_jitter(jitter)?;
        let size = guides.size();
        if let Some(taps) = taps {
            checks::size("the taps", taps.size(), size)?;
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
        let kernel = |jitter: f32| {
            let mut weights = [-1.0, 0.0, 1.0].map(|at| bell(at + jitter, settings.radius));
            weights[1] = weights[1].max(0.01);
            weights
        };
        let (across, down) = (kernel(jitter.x), kernel(jitter.y));
        let (isa, frame, before) = (self.isa, &self.frame, &self.before);
        let [r, g, b] = &mut out.channels;
        let bands = band_rows(r).zip(band_rows(g)).zip(band_rows(b)).zip(self.now.bands_mut());
        bands.enumerate().for_each(|(i, (((r, g), b), now))| {
            let (top, blend) = (i * BAND, settings.blend());
            let out = [r, g, b];
            isa.dispatch(Resolve { frame, before, taps, across, down, blend, top, out, now });
        });
        Ok(())
    }
}

struct Resolve<'a> {
    frame: &'a Neighbourhood,
    before: &'a Texels,
    taps: Option<&'a Plane<Taps>>,
    across: [f32; 3],
    down: [f32; 3],
    blend: Blend,
    top: usize,
    out: [&'a mut [f32]; 3],
    now: &'a mut [Texel],
}

impl Kernel for Resolve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let width = self.before.width();
        let total = (self.across[0] + self.across[1] + self.across[2])
            * (self.down[0] + self.down[1] + self.down[2]);
        let mut blended = Blended::EMPTY;
        blended.weight = [total; LANES];
        let mut out = [[0.0; LANES]; 4];
        for row in 0..self.now.len() / width {
            for x in (0..width).step_by(LANES) {
                self.gather(self.top + row, x, 1.0 / total, &mut blended);
                blended.blend(&self.blend, &mut out);
                self.write(row, x, &out);
            }
        }
    }
}

impl Resolve<'_> {
    /// What is known of sixteen pixels, but for the weight.
    #[inline(always)]
    fn gather(&self, y: usize, x: usize, share: f32, blended: &mut Blended) {
        let at = MARGIN + x;
        self.frame.statistics(y, at, &mut blended.mean, &mut blended.deviation);
        for c in 0..3 {
            let mut sum = [0.0; LANES];
            for j in 0..3 {
                let row = self.frame.colour().near_row(y as isize + j as isize - 1, c);
                for i in 0..3 {
                    let near = load(row, at + i - 1);
                    let weight = self.down[j] * self.across[i] * share;
                    for lane in 0..LANES {
                        sum[lane] += weight * near[lane];
                    }
                }
            }
            blended.now[c] = sum;
        }
        for c in 0..4 {
            blended.history[c] = [0.0; LANES];
        }
        let nearest = self.frame.nearest(y, at);
        for i in 0..LANES.min(self.before.width() - x) {
            let [mx, my] = self.frame.motion(nearest[i], y, at + i);
            let (px, py) = ((x + i) as f32 + mx, y as f32 + my);
            if !self.before.contains(px, py) {
                continue;
            }
            let texel = self.before.cubic(px, py);
            for c in 0..4 {
                blended.history[c][i] = texel[c];
            }
        }
        for i in 0..LANES {
            blended.history[3][i] = greater(blended.history[3][i], 0.0);
        }
        if let Some(taps) = self.taps {
            let taps = &taps.values()[y * taps.stride() + x..][..LANES];
            for i in 0..LANES {
                let weight = blended.history[3][i];
                blended.history[3][i] =
                    if taps[i].is_some() || weight < 1.0 { weight } else { 1.0 };
            }
        }
    }

    #[inline(always)]
    fn write(&mut self, row: usize, x: usize, blended: &[[f32; LANES]; 4]) {
        let width = self.before.width();
        let stride = self.out[0].len() / (self.now.len() / width);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_have_ranges() {
        assert!(TaaSettings::default().check().is_ok());
        for wrong in [f32::NAN, -1.0, f32::INFINITY] {
            assert!(TaaSettings { radius: wrong, ..TaaSettings::default() }.check().is_err());
            assert!(check_jitter(Vec2::new(wrong, 0.0)).is_err());
        }
    }
}
