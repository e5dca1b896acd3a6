//! Whitted's ray tracing: perfect reflection and refraction, sharp shadows (chapter 26.1, Fig. 26.3).
//!
//! Whitted: "An Improved Illumination Model for Shaded Display", CACM 1980. Every surface is lit by
//! point lights through one shadow ray each; mirrors and glass send on a reflected and a refracted ray,
//! both entries of the next queue. Branches that carry less than [`FAINT`] end (Hall, Greenberg: "A
//! Testbed for Realistic Image Synthesis", 1983). What we make of the rest, without randomness:
//! - Each emitting mesh is a point light, see [`PointLights`]; suns are points in the sky.
//! - Rough metals and coats show lights as highlights; only smooth ones reflect the scene.
//! - The environment lights surfaces evenly, without shadows (Whitted's ambient term), and is seen
//!   directly, in mirrors and through glass.

use rayburst_math::{Ray, glam::Vec3};
use rayburst_scene::bsdf::SpecularPath;

use super::{
    point_lights::PointLights,
    queue::{PathState, Queue, Queues, ray_key, shadow_key},
};
use crate::{
    Features, RayFootprint,
    batch::{Batch, Context},
    footprint::{Arrival, Turn},
};

/// Branches of a lower throughput end.
const FAINT: f32 = 1.0 / 512.0;

/// Shadow rays of a generation, and where they lead.
#[derive(Debug, Default)]
pub(super) struct Shadows {
    queue: Queue,
    /// The light that each ray goes to.
    lights: Vec<u32>,
}

pub(super) fn integrate(
    context: &Context<'_>,
    batch: &mut Batch,
    queues: &mut Queues,
    shadows: &mut Shadows,
) {
    let lights = context.point_lights;
    queues.current.start(batch);
    for depth in 1..=context.settings.max_depth {
        if queues.current.is_empty() {
            break;
        }
        queues.current.trace(context);
        let Queues { current, next, .. } = queues;
        for i in 0..current.len() {
            vertex(context, lights, depth, batch, current, i, next, shadows);
        }
        shadows.queue.trace(context);
        batch.counts.shadow += shadows.queue.len() as u64;
        for (i, &light) in shadows.lights.iter().enumerate() {
            let path = &shadows.queue.paths[i];
            if lights.is_reached(light, &shadows.queue.hits[i]) {
                batch.radiance[path.slot as usize] += path.throughput;
            }
        }
        shadows.queue.clear();
        shadows.lights.clear();
        queues.advance(batch);
    }
}

/// One surface: what it emits, shadow rays to all lights, and the next rays.
fn vertex(
    context: &Context<'_>,
    lights: &PointLights,
    depth: u32,
    batch: &mut Batch,
    current: &Queue,
    i: usize,
    next: &mut Queue,
    shadows: &mut Shadows,
) {
    let &Context { scene, settings, .. } = context;
    let (ray, hit, path) = (&current.rays[i], &current.hits[i], &current.paths[i]);
    let slot = path.slot as usize;
    if !hit.is_hit() {
        let sky = context.lights.environment_radiance(scene, ray.direction)
            + context.lights.sun_radiance(scene, ray.direction);
        batch.radiance[slot] += path.throughput * sky;
        return;
    }
    let surface = scene.surface(hit);
    let footprint = current.footprints.get(i);
    let seen = footprint.at(ray, hit, &surface);
    let point = scene.shading_point(&surface, -ray.direction, seen, &settings.shading());
    if depth == 1
        && let Some(features) = batch.features.get_mut(slot)
    {
        *features = Features::new(ray, hit, &surface, &point);
    }
    batch.radiance[slot] += path.throughput * point.emitted;
    if depth >= settings.max_depth {
        return;
    }
    let wo = point.frame.to_local(-ray.direction);
    let reflected = point.bsdf.specular_reflection(wo);
    let refracted = point.bsdf.specular_refraction(wo);
    if !point.bsdf.is_delta() {
        let mirrored = reflected.map_or(Vec3::ZERO, |path| path.weight);
        let ambient = (point.bsdf.albedo(wo) - mirrored).max(Vec3::ZERO) * lights.ambient;
        batch.radiance[slot] += path.throughput * ambient;
        for (light, arrival) in lights.seen_from(surface.position) {
            let wi = point.frame.to_local(arrival.direction);
            let radiance = path.throughput * point.bsdf.evaluate(wo, wi) * arrival.illuminance;
            if radiance != Vec3::ZERO {
                let origin = surface.spawn(arrival.direction);
                let ray = Ray::with_interval(origin, arrival.direction, 0.0, arrival.distance);
                let state = PathState { throughput: radiance, ..*path };
                let key = shadow_key(batch.keys[slot], depth);
                shadows.queue.push(ray, state, &RayFootprint::None, key);
                shadows.lights.push(light);
            }
        }
    }
    for SpecularPath { wi, weight } in [reflected, refracted].into_iter().flatten() {
        let throughput = path.throughput * weight;
        if throughput.max_element() < FAINT {
            continue;
        }
        let direction = point.frame.to_world(wi);
        let turn = Turn::specular(&point, direction, wi.z < 0.0);
        let arrival = Arrival { scene, ray, hit, surface: &surface };
        let footprint = footprint.turned(&arrival, &turn);
        let state = PathState { throughput, ..*path };
        next.push(
            Ray::new(surface.spawn(direction), direction),
            state,
            &footprint,
            ray_key(batch.keys[slot], depth + 1),
        );
    }
}
