//! Whitted's ray tracing: closest hit shaders trace reflections, refractions and shadows.
//!
//! Whitted: "An Improved Illumination Model for Shaded Display", CACM 1980.

use rayburst::{
    prelude::*,
    scene::{Footprint, LightSampler, ShadingOptions, ShadingPoint, builtin},
};

mod common;

use common::{Eye, Result, arguments, develop, picture, save};

/// How many rays may follow each other, the eye ray being the first.
const MAX_DEPTH: u32 = 16;
/// Rays that carry less are not traced.
const FAINT: f32 = 1.0 / 512.0;

// ANCHOR: payloads
/// What an eye ray and the rays after it carry.
struct Light {
    /// What comes back along the ray.
    radiance: Vec3,
    /// The part of it that reaches the eye.
    throughput: Vec3,
    depth: u32,
}

/// What a shadow ray carries.
struct Shadow {
    lit: bool,
}
// ANCHOR_END: payloads

/// The radiance of a scene with point lights only, by so many samples a pixel.
pub(crate) fn render(scene: &Scene, size: (u32, u32), samples: u32) -> Result<RgbImage> {
    let flat = rayburst::flatten(scene)?;
    let eye = Eye::new(rayburst::default_camera(scene, &flat));
    let lights = LightSampler::new(&flat);
    let ambient = mean(&flat.environment);
    let texels = RwTexture::<Vec3>::new(size.0, size.1);

    // ANCHOR: types
    let mut table = ShaderTable::new();
    let light_ray = table.ray_type::<Light>("light", 0, 0, 0);
    let shadow_ray = table.ray_type::<Shadow>("shadow", 1, 0, 1);
    // ANCHOR_END: types

    // ANCHOR: misses
    table.miss("sky", |miss, light: &mut Light| {
        light.radiance = lights.environment_radiance(&flat, miss.world_ray().direction);
    });
    table.miss("nothing in between", |_, shadow: &mut Shadow| shadow.lit = true);
    // ANCHOR_END: misses

    // ANCHOR: direct
    let direct = |hit: &ClosestHit<'_>, surface: &Surface, point: &ShadingPoint| {
        let mut sum = Vec3::ZERO;
        for arrival in
            flat.lights.iter().filter_map(|l| l.arrival(surface.position, Vec2::splat(0.5)))
        {
            let (f, _) = point.evaluate(-hit.world_ray().direction, arrival.direction);
            let origin = surface.spawn(arrival.direction);
            let ray = Ray::with_interval(origin, arrival.direction, 0.0, arrival.distance);
            let flags =
                RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH | RayFlags::SKIP_CLOSEST_HIT_SHADER;
            let mut shadow = Shadow { lit: false };
            hit.trace_ray(shadow_ray, flags, 0xFF, &ray, &mut shadow);
            if shadow.lit {
                sum += f * arrival.illuminance;
            }
        }
        sum
    };
    // ANCHOR_END: direct

    // ANCHOR: closest
    let options = ShadingOptions::default();
    let group = HitGroup::triangles("surface").closest_hit(|hit, light: &mut Light| {
        let surface = flat.surface(hit.hit());
        let towards_eye = -hit.world_ray().direction;
        let point = flat.shading_point(&surface, towards_eye, Footprint::NONE, &options);
        light.radiance = point.emitted;
        if light.depth >= MAX_DEPTH {
            return;
        }
        let wo = point.frame.to_local(towards_eye);
        let reflected = point.bsdf.specular_reflection(wo);
        let refracted = point.bsdf.specular_refraction(wo);
        if !point.bsdf.is_delta() {
            let mirrored = reflected.map_or(Vec3::ZERO, |path| path.weight);
            light.radiance += (point.bsdf.albedo(wo) - mirrored).max(Vec3::ZERO) * ambient;
            light.radiance += direct(hit, &surface, &point);
        }
        for path in [reflected, refracted].into_iter().flatten() {
            let throughput = light.throughput * path.weight;
            if throughput.max_element() >= FAINT {
                let direction = point.frame.to_world(path.wi);
                let ray = Ray::new(surface.spawn(direction), direction);
                let mut next = Light { radiance: Vec3::ZERO, throughput, depth: light.depth + 1 };
                hit.trace_ray(light_ray, RayFlags::empty(), 0xFF, &ray, &mut next);
                light.radiance += path.weight * next.radiance;
            }
        }
    });
    table.hit(&group, ());
    table.no_hit();
    // ANCHOR_END: closest

    let generate = table.ray_generation(|launch| {
        let mut sum = Vec3::ZERO;
        for sample in 0..samples {
            let (ray, _) = eye.ray(launch.launch_index(), launch.launch_dimensions(), sample);
            let mut light = Light { radiance: Vec3::ZERO, throughput: Vec3::ONE, depth: 1 };
            launch.trace_ray(light_ray, RayFlags::empty(), 0xFF, &ray, &mut light);
            sum += light.radiance;
        }
        texels.store(launch.launch_index().truncate(), sum / samples as f32);
    });
    table.build(MAX_DEPTH + 1)?.dispatch_rays(&flat.tlas, generate, size.0, size.1, 1)?;
    Ok(picture(&texels, size))
}

type ClosestHit<'a> = rayburst::pipeline::ClosestHit<'a, Barycentrics, ()>;

/// The mean radiance of the surroundings: Whitted's ambient light.
fn mean(environment: &Environment) -> Vec3 {
    match environment {
        Environment::None => Vec3::ZERO,
        Environment::Constant(radiance) => *radiance,
        Environment::Map(map) => {
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            let rows = map.texels.chunks_exact(map.size.0.max(1) as usize);
            for (row, y) in rows.zip(0..) {
                // Rows near the poles are small.
                let weight = ((y as f32 + 0.5) / map.size.1 as f32 * std::f32::consts::PI).sin();
                sum += weight * row.iter().sum::<Vec3>() / row.len() as f32;
                weights += weight;
            }
            map.intensity * sum / weights.max(f32::MIN_POSITIVE)
        }
    }
}

fn main() -> Result<()> {
    let (path, size) = arguments("whitted", (640, 480))?;
    let radiance = render(&builtin::build("spheres")?, size, 16)?;
    save(&develop(&radiance), path)
}
