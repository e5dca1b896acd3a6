//! What output pixels read of the rendered pixel that is nearest, side by side in memory.

use rayburst_image::Plane;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Taps,
    lanes::LANES,
    neighbourhood::{AWAY, Neighbourhood},
    scratch::{BAND, MARGIN},
    texels::{Texel, Texels},
};

/// What the frame is around rendered pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct Packed {
    /// Mean of the 3×3 pixels around, and the motion to the right.
    pub(super) mean: Texels,
    /// Their deviation, and the motion down.
    pub(super) deviation: Texels,
}

impl Packed {
    pub(super) fn fill(
        &mut self,
        isa: IsaLevel,
        frame: &Neighbourhood,
        taps: Option<&Plane<Taps>>,
    ) {
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
