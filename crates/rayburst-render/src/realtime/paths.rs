//! Paths that go on from the first hits: what light comes along sampled rays.
//!
//! The estimator is that of the path tracer from its second vertex on; how the first ray was chosen, and
//! what its light is divided by, the passes decide that start paths.

use rayburst_math::{Hit, Ray, Sampler, glam::Vec3};
use rayburst_scene::BsdfSample;

use super::{
    pass::FrameContext,
    shadows::{ShadowRays, closest_hits},
};
use crate::{
    LightSampling, RayCounts,
    dimensions::Vertex,
    estimator,
    footprint::{Arrival, RayFootprint, Turn},
    integrators::{ray_key, shadow_key},
};

/// A path's next ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathRay {
    /// Factor between radiance at the ray's end and its share of the slot.
    pub(crate) throughput: Vec3,
    /// What it adds to.
    pub(crate) slot: u32,
    /// What a pixel sees at the ray's origin.
    pub(crate) footprint: RayFootprint,
    /// Density of the direction; infinite if nothing but this ray finds what is there.
    pub(crate) pdf: f32,
    /// Whether all before were perfect mirrors and glass.
    pub(crate) specular: bool,
    pub(crate) sampler: Sampler,
    /// The root of the path's alpha decisions.
    pub(crate) key: u32,
    /// The square whose polygon lights have a closed form.
    pub(crate) tile: u32,
    /// Whether that does not hold for the lobe that the first ray left by: it finds these lights, and
    /// nothing else does.
    pub(crate) sharp: bool,
}

/// What a path brought back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathResult {
    pub(crate) radiance: Vec3,
    /// Length of the first ray; infinite if it left the scene.
    pub(crate) distance: f32,
    /// Factor on the light that would have come by longer paths.
    pub(crate) tail: Vec3,
}

impl PathResult {
    const NONE: Self = Self { radiance: Vec3::ZERO, distance: f32::INFINITY, tail: Vec3::ZERO };
}

/// Paths of a band.
#[derive(Debug, Default)]
pub(crate) struct Paths {
    rays: Vec<Ray>,
    states: Vec<PathRay>,
    keys: Vec<u32>,
    hits: Vec<Hit>,
    next_rays: Vec<Ray>,
    next_states: Vec<PathRay>,
    shadows: ShadowRays<(Vec3, u32)>,
    /// One a slot.
    pub(crate) results: Vec<PathResult>,
}

impl Paths {
    pub(crate) fn clear(&mut self) {
        self.rays.clear();
        self.states.clear();
        self.results.clear();
    }

    /// Starts a path in a slot of its own.
    #[inline]
    pub(crate) fn start(&mut self, ray: Ray, state: PathRay) {
        self.rays.push(ray);
        self.states.push(PathRay { slot: self.results.len() as u32, ..state });
        self.results.push(PathResult::NONE);
    }

    /// Follows all paths to their ends; their first rays have depth 2. Returns the rays it took.
    pub(crate) fn run(&mut self, frame: &FrameContext<'_>) -> RayCounts {
        let mut counts = RayCounts::default();
        for depth in 2..=frame.settings.max_depth {
            if self.rays.is_empty() {
                break;
            }
            counts.indirect += self.rays.len() as u64;
            self.keys.clear();
            self.keys.extend(self.states.iter().map(|state| ray_key(state.key, depth)));
            closest_hits(frame.scene, frame.opaque, &self.rays, &self.keys, &mut self.hits);
            for i in 0..self.rays.len() {
                self.vertex(frame, depth, i);
            }
            let results = &mut self.results;
            counts.shadow += self.shadows.resolve(
                frame.scene,
                frame.opaque,
                |(radiance, slot): (Vec3, u32), visible| {
                    if visible {
                        results[slot as usize].radiance += radiance;
                    }
                },
            );
            std::mem::swap(&mut self.rays, &mut self.next_rays);
            std::mem::swap(&mut self.states, &mut self.next_states);
            self.next_rays.clear();
            self.next_states.clear();
        }
        self.rays.clear();
        self.states.clear();
        counts
    }

