//! Soft shadows of one ray a pixel are smoothed as far as their penumbrae are wide.
//!
//! A light of an apparent size s throws a penumbra of width s·d behind a blocker at distance d, so shadows
//! are hard where things touch and soft farther on. The mean of that width over the blocked rays around a
//! pixel is the penumbra's estimate (Fernando: "Percentage-Closer Soft Shadows", 2005), and the kernel is a
//! share of it (Mehta, Wang, Ramamoorthi: "Axis-Aligned Filtering for Interactive Sampled Soft Shadows",
//! SIGGRAPH Asia 2012): two passes of a cross-bilateral filter of variable radius (Liu et al.:
//! "Cinematic Rendering in UE4 with Real-Time Ray Tracing and Denoising", Ray Tracing Gems 2019).
//!
//! Where only lit or only blocked rays are around, nothing is changed.

use rayburst_image::Plane;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Result, SurfaceTolerance, Surfaces,
    bilateral::{Bilateral, MOST_RADIUS, Reach},
    blocks::{Blocks, note},
    checks,
    lanes::{greater, lesser},
    scratch::{MARGIN, Scratch, ScratchBand, fit, padded_row},
};

/// Diameter of a light over its distance, as the surface sees it: twice the tangent of half its angle.
#[derive(Clone, Copy, Debug)]
pub enum LightSize<'a> {
    /// One for all pixels: the sun.
    Everywhere(f32),
    /// One for each pixel.
    PerPixel(&'a Plane),
}

/// How a [`ShadowFilter`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowSettings {
    /// Radius of the kernel, as a share of the penumbra's width.
    pub width: f32,
    /// How far around a pixel blocked rays are looked for, pixels.
    pub search: f32,
    /// The greatest radius of a kernel, pixels.
    pub most_radius: f32,
    /// Which pixels show the same surface.
    pub tolerance: SurfaceTolerance,
}

impl Default for ShadowSettings {
    fn default() -> Self {
        let tolerance = SurfaceTolerance::default();
        Self { width: 0.45, search: 16.0, most_radius: 16.0, tolerance }
    }
}

impl ShadowSettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        checks::setting("the width", self.width, (0.0, 100.0), "from 0 to 100")?;
        checks::setting("the search", self.search, (0.0, MOST_RADIUS), "from 0 to 32")?;
        checks::setting("the most radius", self.most_radius, (0.0, MOST_RADIUS), "from 0 to 32")?;
        self.tolerance.check()
    }
}

/// Smooths shadows in space.
#[derive(Clone, Debug)]
pub struct ShadowFilter {
    isa: IsaLevel,
    value: Scratch,
    scratch: Scratch,
    blocked: [Scratch; 2],
    lengths: Scratch,
    blocks: Blocks,
}

