//! What the passes of a frame share.

use rayburst_math::{Sampler, hash};
use rayburst_scene::{FlatScene, ShadingOptions};

use super::{
    gbuffer::BAND,
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
