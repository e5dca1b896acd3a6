//! The readable twin: a path tracer of one ray at a time, as the chapter writes it down.
//!
//! [`Reference::ray_trace_image`] sends rays through each pixel, [`Reference::trace`] finds the nearest
//! hit, [`Reference::shade`] finds its radiance and calls trace() again (chapter 26.1, pseudo-code). It
//! takes the same decisions from the same random numbers as the batched `path` integrator, so each of
//! its samples is that integrator's sample, up to rounding. Nothing here is fast; with
//! [`Reference::exhaustive`] not even the search: every triangle is tested, in `f64`.

use rayburst_image::{PixelFilter, RgbImage};
use rayburst_math::{Hit, Ray, Sampler, glam::Vec3};
use rayburst_scene::{AlphaFilter, Camera, FlatScene, LightSampler};
use rayon::prelude::*;

use crate::{
    LightSampling, RayFootprint, RenderSettings,
    batch::EyeRay,
    dimensions::Vertex,
    estimator::{ROULETTE_DEPTH, survival},
    footprint::{Arrival, Turn},
    integrators::{ray_key, shadow_key},
    naive::trace_naive,
};

/// The reference path tracer.
#[derive(Debug)]
pub struct Reference<'a> {
    scene: &'a FlatScene,
    camera: &'a Camera,
    settings: &'a RenderSettings,
    lights: LightSampler,
    filter: PixelFilter,
    exhaustive: bool,
}

/// What a path remembers of its way.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    sampler: Sampler,
    key: u32,
    /// Of the ray that is on its way; 1 for an eye ray.
    depth: u32,
    throughput: Vec3,
    /// Density of the ray's direction; infinite if there was no choice.
    pdf: f32,
    /// Whether it has met nothing but perfect mirrors and glass.
    specular: bool,
    footprint: RayFootprint,
}

impl<'a> Reference<'a> {
    /// A reference for the `path` integrator with these settings.
    pub fn new(scene: &'a FlatScene, camera: &'a Camera, settings: &'a RenderSettings) -> Self {
        let (lights, filter) = (LightSampler::new(scene), settings.pixel_filter());
        Self { scene, camera, settings, lights, filter, exhaustive: false }
    }

    /// The same without an acceleration structure.
    #[must_use]
    pub fn exhaustive(self) -> Self {
        Self { exhaustive: true, ..self }
    }

    /// The picture: each pixel the mean of its samples.
    pub fn ray_trace_image(&self) -> RgbImage {
        let (width, height) = self.settings.size;
        let mut picture = RgbImage::new(width, height, Vec3::ZERO);
        picture.pixels.par_iter_mut().enumerate().for_each(|(i, pixel)| {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let sum: Vec3 = (0..self.settings.spp).map(|s| self.sample(x, y, s)).sum();
            *pixel = sum / self.settings.spp as f32;
        });
        picture
    }

    /// One sample of one pixel.
    pub fn sample(&self, x: u32, y: u32, sample: u32) -> Vec3 {
        let (ray, way) = self.eye_ray(x, y, sample);
        self.trace(&ray, way)
    }

    /// The ray of one sample of one pixel, and the beginning of its way.
    pub fn eye_ray(&self, x: u32, y: u32, sample: u32) -> (Ray, Way) {
        let EyeRay { ray, footprint, sampler, key } =
            EyeRay::new(self.camera, self.settings, &self.filter, (x, y), sample);
        let way = Way {
            sampler,
            key,
            depth: 1,
            throughput: Vec3::ONE,
            pdf: f32::INFINITY,
            specular: true,
            footprint,
        };
        (ray, way)
    }

    /// The radiance that comes along a ray.
    pub fn trace(&self, ray: &Ray, way: Way) -> Vec3 {
        let hit = self.closest_hit(ray, ray_key(way.key, way.depth));
        if hit.is_hit() {
            return self.shade(ray, &hit, way);
        }
        let (lights, direction) = (&self.lights, ray.direction);
        let sky = lights.environment_radiance(self.scene, direction)
            * self.weight(way.pdf, || lights.environment_pdf(self.scene, direction));
        if way.specular { sky + lights.sun_radiance(self.scene, direction) } else { sky }
    }

    /// The radiance that a surface sends back along the ray that hit it.
    pub fn shade(&self, ray: &Ray, hit: &Hit, way: Way) -> Vec3 {
        let surface = self.scene.surface(hit);
        let seen = way.footprint.at(ray, hit, &surface);
        let shading = self.settings.shading();
        let point = self.scene.shading_point(&surface, -ray.direction, seen, &shading);
        let mut radiance = point.emitted
            * self.weight(way.pdf, || {
                self.lights.emitter_pdf(self.scene, hit, ray.origin, ray.direction)
            });
        if way.depth >= self.settings.max_depth {
            return radiance;
        }
        let (numbers, sampler) = (Vertex::at_depth(way.depth), way.sampler);
        let wo = -ray.direction;

        // Light that is looked for.
        let choice = sampler.get_1d(numbers.light_choice());
        let u = sampler.get_2d(numbers.light_point());
        if let Some(light) = self.lights.sample(self.scene, &surface, choice, u)
            && !point.bsdf.is_delta()
        {
            let (f, pdf) = point.evaluate(wo, light.direction);
            let weight = match self.settings.light_sampling {
                LightSampling::BsdfOnly if !light.delta => 0.0,
                LightSampling::Both if !light.delta => light.pdf / (light.pdf + pdf),
                _ => 1.0,
            };
            let origin = surface.spawn(light.direction);
            let shadow = Ray::with_interval(origin, light.direction, 0.0, light.distance);
            if !self.closest_hit(&shadow, shadow_key(way.key, way.depth)).is_hit() {
                radiance += f * light.radiance * (weight / light.pdf);
            }
        }

        // Light that is met by chance.
        let u = sampler.get_2d(numbers.direction()).extend(sampler.get_1d(numbers.lobe()));
        let Some(sample) = point.sample(wo, u) else { return radiance };
        let mut weight = sample.weight;
        if self.settings.russian_roulette && way.depth >= ROULETTE_DEPTH {
            let survival = survival(way.throughput * weight);
            if sampler.get_1d(numbers.survival()) >= survival {
                return radiance;
            }
            weight /= survival;
        }
        let arrival = Arrival { scene: self.scene, ray, hit, surface: &surface };
        let next = Way {
            depth: way.depth + 1,
            throughput: way.throughput * weight,
            pdf: if sample.delta { f32::INFINITY } else { sample.pdf },
            specular: way.specular && sample.delta,
            footprint: way.footprint.turned(&arrival, &Turn::of_sample(&point, &sample)),
            ..way
        };
        radiance + weight * self.trace(&Ray::new(surface.spawn(sample.wi), sample.wi), next)
    }

    /// The share of light met by chance that was not looked for.
    fn weight(&self, pdf: f32, light_pdf: impl Fn() -> f32) -> f32 {
        match self.settings.light_sampling {
            _ if pdf == f32::INFINITY => 1.0,
            LightSampling::Both => pdf / (pdf + light_pdf()),
            LightSampling::LightOnly if light_pdf() > 0.0 => 0.0,
            LightSampling::LightOnly | LightSampling::BsdfOnly => 1.0,
        }
    }

    fn closest_hit(&self, ray: &Ray, key: u32) -> Hit {
        if self.exhaustive {
            let filter = AlphaFilter::new(self.scene, std::slice::from_ref(&key));
            return trace_naive(self.scene, ray, &filter);
        }
        self.scene.closest_hit(ray, (!self.scene.is_opaque()).then_some(key))
    }
}
