//! A batch: the eye rays of one tile's samples, and what becomes of them.

use rayburst_image::{FilmTile, PixelFilter};
use rayburst_math::{
    Ray, RayCone, Sampler,
    glam::{Vec2, Vec3},
    hash,
};
use rayburst_scene::{Camera, FlatScene, Projection};

use crate::{Features, RayCounts, RenderSettings, dimensions};

/// What all batches of a render share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Context<'a> {
    pub(crate) scene: &'a FlatScene,
    pub(crate) camera: &'a Camera,
    pub(crate) settings: &'a RenderSettings,
    pub(crate) filter: &'a PixelFilter,
}

/// Eye rays in slots, and per slot what the integrator finds. Allocated once a worker.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub(crate) rays: Vec<Ray>,
    pub(crate) cones: Vec<RayCone>,
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
        self.cones.clear();
        self.samplers.clear();
        self.keys.clear();
        for i in pixels {
            let (x, y) = tile.position(i);
            let first = tile.pixel(i).taken();
            for sample in first..first + samples {
                let eye = EyeRay::new(context, x, y, sample);
                self.rays.push(eye.ray);
                self.cones.push(eye.cone);
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
    pub(crate) cone: RayCone,
    pub(crate) sampler: Sampler,
    pub(crate) key: u32,
}

impl EyeRay {
    #[inline]
    pub(crate) fn new(context: &Context<'_>, x: u32, y: u32, sample: u32) -> Self {
        let settings = context.settings;
        let (width, height) = settings.size;
        let pixel = y * width + x;
        let sampler = Sampler::new(settings.sampler, settings.seed, pixel, sample);
        let offset = context.filter.sample(sampler.get_2d(dimensions::FILTER));
        let position = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + offset;
        let lens = sampler.get_2d(dimensions::LENS);
        let (ray, cone) = camera_ray(context.camera, position, (width, height), lens);
        Self { ray, cone, sampler, key: hash::words(&[settings.seed, pixel, sample]) }
    }
}

pub(crate) fn camera_ray(
    camera: &Camera,
    pixel: Vec2,
    size: (u32, u32),
    _lens: Vec2,
) -> (Ray, RayCone) {
    let (height, size) = (size.1, Vec2::new(size.0 as f32, size.1 as f32));
    let ndc = Vec2::new(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y);
    let aspect = size.x / size.y;
    match camera.projection {
        Projection::Perspective { fov } => {
            let f = (0.5 * fov).tan();
            let d = Vec3::new(ndc.x * f * aspect, ndc.y * f, -1.0).normalize();
            let origin = Vec3::from(camera.transform.translation);
            (
                Ray::new(origin, camera.transform.transform_vector3(d)),
                RayCone::of_pixel(fov, height),
            )
        }
        Projection::Orthographic { half_height } => {
            let o = Vec3::new(ndc.x * half_height * aspect, ndc.y * half_height, 0.0);
            let ray = Ray::new(
                camera.transform.transform_point3(o),
                camera.transform.transform_vector3(-Vec3::Z),
            );
            (ray, RayCone { width: 2.0 * half_height / size.y, spread: 0.0 })
        }
    }
}
