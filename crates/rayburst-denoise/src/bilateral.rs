//! One half of a separable cross-bilateral filter: along rows or along columns, as far as each pixel asks
//! for, over pixels of the same surface (Petschnigg et al.: "Digital Photography with Flash and No-Flash
//! Image Pairs", 2004; Pham, van Vliet: "Separable Bilateral Filtering for Fast Video Preprocessing", 2005).
//!
//! A neighbour's weight is (1 − q)² for q < 1 and zero from there on. q adds up the squared distance over
//! the squared radius, the squared distance in depth from the pixel's plane over what is tolerated, and
//! the same of the normals: a bell of finite width, without an exponential.

use rayburst_simd::{Isa, Kernel};

use crate::{
    Surfaces,
    blocks::Blocks,
    lanes::{LANES, Lanes, greater, greatest, lesser, load, store},
    scratch::{MARGIN, Scratch, ScratchBand},
    surfaces::{NEARNESS, NORMAL, SLOPE, STEP, STIFFNESS},
};

/// Kernels are no wider to either side, pixels.
pub(crate) const MOST_RADIUS: f32 = MARGIN as f32;

/// How far a kernel reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Reach<'a> {
    /// As many pixels everywhere.
    Pixels(f32),
    /// Lengths on the surface, world units, in a scratch's only channel; no more than so many pixels, and
    /// no fewer than so many where the length is positive.
    World { lengths: &'a Scratch, most: f32, least: f32 },
}

/// Filters a band of `N` channels along an axis, 0 along rows and 1 along columns.
pub(crate) struct Bilateral<'a, const N: usize> {
    pub(crate) surfaces: &'a Surfaces,
    /// Of [`crate::SurfaceTolerance::factors`].
    pub(crate) factors: [f32; 2],
    pub(crate) axis: usize,
    /// Every how many pixels a neighbour counts.
    pub(crate) stride: usize,
    pub(crate) reach: Reach<'a>,
    /// Blocks that have anything to filter; the others are copied.
    pub(crate) blocks: &'a Blocks,
    pub(crate) input: &'a Scratch,
    pub(crate) band: ScratchBand<'a>,
}

impl<const N: usize> Kernel for Bilateral<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let columns = self.input.width().div_ceil(LANES);
        for y in self.band.rows() {
            for block in 0..columns {
                let at = MARGIN + block * LANES;
                let changes = self.blocks.changes(y, block);
                let radius = if changes { self.radius(y, at) } else { [0.0; LANES] };
                let widest = greatest(&radius);
                if widest > 1.0 {
                    self.block(y, at, &radius, widest);
                } else {
                    for channel in 0..N {
                        let own = load(self.input.row(y, channel), at);
                        store(self.band.row_mut(y, channel), at, &own);
                    }
                }
            }
            self.band.extend(y);
        }
    }
}

impl<const N: usize> Bilateral<'_, N> {
    /// How many pixels the kernel of each pixel reaches; 0 where nothing is.
    #[inline(always)]
    fn radius(&self, y: usize, at: usize) -> Lanes {
        let nearness = load(self.surfaces.shape().row(y, NEARNESS), at);
        let mut radius = [0.0; LANES];
        match self.reach {
            Reach::Pixels(pixels) => {
                for i in 0..LANES {
                    radius[i] = if nearness[i] > 0.0 { pixels } else { 0.0 };
                }
            }
            Reach::World { lengths, most, least } => {
                let length = load(lengths.row(y, 0), at);
                let step = load(self.surfaces.local().row(y, STEP + self.axis), at);
                for i in 0..LANES {
                    let pixels = lesser(length[i] / step[i], most);
                    let pixels = if pixels < least { least } else { pixels };
                    let there = nearness[i] > 0.0 && length[i] > 0.0;
                    radius[i] = if there { pixels } else { 0.0 };
                }
            }
        }
        radius
    }

    #[inline(always)]
    fn block(&mut self, y: usize, at: usize, radius: &Lanes, widest: f32) {
        let (shape, local) = (self.surfaces.shape(), self.surfaces.local());
        let own = load(shape.row(y, NEARNESS), at);
        let nx = load(shape.row(y, NORMAL), at);
        let ny = load(shape.row(y, NORMAL + 1), at);
        let nz = load(shape.row(y, NORMAL + 2), at);
        let slope = load(local.row(y, SLOPE + self.axis), at);
        let mut stiffness = load(local.row(y, STIFFNESS + self.axis), at);
        let mut narrow = [0.0; LANES];
        for i in 0..LANES {
            stiffness[i] *= self.factors[0];
            let radius = if radius[i] > 1.0 { radius[i] } else { 1.0 };
            narrow[i] = 1.0 / (radius * radius);
        }
        let bend = self.factors[1];
        let mut weights = [1.0; LANES];
        let mut sums = [[0.0; LANES]; N];
        for channel in 0..N {
            sums[channel] = load(self.input.row(y, channel), at);
        }
        let stride = self.stride as isize;
        let taps = (widest.ceil() as isize - 1).min(MARGIN as isize) / stride;
        let height = self.input.height() as isize;
        let mut tap = -taps;
        while tap <= taps {
            let offset = tap * stride;
            let (row, x) = match self.axis {
                0 => (y as isize, at as isize + offset),
                _ => (y as isize + offset, at as isize),
            };
            tap += 1;
            if offset == 0 || row < 0 || row >= height {
                continue;
            }
            let (row, x) = (row as usize, x as usize);
            let near = load(shape.row(row, NEARNESS), x);
            let mx = load(shape.row(row, NORMAL), x);
            let my = load(shape.row(row, NORMAL + 1), x);
            let mz = load(shape.row(row, NORMAL + 2), x);
            let far = offset as f32;
            let mut weight = [0.0; LANES];
            for i in 0..LANES {
                let off = (near[i] - own[i] - far * slope[i]) * stiffness[i];
                let turned = 1.0 - (nx[i] * mx[i] + ny[i] * my[i] + nz[i] * mz[i]);
                let q = far * far * narrow[i] + off * off + greater(turned, 0.0) * bend;
                let rest = 1.0 - lesser(q, 1.0);
                weight[i] = rest * rest;
                weights[i] += weight[i];
            }
            for channel in 0..N {
                let value = load(self.input.row(row, channel), x);
                for i in 0..LANES {
                    sums[channel][i] += weight[i] * value[i];
                }
            }
        }
        for i in 0..LANES {
            weights[i] = 1.0 / weights[i];
        }
        for channel in 0..N {
            for i in 0..LANES {
                sums[channel][i] *= weights[i];
            }
            store(self.band.row_mut(y, channel), at, &sums[channel]);
        }
    }
}
