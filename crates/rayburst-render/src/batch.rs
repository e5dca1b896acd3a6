//! A batch: the eye rays of one tile's samples, and what becomes of them.

use rayburst_image::{FilmTile, PixelFilter};
use rayburst_math::{
    Ray, Sampler,
    glam::{Vec2, Vec3},
    hash,
};
use rayburst_scene::{Camera, FlatScene, LightSampler};

use crate::{
    Features, RayCounts, RayFootprint, RenderSettings, dimensions, footprint::Footprints,
    integrators::PointLights,
};

/// What all batches of a render share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Context<'a> {
    pub(crate) scene: &'a FlatScene,
    /// Whether all of it is opaque, so that no ray needs a filter.
    pub(crate) opaque: bool,
    pub(crate) camera: &'a Camera,
    pub(crate) lights: &'a LightSampler,
    /// All lights as points, for the integrator that wants them so.
    pub(crate) point_lights: &'a PointLights,
    pub(crate) settings: &'a RenderSettings,
    pub(crate) filter: &'a PixelFilter,
}

/// Eye rays in slots, and per slot what the integrator finds. Allocated once a worker.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub(crate) rays: Vec<Ray>,
    pub(crate) footprints: Footprints,
    pub(crate) samplers: Vec<Sampler>,
    /// A hash of seed, pixel and sample: the root of each path's alpha decisions.
    pub(crate) keys: Vec<u32>,
    /// What the samples see.
    pub(crate) radiance: Vec<Vec3>,
    /// What the AOVs need; empty if there are none.
    pub(crate) features: Vec<Features>,
    pub(crate) counts: RayCounts,
}

impl Batch {
    /// Number of slots.
    pub(crate) fn len(&self) -> usize {
        self.rays.len()
    }

    /// Fills the batch with the next `samples` samples of the tile's pixels `pixels`; slots run
    /// through the samples of a pixel, then to the next pixel.
    pub(crate) fn generate(
        &mut self,
        context: &Context<'_>,
        tile: &FilmTile<'_>,
        pixels: std::ops::Range<usize>,
        samples: u32,
    ) {
        self.rays.clear();
        self.footprints.clear();
        self.samplers.clear();
        self.keys.clear();
        for i in pixels {
            let (x, y) = tile.position(i);
            let first = tile.pixel(i).taken();
            for sample in first..first + samples {
                let eye =
                    EyeRay::new(context.camera, context.settings, context.filter, (x, y), sample);
                self.rays.push(eye.ray);
                self.footprints.push(&eye.footprint);
                self.samplers.push(eye.sampler);
                self.keys.push(eye.key);
            }
        }
        self.radiance.clear();
        self.radiance.resize(self.rays.len(), Vec3::ZERO);
        self.features.clear();
        if !context.settings.aovs.is_empty() {
            self.features.resize(self.rays.len(), Features::MISS);
        }
        self.counts.camera += self.rays.len() as u64;
    }
}

/// One sample's ray from the eye, with its randomness.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EyeRay {
    pub(crate) ray: Ray,
    pub(crate) footprint: RayFootprint,
    pub(crate) sampler: Sampler,
    pub(crate) key: u32,
}

impl EyeRay {
    #[inline]
    pub(crate) fn new(
        camera: &Camera,
        settings: &RenderSettings,
        filter: &PixelFilter,
        (x, y): (u32, u32),
        sample: u32,
    ) -> Self {
        let (width, height) = settings.size;
        let pixel = y * width + x;
        let sampler = Sampler::at(settings.sampler, settings.seed, (x, y), width, sample);
        let offset = filter.sample(sampler.get_2d(dimensions::FILTER));
        let position = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + offset;
        let lens = sampler.get_2d(dimensions::LENS);
        let (ray, cone) = camera.ray(position, (width, height), lens);
        let lod = settings.texture_lod;
        let footprint = RayFootprint::of_eye(lod, camera, position, (width, height), lens, cone);
        Self { ray, footprint, sampler, key: hash::words(&[settings.seed, pixel, sample]) }
    }
}