    #[inline]
    fn vertex(&mut self, frame: &FrameContext<'_>, depth: u32, i: usize) {
        let &FrameContext { scene, lights, settings, .. } = frame;
        let (ray, hit, path) = (&self.rays[i], &self.hits[i], &self.states[i]);
        let result = &mut self.results[path.slot as usize];
        // What else could have found what is here: what the first hit asked for, or a later one.
        let sampler = if depth == 2 { &lights.primary } else { &lights.all };
        let both = LightSampling::Both;
        if !hit.is_hit() {
            let radiance = lights.all.environment_radiance(scene, ray.direction);
            if radiance != Vec3::ZERO {
                let alone = depth == 2 && !settings.passes.direct;
                let weight = if alone {
                    1.0
                } else {
                    estimator::found_weight(both, path.pdf, || {
                        sampler.environment_pdf(scene, ray.direction)
                    })
                };
                result.radiance += path.throughput * radiance * weight;
            }
            if path.specular {
                result.radiance += path.throughput * lights.all.sun_radiance(scene, ray.direction);
            }
            return;
        }
        if depth == 2 {
            result.distance = hit.t;
        }
        let surface = scene.surface(hit);
        let wo = -ray.direction;
        let seen = path.footprint.at(ray, hit, &surface);
        let point = scene.shading_point(&surface, wo, seen, &frame.path_shading);
        let triangle = [hit.instance, hit.geometry, hit.primitive];
        let closed_form = depth == 2 && frame.is_analytic(path.tile, triangle);
        if point.emitted != Vec3::ZERO && (!closed_form || path.sharp) {
            let alone = closed_form || (depth == 2 && !settings.passes.direct);
            let weight = if alone {
                1.0
            } else {
                estimator::found_weight(both, path.pdf, || {
                    sampler.emitter_pdf(scene, hit, ray.origin, ray.direction)
                })
            };
            result.radiance += path.throughput * point.emitted * weight;
        }
        if depth >= settings.max_depth {
            return;
        }
        let numbers = Vertex::at_depth(depth);
        // At the last vertex but one a ray of the BSDF would only find again what the shadow ray asks for.
        let last = depth + 1 == settings.max_depth && !point.bsdf.has_delta();
        if !point.bsdf.is_delta() {
            let u = path.sampler.get_2d(numbers.light_point());
            let choice = path.sampler.get_1d(numbers.light_choice());
            if let Some(light) = lights.all.sample(scene, &surface, choice, u) {
                let (f, pdf) = point.evaluate(wo, light.direction);
                let weight = if last { 1.0 } else { estimator::sampled_weight(both, &light, pdf) };
                let radiance = path.throughput * f * light.radiance * (weight / light.pdf);
                if radiance.max_element() > 0.0 && radiance.is_finite() {
                    let origin = surface.spawn(light.direction);
                    let shadow = Ray::with_interval(origin, light.direction, 0.0, light.distance);
                    let key = shadow_key(path.key, depth);
                    self.shadows.push(shadow, key, (radiance, path.slot));
                }
            }
        }
        if last {
            let wo = point.frame.to_local(wo);
            result.tail += path.throughput * point.bsdf.albedo(wo);
            return;
        }
        let direction = path.sampler.get_2d(numbers.direction());
        let u = direction.extend(path.sampler.get_1d(numbers.lobe()));
        let Some(sample) = point.sample(wo, u) else { return };
        let mut throughput = path.throughput * sample.weight;
        if depth >= estimator::ROULETTE_DEPTH {
            let survival = estimator::survival(throughput);
            if path.sampler.get_1d(numbers.survival()) >= survival {
                return;
            }
            throughput /= survival;
        }
        if throughput == Vec3::ZERO {
            return;
        }
        let arrival = Arrival { scene, ray, hit, surface: &surface };
        let state = PathRay {
            throughput,
            footprint: path.footprint.turned(&arrival, &Turn::of_sample(&point, &sample)),
            pdf: density(&sample),
            specular: path.specular && sample.delta,
            ..*path
        };
        self.next_rays.push(Ray::new(surface.spawn(sample.wi), sample.wi));
        self.next_states.push(state);
    }
}

/// The density of a sample's direction as [`PathRay::pdf`] has it.
#[inline]
pub(crate) fn density(sample: &BsdfSample) -> f32 {
    if sample.delta { f32::INFINITY } else { sample.pdf }
}
