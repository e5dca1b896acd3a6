//! Direct light at the first hits: punctual lights exactly, with a shadow ray each; of all other lights one
//! at random (next-event estimation).
//!
//! What is sampled may be met by the rays of other passes, too. The balance heuristic (Veach, Guibas 1995)
//! shares it between them, lobe by lobe: the broad lobes with the indirect light, the glossy one with the
//! reflections.

use rayburst_image::Band3;
use rayburst_math::{
    Ray, Sampler,
    glam::{Vec2, Vec3},
};
use rayburst_scene::LightSample;
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, GBuffer, PixelSurface, squares},
    pass::FrameContext,
    shadow_map::ShadowMaps,
    shadows::ShadowRays,
    signals::{Signals, guarded},
};
use crate::dimensions;

/// What a visible light adds to a pixel, demodulated.
#[derive(Clone, Copy, Debug)]
struct Light {
    at: (u32, u32),
    diffuse: Vec3,
    specular: Vec3,
}

struct Rows<'a> {
    diffuse_reflectance: Band3<'a>,
    specular_reflectance: Band3<'a>,
    diffuse: Band3<'a>,
    specular: Band3<'a>,
}

/// Fills in the reflectances and, if that pass is wanted, the direct light; returns the rays it took.
///
/// With `maps`, one for each of the exact lights, these take the place of the rays to them.
pub(crate) fn direct_light(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    maps: Option<&[ShadowMaps]>,
    signals: &mut Signals,
) -> u64 {
    let Signals {
        diffuse_reflectance, specular_reflectance, direct_diffuse, direct_specular, ..
    } = signals;
    let mut bands = [
        diffuse_reflectance.bands_mut(BAND),
        specular_reflectance.bands_mut(BAND),
        direct_diffuse.bands_mut(BAND),
        direct_specular.bands_mut(BAND),
    ];
    let mut next = || {
        let [a, b, c, d] = &mut bands;
        Some(Rows {
            diffuse_reflectance: a.next()?,
            specular_reflectance: b.next()?,
            diffuse: c.next()?,
            specular: d.next()?,
        })
    };
    let rows: Vec<Rows<'_>> = std::iter::from_fn(&mut next).collect();
    let (width, height) = gbuffer.size();
    let counts = rows.into_par_iter().enumerate().map_init(
        ShadowRays::<Light>::default,
        |shadows, (band, mut rows)| {
            let top = band as u32 * BAND;
            for at in squares(width, top..(top + BAND).min(height)) {
                pixel(frame, gbuffer, maps, &mut rows, shadows, at);
            }
            shadows.resolve(frame.scene, frame.opaque, |light, visible| {
                if visible {
                    add(&mut rows.diffuse, light.at, light.diffuse);
                    add(&mut rows.specular, light.at, light.specular);
                }
            })
        },
    );
    counts.sum()
}

#[inline]
fn add(rows: &mut Band3<'_>, (x, y): (u32, u32), value: Vec3) {
    let sum = rows.get(x, y) + value;
    rows.set(x, y, sum);
}

#[inline]
fn pixel(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    maps: Option<&[ShadowMaps]>,
    rows: &mut Rows<'_>,
    shadows: &mut ShadowRays<Light>,
    (x, y): (u32, u32),
) {
    let Some(surface) = gbuffer.surface_at(frame.scene, frame.view, &frame.shading, (x, y)) else {
        return;
    };
    let (diffuse, specular) = surface.bsdf.albedos_apart(surface.wo);
    rows.diffuse_reflectance.set(x, y, diffuse);
    rows.specular_reflectance.set(x, y, specular);
    let passes = &frame.settings.passes;
    if !passes.direct || frame.settings.max_depth < 2 || surface.bsdf.is_delta() {
        return;
    }
    let reflectances = (guarded(diffuse), guarded(specular));
    let sampler = frame.sampler((x, y));
    let key = frame.key((x, y));
    for (i, light) in (0..).zip(&frame.lights.exact) {
        let u = sampler.get_2d(dimensions::exact_light(i));
        if let Some(arrival) = light.arrival(surface.place.position, u) {
            let light = LightSample {
                direction: arrival.direction,
                distance: arrival.distance,
                radiance: arrival.illuminance,
                pdf: 1.0,
                delta: true,
            };
            let map = maps.and_then(|maps| maps.get(i as usize));
            if map.is_none_or(|map| {
                map.is_lit(surface.place.position, surface.place.geometric_normal)
            }) {
                let by_rays = passes.shadows && map.is_none();
                shine(frame, &surface, reflectances, rows, shadows, (x, y), key, &light, by_rays);
            }
        }
    }
    if let Some(light) = sample(frame, &surface, &sampler, frame.tile((x, y))) {
        let by_rays = passes.shadows;
        shine(frame, &surface, reflectances, rows, shadows, (x, y), key, &light, by_rays);
    }
}

/// One of the lights that are sampled at random; none for those that have a closed form here.
#[inline]
fn sample(
    frame: &FrameContext<'_>,
    surface: &PixelSurface,
    sampler: &Sampler,
    tile: u32,
) -> Option<LightSample> {
    if frame.lights.primary.is_empty() {
        return None;
    }
    let numbers = dimensions::Vertex::at_depth(1);
    let choice = sampler.get_1d(numbers.light_choice());
    let u: Vec2 = sampler.get_2d(numbers.light_point());
    let (from, lights) = (surface.place.position, &frame.lights.primary);
    lights.sample_except(frame.scene, from, choice, u, |instance, geometry, primitive| {
        frame.is_analytic(tile, [instance, geometry, primitive])
    })
}

/// Adds a shadow ray to a light, or its light where shadows are not wanted.
#[inline]
fn shine(
    frame: &FrameContext<'_>,
    surface: &PixelSurface,
    (diffuse_reflectance, specular_reflectance): (Vec3, Vec3),
    rows: &mut Rows<'_>,
    shadows: &mut ShadowRays<Light>,
    at: (u32, u32),
    key: u32,
    light: &LightSample,
    by_rays: bool,
) {
    if surface.place.geometric_normal.dot(light.direction) <= 0.0 {
        return;
    }
    let values = surface.bsdf.evaluate_apart(surface.wo, surface.frame.to_local(light.direction));
    // The share of this technique; all of it where no rays go.
    let share = |pdf: f32, found: bool| {
        if light.delta || !found { 1.0 } else { light.pdf / (light.pdf + pdf) }
    };
    let passes = &frame.settings.passes;
    let (broad, glossy) =
        (share(values.broad_pdf, passes.indirect), share(values.glossy_pdf, passes.reflections));
    let radiance = light.radiance / light.pdf;
    let light_item = Light {
        at,
        diffuse: values.broad * radiance * broad / diffuse_reflectance,
        specular: values.glossy * radiance * glossy / specular_reflectance,
    };
    let sum = light_item.diffuse + light_item.specular;
    if !(sum.max_element() > 0.0 && sum.is_finite()) {
        return;
    }
    if !by_rays {
        add(&mut rows.diffuse, at, light_item.diffuse);
        add(&mut rows.specular, at, light_item.specular);
        return;
    }
    let origin = surface.place.spawn(light.direction);
    let ray = Ray::with_interval(origin, light.direction, 0.0, light.distance);
    shadows.push(ray, key, light_item);
}
