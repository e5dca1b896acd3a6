//! Output pixels: the frame's samples around each, its history, and the blend of both.

use glam::Vec2;
use rayburst_simd::{Isa, Kernel};

use super::{packed::Packed, places::Places};
use crate::{
    clip::{Blend, Blended, from_ycocg},
    lanes::{LANES, Lanes, greater, load, store},
    neighbourhood::Neighbourhood,
    scratch::MARGIN,
    texels::{Texel, Texels},
};

/// What a pixel that has seen nothing counts the frame for.
const FIRST: f32 = 0.3;

/// Resolves a band of rows.
pub(super) struct Resolve<'a> {
    pub(super) frame: &'a Neighbourhood,
    pub(super) packed: &'a Packed,
    pub(super) before: &'a Texels,
    pub(super) columns: &'a Places,
    pub(super) rows: &'a Places,
    pub(super) scale: Vec2,
    pub(super) blend: Blend,
    pub(super) top: usize,
    pub(super) out: [&'a mut [f32]; 3],
    pub(super) now: &'a mut [Texel],
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
