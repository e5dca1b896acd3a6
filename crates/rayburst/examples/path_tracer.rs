//! Path tracing with shaders: a loop in ray generation, shadow rays, surroundings, cut-outs.
//!
//! Kajiya: "The Rendering Equation", SIGGRAPH 1986. Paths are those of the built-in integrator `path`:
//! the same decisions from the same random numbers.

use rayburst::{
    math::{Sampler, hash},
    pipeline::AnyHit,
    prelude::*,
    scene::{Footprint, LightSampler, ShadingOptions, builtin},
};

mod common;

use common::{Eye, Result, arguments, develop, picture, save};

/// The longest path in rays, the eye ray being the first.
const MAX_DEPTH: u32 = 16;
/// From this depth on paths may end by chance.
const ROULETTE_DEPTH: u32 = 4;

// ANCHOR: payloads
/// What a ray of a path carries.
struct Path {
    sampler: Sampler,
    depth: u32,
    /// What the path brings to its pixel so far.
    radiance: Vec3,
    /// Factor between radiance at the ray's end and its share of the pixel.
    throughput: Vec3,
    /// Density with which the ray's direction was chosen; infinite if there was no choice.
    pdf: f32,
    /// Whether the path has met nothing but perfect mirrors and glass.
    specular: bool,
    /// Where the path goes on.
    next: Option<Ray>,
    /// Picks what coverage lets pass.
    key: u32,
}

/// What a shadow ray carries.
struct Shadow {
    lit: bool,
    key: u32,
}
// ANCHOR_END: payloads

// ANCHOR: any_hit
/// Whether a ray passes where a surface is cut out or thin.
fn cut_out(scene: &FlatScene, hit: &AnyHit<'_, Barycentrics, ()>, key: u32) -> AnyHitResult {
    let coverage = scene.coverage(hit.hit());
    let place = [key, hit.instance_index(), hit.geometry_index(), hit.primitive_index()];
    let stops = coverage >= 1.0 || hash::to_unit(hash::words(&place)) < coverage;
    if stops { hit.accept_hit() } else { hit.ignore_hit() }
}
// ANCHOR_END: any_hit