impl ShadowFilter {
    /// A filter for an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        Self {
            isa,
            value: Scratch::default(),
            scratch: Scratch::default(),
            blocked: [Scratch::default(), Scratch::default()],
            lengths: Scratch::default(),
            blocks: Blocks::default(),
        }
    }

    /// Filters the share of a light that is seen into another plane, which gets its size. `distance` is how
    /// far away each ray's blocker is, world units; infinite where there is none. What is not a number
    /// counts as lit.
    pub fn filter(
        &mut self,
        surfaces: &Surfaces,
        seen: &Plane,
        distance: &Plane,
        light: LightSize<'_>,
        settings: &ShadowSettings,
        out: &mut Plane,
    ) -> Result<()> {
        settings.check()?;
        let size = seen.size();
        surfaces.check("the shadow", size)?;
        surfaces.check("the blocker's distance", distance.size())?;
        match light {
            LightSize::Everywhere(size) => {
                checks::setting("the light's size", size, (0.0, 1e6), "not negative")?;
            }
            LightSize::PerPixel(plane) => surfaces.check("the light's size", plane.size())?,
        }
        fit(out, size)?;
        self.resize(size);
        let isa = self.isa;
        let bands = self.value.bands_mut().zip(self.blocked[0].bands_mut());
        bands.zip(self.blocks.kinds_mut()).for_each(|((value, blocked), kinds)| {
            isa.dispatch(Take { seen, distance, light, value, blocked, kinds });
        });
        self.blocks.classify(settings.search.max(settings.most_radius));
        let [near, far] = &mut self.blocked;
        let factors = settings.tolerance.factors();
        let blocks = &self.blocks;
        let reach = Reach::Pixels(settings.search);
        let pass = |axis, input: &Scratch, out: &mut Scratch| {
            out.bands_mut().for_each(|band| {
                let stride = 2;
                let pass =
                    Bilateral::<2> { surfaces, factors, axis, stride, reach, blocks, input, band };
                isa.dispatch(pass);
            });
        };
        pass(0, near, far);
        pass(1, far, near);
        let (blocked, width) = (&*near, settings.width);
        self.lengths.bands_mut().for_each(|band| isa.dispatch(Lengths { blocked, width, band }));
        let reach = Reach::World { lengths: &self.lengths, most: settings.most_radius, least: 0.0 };
        let pass = |axis, input: &Scratch, out: &mut Scratch| {
            out.bands_mut().for_each(|band| {
                let stride = 1;
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

    fn resize(&mut self, size: (u32, u32)) {
        for scratch in [&mut self.value, &mut self.scratch, &mut self.lengths] {
            scratch.resize(size, 1);
        }
        for scratch in &mut self.blocked {
            scratch.resize(size, 2);
        }
        self.blocks.resize(size);
    }
}

/// Takes what is seen, and of the blocked rays the widths of their penumbrae.
struct Take<'a> {
    seen: &'a Plane,
    distance: &'a Plane,
    light: LightSize<'a>,
    value: ScratchBand<'a>,
    /// Width times blocked share, and blocked share.
    blocked: ScratchBand<'a>,
    kinds: &'a mut [u8],
}

/// Wider penumbrae are no wider than this, world units.
const WIDEST: f32 = 1e12;

impl Kernel for Take<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let width = self.seen.width() as usize;
        for y in self.value.rows() {
            let seen = padded_row(self.seen, y);
            let distance = padded_row(self.distance, y);
            let value = &mut self.value.row_mut(y, 0)[MARGIN..][..seen.len()];
            for x in 0..seen.len() {
                value[x] = greater(lesser(seen[x], 1.0), 0.0);
            }
            note(self.kinds, &value[..width]);
            let share = &mut self.blocked.row_mut(y, 1)[MARGIN..][..seen.len()];
            for x in 0..seen.len() {
                let blocked = distance[x] > 0.0 && distance[x] < WIDEST;
                share[x] = if blocked { 1.0 - value[x] } else { 0.0 };
            }
            let widths = &mut self.blocked.row_mut(y, 0)[MARGIN..][..seen.len()];
            for x in 0..seen.len() {
                let blocked = distance[x] > 0.0 && distance[x] < WIDEST;
                widths[x] = if blocked { (1.0 - value[x]) * distance[x] } else { 0.0 };
            }
            match self.light {
                LightSize::Everywhere(size) => {
                    for x in 0..widths.len() {
                        widths[x] = lesser(widths[x] * size, WIDEST);
                    }
                }
                LightSize::PerPixel(plane) => {
                    let sizes = padded_row(plane, y);
                    for x in 0..widths.len() {
                        widths[x] = lesser(widths[x] * greater(sizes[x], 0.0), WIDEST);
                    }
                }
            }
            self.value.extend(y);
            self.blocked.extend(y);
        }
    }
}

/// Makes radii of kernels of the penumbrae.
struct Lengths<'a> {
    blocked: &'a Scratch,
    width: f32,
    band: ScratchBand<'a>,
}

impl Kernel for Lengths<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for y in self.band.rows() {
            let (widths, share) = (self.blocked.row(y, 0), self.blocked.row(y, 1));
            let out = self.band.row_mut(y, 0);
            for x in 0..out.len() {
                let penumbra = widths[x] / greater(share[x], 1e-6);
                out[x] = self.width * penumbra;
            }
        }
    }
}
