//! A frame as temporal anti-aliasing and upscaling look at it: colours as luma and chromas, and where the
//! nearest surface around each pixel was before.

use rayburst_image::Plane3;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Guides, Result, checks,
    clip::to_ycocg,
    lanes::{LANES, Lanes, greater, light, load},
    scratch::{MARGIN, Scratch, ScratchBand, padded_row},
};

/// A frame's colours and motion, with margins.
#[derive(Clone, Debug, Default)]
pub(crate) struct Neighbourhood {
    colour: Scratch,
    /// The reciprocal of the depth, 0 where nothing is, and the motion.
    surface: Scratch,
}

/// Motion that leads out of every picture.
pub(crate) const AWAY: f32 = 1e6;

impl Neighbourhood {
    /// Takes a frame in.
    pub(crate) fn take(
        &mut self,
        isa: IsaLevel,
        colour: &Plane3,
        guides: &Guides<'_>,
    ) -> Result<()> {
        guides.check()?;
        let size = guides.size();
        checks::picture(size)?;
        for channel in &colour.channels {
            checks::size("the colour", channel.size(), size)?;
        }
        self.colour.resize(size, 3);
        self.surface.resize(size, 3);
        self.colour.bands_mut().for_each(|band| isa.dispatch(TakeColour { colour, band }));
        self.surface.bands_mut().for_each(|band| isa.dispatch(TakeSurface { guides, band }));
        Ok(())
    }

    /// Luma and chromas.
    pub(crate) fn colour(&self) -> &Scratch {
        &self.colour
    }

    /// Mean and deviation of the 3×3 pixels around sixteen pixels.
    #[inline(always)]
    pub(crate) fn statistics(
        &self,
        y: usize,
        at: usize,
        means: &mut [Lanes; 3],
        deviations: &mut [Lanes; 3],
    ) {
        for c in 0..3 {
            let own = load(self.colour.row(y, c), at);
            let mut sum = [0.0; LANES];
            let mut squares = [0.0; LANES];
            for j in 0..3 {
                let row = self.colour.near_row(y as isize + j - 1, c);
                for i in 0..3 {
                    let near = load(row, at + i - 1);
                    for lane in 0..LANES {
                        let off = near[lane] - own[lane];
                        sum[lane] += off;
                        squares[lane] += off * off;
                    }
                }
            }
            for lane in 0..LANES {
                let mean = sum[lane] * (1.0 / 9.0);
                let variance = squares[lane] * (1.0 / 9.0) - mean * mean;
                means[c][lane] = own[lane] + mean;
                deviations[c][lane] = greater(variance, 0.0).sqrt();
            }
        }
    }

    /// Which of the 3×3 pixels around sixteen pixels is the nearest, for [`Neighbourhood::motion`].
    ///
    /// Numbers that are not negative sort like their bits, so the last four bits can say which pixel it is; of
    /// pixels as near the own one is taken.
    #[inline(always)]
    pub(crate) fn nearest(&self, y: usize, at: usize) -> [u32; LANES] {
        let mut nearest = [0u32; LANES];
        for j in 0..3 {
            let row = self.surface.near_row(y as isize + j - 1, 0);
            for i in 0..3 {
                let near = load(row, at + i - 1);
                let code = if (i, j) == (1, 1) { OWN } else { (3 * j) as u32 + i as u32 };
                for lane in 0..LANES {
                    let key = (near[lane].to_bits() & !OWN) | code;
                    nearest[lane] = if key > nearest[lane] { key } else { nearest[lane] };
                }
            }
        }
        nearest
    }

    /// Motion of the nearest surface around a pixel: edges move with what is in front (Karis 2014).
    #[inline(always)]
    pub(crate) fn motion(&self, nearest: u32, y: usize, at: usize) -> [f32; 2] {
        let code = nearest & OWN;
        let code = if code == OWN { 4 } else { code as usize };
        let (row, x) = (y as isize + (code / 3) as isize - 1, at + code % 3 - 1);
        [self.surface.near_row(row, 1)[x], self.surface.near_row(row, 2)[x]]
    }
}

/// The pixel itself, in [`Neighbourhood::nearest`].
const OWN: u32 = 15;

/// Turns colours into luma and chromas.
struct TakeColour<'a> {
    colour: &'a Plane3,
    band: ScratchBand<'a>,
}

impl Kernel for TakeColour<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for y in self.band.rows() {
            let r = padded_row(&self.colour.channels[0], y);
            let g = padded_row(&self.colour.channels[1], y);
            let b = padded_row(&self.colour.channels[2], y);
            for channel in 0..3 {
                let out = &mut self.band.row_mut(y, channel)[MARGIN..][..r.len()];
                for x in 0..r.len() {
                    out[x] = to_ycocg(light(r[x]), light(g[x]), light(b[x]))[channel];
                }
            }
            self.band.extend(y);
        }
    }
}

/// Takes depth and motion.
struct TakeSurface<'a> {
    guides: &'a Guides<'a>,
    band: ScratchBand<'a>,
}

impl Kernel for TakeSurface<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for y in self.band.rows() {
            let depth = padded_row(self.guides.depth, y);
            let out = &mut self.band.row_mut(y, 0)[MARGIN..][..depth.len()];
            for x in 0..depth.len() {
                let nearness = 1.0 / greater(depth[x], 1e-6);
                out[x] = if depth[x] > 0.0 { nearness } else { 0.0 };
            }
            for axis in 0..2 {
                let motion = padded_row(&self.guides.motion[axis], y);
                let out = &mut self.band.row_mut(y, 1 + axis)[MARGIN..][..motion.len()];
                for x in 0..motion.len() {
                    out[x] = if motion[x].abs() < AWAY { motion[x] } else { AWAY };
                }
            }
            self.band.extend(y);
        }
    }
}
