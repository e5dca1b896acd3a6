//! What the passes of a frame share.

use rayburst_math::{
    Sampler, hash,
    lanes::{LANES, Sampler16},
};
use rayburst_scene::{FlatScene, ShadingOptions};
use rayburst_simd::IsaLevel;

use super::{
    gbuffer::{BAND, Pixels},
    lights::{FrameLights, TileLights},
    settings::FrameSettings,
    view::FrameView,
};
use crate::RayFootprint;

/// A frame, for passes that trace.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameContext<'a> {
    pub(crate) scene: &'a FlatScene,
    /// Whether all of it is opaque, so that no ray needs a filter.
    pub(crate) opaque: bool,
    pub(crate) view: &'a FrameView,
    pub(crate) lights: &'a FrameLights,
    pub(crate) settings: &'a FrameSettings,
    pub(crate) shading: ShadingOptions,
    /// The same for hits beyond the first.
    pub(crate) path_shading: ShadingOptions,
    /// The polygon lights of each square of pixels.
    pub(crate) tiles: &'a [TileLights],
    /// Number of the frame since the history began.
    pub(crate) number: u32,
}

impl FrameContext<'_> {
    /// The random numbers of a pixel.
    #[inline]
    pub(crate) fn sampler(&self, (x, y): (u32, u32)) -> Sampler {
        let settings = self.settings;
        let block = settings.interleave;
        let at = if block > 1 { (x % block, y % block) } else { (x, y) };
        Sampler::at(settings.sampler, settings.seed, at, self.view.size().0, self.number)
    }

    /// The random numbers of sixteen pixels.
    #[inline(always)]
    pub(crate) fn samplers(&self, pixels: &Pixels) -> Sampler16 {
        let settings = self.settings;
        let (mut x, mut y) = (pixels.x, pixels.y);
        if settings.interleave > 1 {
            for lane in 0..LANES {
                (x[lane], y[lane]) = (x[lane] % settings.interleave, y[lane] % settings.interleave);
            }
        }
        let (kind, seed) = (settings.sampler, settings.seed);
        Sampler16::at(kind, seed, x, y, self.view.size().0, self.number)
    }

    /// The number of the square that a pixel is in.
    #[inline]
    pub(crate) fn tile(&self, (x, y): (u32, u32)) -> u32 {
        y / BAND * self.view.size().0.div_ceil(BAND) + x / BAND
    }

    /// Whether a triangle is of a polygon light that has a closed form in a square.
    #[inline]
    pub(crate) fn is_analytic(&self, tile: u32, triangle: [u32; 3]) -> bool {
        self.tiles.get(tile as usize).is_some_and(|t| t.hold(&self.lights.polygons, triangle))
    }

    /// What a pixel sees at the eye.
    #[inline]
    pub(crate) fn eye_footprint(&self, at: (u32, u32)) -> RayFootprint {
        self.view.footprint(self.settings.texture_lod, at)
    }

    /// The root of a pixel's alpha decisions.
    #[inline]
    pub(crate) fn key(&self, (x, y): (u32, u32)) -> u32 {
        pixel_key(self.settings.seed, (x, y), self.number)
    }
}

/// The root of the alpha decisions of a pixel in a frame.
#[inline]
pub(crate) fn pixel_key(seed: u32, (x, y): (u32, u32), frame: u32) -> u32 {
    hash::words(&[seed, x, y, frame])
}

/// The instruction set that a scene is traced with.
pub(crate) fn isa_of(scene: &FlatScene) -> IsaLevel {
    scene.tlas.blases().first().map_or_else(IsaLevel::detect, |blas| blas.isa())
}
