//! The least value of pixels around that show the same surface, along rows or along columns.

use rayburst_simd::{Isa, Kernel};

use crate::{
    Surfaces,
    blocks::Blocks,
    lanes::{LANES, lesser, load, store},
    scratch::{MARGIN, Scratch, ScratchBand},
    surfaces::{NEARNESS, NORMAL, SLOPE, STIFFNESS},
};

/// Finds the least values of a band of one channel along an axis, 0 along rows and 1 along columns.
pub(crate) struct Least<'a> {
    pub(crate) surfaces: &'a Surfaces,
    /// Of [`crate::SurfaceTolerance::factors`].
    pub(crate) factors: [f32; 2],
    pub(crate) axis: usize,
    /// Every how many pixels a neighbour counts.
    pub(crate) stride: usize,
    /// Neighbours to either side.
    pub(crate) taps: usize,
    /// Blocks that have anything to filter; the others are copied.
    pub(crate) blocks: &'a Blocks,
    pub(crate) input: &'a Scratch,
    pub(crate) band: ScratchBand<'a>,
}

impl Kernel for Least<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let (shape, local) = (self.surfaces.shape(), self.surfaces.local());
        let (taps, height) = (self.taps as isize, self.input.height() as isize);
        for y in self.band.rows() {
            for x in (0..self.input.width()).step_by(LANES) {
                let at = MARGIN + x;
                if !self.blocks.changes(y, x / LANES) {
                    let own = load(self.input.row(y, 0), at);
                    store(self.band.row_mut(y, 0), at, &own);
                    continue;
                }
                let own = load(shape.row(y, NEARNESS), at);
                let nx = load(shape.row(y, NORMAL), at);
                let ny = load(shape.row(y, NORMAL + 1), at);
                let nz = load(shape.row(y, NORMAL + 2), at);
                let slope = load(local.row(y, SLOPE + self.axis), at);
                let stiffness = load(local.row(y, STIFFNESS + self.axis), at);
                let mut least = load(self.input.row(y, 0), at);
                let mut tap = -taps;
                while tap <= taps {
                    let offset = tap * self.stride as isize;
                    let (row, x) = match self.axis {
                        0 => (y as isize, at as isize + offset),
                        _ => (y as isize + offset, at as isize),
                    };
                    tap += 1;
                    if row < 0 || row >= height {
                        continue;
                    }
                    let (row, x) = (row as usize, x as usize);
                    let near = load(shape.row(row, NEARNESS), x);
                    let mx = load(shape.row(row, NORMAL), x);
                    let my = load(shape.row(row, NORMAL + 1), x);
                    let mz = load(shape.row(row, NORMAL + 2), x);
                    let value = load(self.input.row(row, 0), x);
                    let far = offset as f32;
                    for i in 0..LANES {
                        let off = (near[i] - own[i] - far * slope[i]) * stiffness[i];
                        let off = off * self.factors[0];
                        let turned = 1.0 - (nx[i] * mx[i] + ny[i] * my[i] + nz[i] * mz[i]);
                        let q = off * off + turned * self.factors[1];
                        let lower = lesser(value[i], least[i]);
                        least[i] = if q < 1.0 { lower } else { least[i] };
                    }
                }
                store(self.band.row_mut(y, 0), at, &least);
            }
            self.band.extend(y);
        }
    }
}
