//! The first variance of a frame's signals: over time where there is a history, else over the surface around.

use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    approximate::{exp2, reciprocal},
    atrous::{EdgeStopping, extend},
    atrous_kernel::{LUMINANCE, SIGNAL, VARIANCE, luminance},
    geometry::{DEPTH, LEAST_SLOPE, NORMAL, OBJECT, SLOPE},
    stack::{AHEAD, BAND, BLOCK, Lanes, Stack, lanes, prefetch},
    temporal::Temporal,
};

/// Pixels to every side that variance is estimated over.
const RADIUS: isize = 3;

/// Makes the signals that the wavelet transform begins with: accumulated colours, their luminance, and its
/// variance; that is what the history knows, or where it is shorter than `shortest` frames an estimate over
/// the 7×7 pixels around that show the same surface (Schied et al.: "Spatiotemporal Variance-Guided
/// Filtering", HPG 2017, section 4.2).
pub(crate) fn estimate<const N: usize>(
    isa: IsaLevel,
    geometry: &Stack,
    histories: [&Temporal<3>; N],
    shortest: f32,
    stopping: &EdgeStopping,
    to: &mut Stack,
) {
    let (length, margin, stride) = (to.band_len(BAND), to.margin(), to.stride());
    let width = to.size().0 as usize;
    to.values_mut().par_chunks_mut(length).enumerate().for_each(|(band, rows)| {
        let histories = histories.map(Temporal::stack);
        let top = band * BAND;
        isa.dispatch(Estimate {
            geometry,
            histories,
            shortest,
            depth: stopping.depth,
            normal: stopping.normal * std::f32::consts::LOG2_E,
            top,
            margin,
            stride,
            to: &mut *rows,
        });
        for row in rows.chunks_mut(SIGNAL * stride) {
            extend(&mut row[VARIANCE * stride..], margin, width);
        }
    });
}

struct Estimate<'a, const N: usize> {
    geometry: &'a Stack,
    histories: [&'a Stack; N],
    shortest: f32,
    depth: f32,
    normal: f32,
    top: usize,
    margin: usize,
    stride: usize,
    to: &'a mut [f32],
}

impl<const N: usize> Kernel for Estimate<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        let width = self.geometry.size().0 as usize;
        let rows = std::mem::take(&mut self.to);
        for (y, rows) in (self.top..).zip(rows.chunks_mut(N * SIGNAL * self.stride)) {
            for x in (0..width).step_by(BLOCK) {
                let ahead = self.margin + x + AHEAD;
                prefetch(isa, rows, ahead, self.stride, N * SIGNAL);
                for s in 0..N {
                    let history = self.histories[s];
                    let ahead = history.margin() + x + AHEAD;
                    let row = history.rows(y as u32);
                    prefetch(isa, row, ahead, history.stride(), history.channels());
                    let block = self.block::<I>(self.histories[s], x, y);
                    for c in 0..SIGNAL {
                        rows[(s * SIGNAL + c) * self.stride + self.margin + x..][..BLOCK]
                            .copy_from_slice(&block[c]);
                    }
                }
            }
        }
    }
}

impl<const N: usize> Estimate<'_, N> {
    #[inline(always)]
    fn block<I: Isa>(&self, history: &Stack, x: usize, y: usize) -> [Lanes; SIGNAL] {
        let row = history.rows(y as u32);
        let channel = |c: usize| lanes(row, c * history.stride() + history.margin() + x);
        let (red, green, blue) = (channel(0), channel(1), channel(2));
        let (variance, frames) = (channel(Temporal::<3>::VARIANCE), channel(Temporal::<3>::LENGTH));
        let width = self.geometry.size().0 as usize;
        let mut fewest = f32::INFINITY;
        for i in 0..(width - x).min(BLOCK) {
            fewest = fewest.min(frames[i]);
        }
        let around =
            if fewest < self.shortest { self.around::<I>(history, x, y) } else { *variance };
        let mut out = [[0.0; BLOCK]; SIGNAL];
        for i in 0..BLOCK {
            let colour = [red[i].max(0.0), green[i].max(0.0), blue[i].max(0.0)];
            out[0][i] = colour[0];
            out[1][i] = colour[1];
            out[2][i] = colour[2];
            out[LUMINANCE][i] = luminance(colour);
            let is_young = frames[i] < self.shortest;
            out[VARIANCE][i] = if is_young { around[i] } else { variance[i] }.max(0.0);
        }
        out
    }

    /// The variance of all samples on the surface around.
    #[inline(always)]
    fn around<I: Isa>(&self, history: &Stack, x: usize, y: usize) -> Lanes {
        let shape = |row: u32, channel: usize, offset: isize| {
            let at = channel * self.geometry.stride() + self.geometry.margin() + x;
            lanes(self.geometry.rows(row), at.wrapping_add_signed(offset))
        };
        let moment = |row: u32, channel: usize, offset: isize| {
            let at = channel * history.stride() + history.margin() + x;
            lanes(history.rows(row), at.wrapping_add_signed(offset))
        };
        let row = y as u32;
        let (depth, object) = (shape(row, DEPTH, 0), shape(row, OBJECT, 0));
        let [nx, ny, nz] = [0, 1, 2].map(|axis| shape(row, NORMAL + axis, 0));
        let (across, down) = (shape(row, SLOPE, 0), shape(row, SLOPE + 1, 0));
        let mean = moment(row, Temporal::<3>::MEAN, 0);
        let mut sums = [[0.0; BLOCK]; 3];
        for dy in -RADIUS..=RADIUS {
            let row = y as isize + dy;
            if row < 0 || row >= self.geometry.size().1 as isize {
                continue;
            }
            let row = row as u32;
            for dx in -RADIUS..=RADIUS {
                let (tap_depth, tap_object) = (shape(row, DEPTH, dx), shape(row, OBJECT, dx));
                let [tx, ty, tz] = [0, 1, 2].map(|axis| shape(row, NORMAL + axis, dx));
                let tap_mean = moment(row, Temporal::<3>::MEAN, dx);
                let tap_variance = moment(row, Temporal::<3>::VARIANCE, dx);
                let (fx, fy) = (dx as f32, dy as f32);
                let distance = fx.abs().max(fy.abs());
                let is_centre = dx == 0 && dy == 0;
                for i in 0..BLOCK {
                    let change = (across[i] * fx + down[i] * fy).abs()
                        + LEAST_SLOPE * depth[i].abs() * distance;
                    let apart = (tap_depth[i] - depth[i]).abs()
                        * reciprocal((self.depth * change).max(1e-18));
                    let cosine = nx[i] * tx[i] + ny[i] * ty[i] + nz[i] * tz[i];
                    let alike = -apart * std::f32::consts::LOG2_E + self.normal * (cosine - 1.0);
                    let same = object[i].to_bits() == tap_object[i].to_bits();
                    let weight = if same { exp2::<I>(alike) } else { 0.0 };
                    let weight = if is_centre { 1.0 } else { weight };
                    // Means are measured from the one in the centre, so that squares do not cancel.
                    let offset = tap_mean[i] - mean[i];
                    sums[0][i] += weight;
                    sums[1][i] += weight * offset;
                    sums[2][i] += weight * (offset * offset + tap_variance[i]);
                }
            }
        }
        let mut variance = [0.0; BLOCK];
        for i in 0..BLOCK {
            let scale = 1.0 / sums[0][i];
            let offset = sums[1][i] * scale;
            variance[i] = (sums[2][i] * scale - offset * offset).max(0.0);
        }
        variance
    }
}
