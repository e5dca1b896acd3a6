//! Path tracing: one random path a sample, averaged (chapter 26.1, Fig. 26.5).
//!
//! Kajiya: "The Rendering Equation", SIGGRAPH 1986. At each vertex one light is sampled (next-event
//! estimation) and one direction of the BSDF; both find light, weighted by the balance heuristic
//! (Veach, Guibas: "Optimally Combining Sampling Techniques for Monte Carlo Rendering", SIGGRAPH
//! 1995). Weak paths end by Russian roulette (Arvo, Kirk: "Particle Transport and Image Synthesis",
//! SIGGRAPH 1990). `crate::reference` is the same estimator, one ray at a time.

use rayburst_math::{Ray, glam::Vec3};

use super::queue::{PathState, Queue, Queues, ShadowQueue, ray_key, shadow_key};
use crate::{
    Features,
    batch::{Batch, Context},
    dimensions::Vertex,
    estimator,
    footprint::{Arrival, Turn},
};

/// How far light may travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// Along whole paths.
    All,
    /// To the first surface that scatters, perhaps by way of mirrors and glass.
    Direct,
}

pub(super) fn integrate(context: &Context<'_>, batch: &mut Batch, queues: &mut Queues) {
    transport(context, batch, queues, Reach::All);
}

pub(super) fn transport(
    context: &Context<'_>,
    batch: &mut Batch,
    queues: &mut Queues,
    reach: Reach,
) {
    queues.current.start(batch);
    for depth in 1..=context.settings.max_depth {
        if queues.current.is_empty() {
            break;
        }
        queues.current.trace(context);
        let Queues { current, next, shadows } = queues;
        for i in 0..current.len() {
            vertex(context, reach, depth, batch, current, i, next, shadows);
        }
        queues.shadows.resolve(context, batch);
        queues.advance(batch);
    }
}

/// One vertex of one path: what shines there, a shadow ray to a light, and the next ray.
fn vertex(
    context: &Context<'_>,
    reach: Reach,
    depth: u32,
    batch: &mut Batch,
    current: &Queue,
    i: usize,
    next: &mut Queue,
    shadows: &mut ShadowQueue,
) {
    let &Context { scene, lights, settings, .. } = context;
    let (ray, hit, path) = (&current.rays[i], &current.hits[i], &current.paths[i]);
    let slot = path.slot as usize;
    if !hit.is_hit() {
        let radiance = lights.environment_radiance(scene, ray.direction);
        if radiance != Vec3::ZERO {
            let weight = estimator::found_weight(settings.light_sampling, path.pdf, || {
                lights.environment_pdf(scene, ray.direction)
            });
            batch.radiance[slot] += path.throughput * radiance * weight;
        }
        if path.specular {
            batch.radiance[slot] += path.throughput * lights.sun_radiance(scene, ray.direction);
        }
        return;
    }
    let surface = scene.surface(hit);
    let wo = -ray.direction;
    let footprint = current.footprints.get(i);
    let seen = footprint.at(ray, hit, &surface);
    let point = scene.shading_point(&surface, wo, seen, &settings.shading());
    if depth == 1
        && let Some(features) = batch.features.get_mut(slot)
    {
        *features = Features::new(ray, hit, &surface, &point);
    }
    if point.emitted != Vec3::ZERO {
        let weight = estimator::found_weight(settings.light_sampling, path.pdf, || {
            lights.emitter_pdf(scene, hit, ray.origin, ray.direction)
        });
        batch.radiance[slot] += path.throughput * point.emitted * weight;
    }
    let ended = reach == Reach::Direct && path.pdf.is_finite();
    if depth >= settings.max_depth || ended {
        return;
    }
    let numbers = Vertex::at_depth(depth);
    let sampler = &batch.samplers[slot];
    if !point.bsdf.is_delta() {
        let u = sampler.get_2d(numbers.light_point());
        let choice = sampler.get_1d(numbers.light_choice());
        if let Some(light) = lights.sample(scene, &surface, choice, u) {
            let (f, pdf) = point.evaluate(wo, light.direction);
            let weight = estimator::sampled_weight(settings.light_sampling, &light, pdf);
            let radiance = path.throughput * f * light.radiance * (weight / light.pdf);
            if radiance != Vec3::ZERO {
                let origin = surface.spawn(light.direction);
                let shadow = Ray::with_interval(origin, light.direction, 0.0, light.distance);
                let key = shadow_key(batch.keys[slot], depth);
                shadows.push(shadow, radiance, path.slot, key);
            }
        }
    }
    let direction = sampler.get_2d(numbers.direction());
    let u = direction.extend(sampler.get_1d(numbers.lobe()));
    let Some(sample) = point.sample(wo, u) else { return };
    let mut throughput = path.throughput * sample.weight;
    if settings.russian_roulette && depth >= estimator::ROULETTE_DEPTH {
        let survival = estimator::survival(throughput);
        if sampler.get_1d(numbers.survival()) >= survival {
            return;
        }
        throughput /= survival;
    }
    if throughput == Vec3::ZERO {
        return;
    }
    let origin = surface.spawn(sample.wi);
    let state = PathState {
        throughput,
        slot: path.slot,
        pdf: if sample.delta { f32::INFINITY } else { sample.pdf },
        specular: path.specular && sample.delta,
    };
    let arrival = Arrival { scene, ray, hit, surface: &surface };
    let footprint = footprint.turned(&arrival, &Turn::of_sample(&point, &sample));
    next.push(Ray::new(origin, sample.wi), state, &footprint, ray_key(batch.keys[slot], depth + 1));
}
