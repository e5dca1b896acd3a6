//! Ambient occlusion of one ray is smoothed as far as what occludes is away.
//!
//! The nearer the nearest occluder, the faster occlusion changes along a surface, and the narrower the
//! kernel: its width is proportional to the least distance that rays around a pixel met something at
//! (Mehta, Wang, Ramamoorthi: "Axis-Aligned Filtering for Interactive Sampled Soft Shadows", SIGGRAPH Asia
//! 2012, and its course for occlusion in chapter 26 of "Real-Time Rendering", Figure 26.21).

use rayburst_image::Plane;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Result, SurfaceTolerance, Surfaces,
    bilateral::{Bilateral, MOST_RADIUS, Reach},
    blocks::{Blocks, note},
    checks,
    lanes::{greater, lesser},
    least::Least,
    scratch::{MARGIN, Scratch, ScratchBand, fit, padded_row},
};

/// How an [`OcclusionFilter`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OcclusionSettings {
    /// How far the rays went, world units: nothing farther occludes.
    pub reach: f32,
    /// Radius of the kernel, as a share of the distance to the nearest occluder around.
    pub width: f32,
    /// How far around a pixel the nearest occluder is looked for, pixels.
    pub search: f32,
    /// The least radius of a kernel where something is near, pixels.
    pub least_radius: f32,
    /// The greatest radius of a kernel, pixels.
    pub most_radius: f32,
    /// Every how many pixels a neighbour counts: 2 for a signal that blocks of 2×2 pixels share, or 1.
    pub spacing: u32,
    /// Which pixels show the same surface.
    pub tolerance: SurfaceTolerance,
}

impl Default for OcclusionSettings {
    fn default() -> Self {
        Self {
            reach: 1.0,
            width: 0.7,
            search: 8.0,
            least_radius: 3.0,
            most_radius: 16.0,
            spacing: 2,
            tolerance: SurfaceTolerance::default(),
        }
    }
}

impl OcclusionSettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        checks::setting("the reach", self.reach, (f32::MIN_POSITIVE, 1e12), "a positive number")?;
        checks::setting("the width", self.width, (0.0, 100.0), "from 0 to 100")?;
        checks::setting("the search", self.search, (0.0, MOST_RADIUS), "from 0 to 32")?;
        checks::setting("the least radius", self.least_radius, (0.0, MOST_RADIUS), "from 0 to 32")?;
        checks::setting("the most radius", self.most_radius, (0.0, MOST_RADIUS), "from 0 to 32")?;
        checks::setting("the spacing", self.spacing as f32, (1.0, 2.0), "1 or 2")?;
        self.tolerance.check()
    }
}

/// Smooths ambient occlusion in space.
#[derive(Clone, Debug)]
pub struct OcclusionFilter {
    isa: IsaLevel,
    value: Scratch,
    distance: Scratch,
    scratch: Scratch,
    blocks: Blocks,
}

impl OcclusionFilter {
    /// A filter for an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        Self {
            isa,
            value: Scratch::default(),
            distance: Scratch::default(),
            scratch: Scratch::default(),
            blocks: Blocks::default(),
        }
    }

    /// Filters the open share of the hemisphere into another plane, which gets its size. `distance` is how
    /// far away each ray's occluder is, world units; infinite where there is none. What is not a number
    /// counts as open.
    pub fn filter(
        &mut self,
        surfaces: &Surfaces,
        open: &Plane,
        distance: &Plane,
        settings: &OcclusionSettings,
        out: &mut Plane,
    ) -> Result<()> {
        settings.check()?;
        surfaces.check("the ambient occlusion", open.size())?;
        surfaces.check("the occluder's distance", distance.size())?;
        fit(out, open.size())?;
        for scratch in [&mut self.value, &mut self.distance, &mut self.scratch] {
            scratch.resize(open.size(), 1);
        }
        let (isa, factors) = (self.isa, settings.tolerance.factors());
        self.blocks.resize(open.size());
        let bands = self.value.bands_mut().zip(self.blocks.kinds_mut());
        bands.for_each(|(band, kinds)| isa.dispatch(Open { open, band, kinds }));
        self.blocks.classify(settings.search.max(settings.most_radius).max(settings.least_radius));
        let blocks = &self.blocks;
        let OcclusionSettings { reach, width, .. } = *settings;
        self.distance
            .bands_mut()
            .for_each(|band| isa.dispatch(Lengths { distance, reach, width, band }));
        // The nearest of every second pixel is near enough.
        let (stride, taps) = (2, (settings.search / 2.0) as usize);
        let pass = |axis, input: &Scratch, out: &mut Scratch| {
            out.bands_mut().for_each(|band| {
                isa.dispatch(Least { surfaces, factors, axis, stride, taps, blocks, input, band });
            });
        };
        pass(0, &self.distance, &mut self.scratch);
        pass(1, &self.scratch, &mut self.distance);
        let reach = Reach::World {
            lengths: &self.distance,
            most: settings.most_radius,
            least: settings.least_radius,
        };
        let pass = |axis, input: &Scratch, out: &mut Scratch| {
            out.bands_mut().for_each(|band| {
                let stride = settings.spacing as usize;
                let pass =
                    Bilateral::<1> { surfaces, factors, axis, stride, reach, blocks, input, band };
                isa.dispatch(pass);
            });
        };
        pass(0, &self.value, &mut self.scratch);
        pass(1, &self.scratch, &mut self.value);
        self.value.copy_to(0, out);
        Ok(())
    }
}

/// Takes the open share.
struct Open<'a> {
    open: &'a Plane,
    band: ScratchBand<'a>,
    kinds: &'a mut [u8],
}

impl Kernel for Open<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for y in self.band.rows() {
            let open = padded_row(self.open, y);
            let out = &mut self.band.row_mut(y, 0)[MARGIN..][..open.len()];
            for x in 0..open.len() {
                out[x] = greater(lesser(open[x], 1.0), 0.0);
            }
            note(self.kinds, &out[..self.open.width() as usize]);
            self.band.extend(y);
        }
    }
}

/// Makes radii of kernels of the distances.
struct Lengths<'a> {
    distance: &'a Plane,
    reach: f32,
    width: f32,
    band: ScratchBand<'a>,
}

impl Kernel for Lengths<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let (reach, width) = (self.reach, self.width);
        for y in self.band.rows() {
            let distance = padded_row(self.distance, y);
            let out = &mut self.band.row_mut(y, 0)[MARGIN..][..distance.len()];
            for x in 0..distance.len() {
                let met = greater(lesser(distance[x], reach), 0.0);
                out[x] = width * greater(met, 1e-6 * reach);
            }
            self.band.extend(y);
        }
    }
}