/// The radiance of a scene by so many paths a pixel.
pub(crate) fn render(scene: &Scene, size: (u32, u32), samples: u32) -> Result<RgbImage> {
    let flat = rayburst::flatten(scene)?;
    let eye = Eye::new(rayburst::default_camera(scene, &flat));
    let lights = LightSampler::new(&flat);
    let texels = RwTexture::<Vec3>::new(size.0, size.1);

    let mut table = ShaderTable::new();
    let path_ray = table.ray_type::<Path>("path", 0, 0, 0);
    let shadow_ray = table.ray_type::<Shadow>("shadow", 1, 0, 1);

    // ANCHOR: misses
    table.miss("surroundings", |miss, path: &mut Path| {
        let direction = miss.world_ray().direction;
        let weight = found(path.pdf, || lights.environment_pdf(&flat, direction));
        let sky = lights.environment_radiance(&flat, direction);
        path.radiance += path.throughput * sky * weight;
        if path.specular {
            path.radiance += path.throughput * lights.sun_radiance(&flat, direction);
        }
    });
    table.miss("nothing in between", |_, shadow: &mut Shadow| shadow.lit = true);
    // ANCHOR_END: misses

    let options = ShadingOptions::default();
    let surface = HitGroup::triangles("surface")
        .closest_hit(|hit, path: &mut Path| {
            let ray = hit.world_ray();
            let (surface, wo) = (flat.surface(hit.hit()), -ray.direction);
            let point = flat.shading_point(&surface, wo, Footprint::NONE, &options);
            let (sampler, first) = (path.sampler, 4 + 8 * (path.depth - 1));

            // ANCHOR: met
            // Light that is met by chance.
            let weight =
                found(path.pdf, || lights.emitter_pdf(&flat, hit.hit(), ray.origin, ray.direction));
            path.radiance += path.throughput * point.emitted * weight;
            if path.depth >= MAX_DEPTH {
                return;
            }
            // ANCHOR_END: met

            // ANCHOR: looked_for
            // Light that is looked for.
            let (u, choice) = (sampler.get_2d(first), sampler.get_1d(first + 2));
            if !point.bsdf.is_delta()
                && let Some(light) = lights.sample(&flat, &surface, choice, u)
            {
                let (f, pdf) = point.evaluate(wo, light.direction);
                let weight = if light.delta { 1.0 } else { light.pdf / (light.pdf + pdf) };
                let origin = surface.spawn(light.direction);
                let ray = Ray::with_interval(origin, light.direction, 0.0, light.distance);
                let flags =
                    RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH | RayFlags::SKIP_CLOSEST_HIT_SHADER;
                let key = hash::combine(path.key, !path.depth);
                let mut shadow = Shadow { lit: false, key };
                hit.trace_ray(shadow_ray, flags, 0xFF, &ray, &mut shadow);
                if shadow.lit {
                    path.radiance += path.throughput * f * light.radiance * (weight / light.pdf);
                }
            }
            // ANCHOR_END: looked_for

            // ANCHOR: on
            // Where the path goes on.
            let u = sampler.get_2d(first + 4).extend(sampler.get_1d(first + 6));
            let Some(sample) = point.sample(wo, u) else { return };
            path.throughput *= sample.weight;
            if path.depth >= ROULETTE_DEPTH {
                let survival = path.throughput.max_element().clamp(0.05, 1.0);
                if sampler.get_1d(first + 3) >= survival {
                    return;
                }
                path.throughput /= survival;
            }
            path.pdf = if sample.delta { f32::INFINITY } else { sample.pdf };
            path.specular &= sample.delta;
            if path.throughput != Vec3::ZERO {
                path.next = Some(Ray::new(surface.spawn(sample.wi), sample.wi));
            }
            // ANCHOR_END: on
        })
        .any_hit(|hit, path: &mut Path| cut_out(&flat, hit, hash::combine(path.key, path.depth)));
    // ANCHOR: groups
    let shadow = HitGroup::triangles("shadow")
        .any_hit(|hit, shadow: &mut Shadow| cut_out(&flat, hit, shadow.key));
    table.hit(&surface, ());
    table.hit(&shadow, ());
    // ANCHOR_END: groups

    // ANCHOR: generate
    let generate = table.ray_generation(|launch| {
        let (pixel, size) = (launch.launch_index(), launch.launch_dimensions());
        let mut sum = Vec3::ZERO;
        for sample in 0..samples {
            let (ray, sampler) = eye.ray(pixel, size, sample);
            let mut path = Path {
                sampler,
                depth: 0,
                radiance: Vec3::ZERO,
                throughput: Vec3::ONE,
                pdf: f32::INFINITY,
                specular: true,
                next: Some(ray),
                key: hash::words(&[0, pixel.y * size.x + pixel.x, sample]),
            };
            while let Some(ray) = path.next.take() {
                path.depth += 1;
                launch.trace_ray(path_ray, RayFlags::empty(), 0xFF, &ray, &mut path);
            }
            sum += path.radiance;
        }
        texels.store(pixel.truncate(), sum / samples as f32);
    });
    // ANCHOR_END: generate
    table.build(2)?.dispatch_rays(&flat.tlas, generate, size.0, size.1, 1)?;
    Ok(picture(&texels, size))
}

/// The share of light met by chance that was not looked for: the balance heuristic.
fn found(pdf: f32, light_pdf: impl Fn() -> f32) -> f32 {
    if pdf == f32::INFINITY { 1.0 } else { pdf / (pdf + light_pdf()) }
}

fn main() -> Result<()> {
    let (path, size) = arguments("path_tracer", (400, 400))?;
    let radiance = render(&builtin::build("cornell")?, size, 256)?;
    save(&develop(&radiance), path)
}
