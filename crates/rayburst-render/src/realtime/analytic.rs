//! Polygon lights in closed form, and the share of them that is seen.
//!
//! The light that would arrive if nothing were in between has no noise (linearly transformed cosines); a
//! shadow ray to one point of one of the lights says how much of it does arrive (Heitz, Hill, McGuire:
//! "Combining Analytic Direct Illumination and Stochastic Shadows", I3D 2018). The light is chosen by what
//! it brings, the point about so. Bias: the share of the light that is blocked counts points by one of a few
//! candidates, not by exactly what they bring.

use rayburst_image::{Band, Band3};
use rayburst_math::{
    Ray, Sampler,
    glam::{Vec2, Vec3},
};
use rayburst_scene::ltc::{PolygonLight, PolygonSample, PolygonShading};
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, GBuffer, PixelSurface, squares},
    pass::FrameContext,
    shadows::OcclusionRays,
    signals::{Signals, guarded},
};
use crate::dimensions;

/// Of smoother surfaces the glossy lobe is left to reflected rays: its closed form is not good enough.
pub(crate) const SHARP_ROUGHNESS: f32 = 0.1;

struct Rows<'a> {
    diffuse: Band3<'a>,
    specular: Band3<'a>,
    shadow: Band<'a>,
    distance: Band<'a>,
}

/// Fills in the light of the polygon lights and their shadow; returns the rays it took.
pub(crate) fn analytic_light(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    signals: &mut Signals,
) -> u64 {
    let passes = &frame.settings.passes;
    if frame.lights.polygons.is_empty() || !passes.direct || frame.settings.max_depth < 2 {
        return 0;
    }
    let (width, height) = gbuffer.size();
    let mut vectors =
        [signals.analytic_diffuse.bands_mut(BAND), signals.analytic_specular.bands_mut(BAND)];
    let mut planes = [signals.shadow.bands_mut(BAND), signals.shadow_distance.bands_mut(BAND)];
    let bands: Vec<Rows<'_>> = std::iter::from_fn(|| {
        let ([a, b], [c, d]) = (&mut vectors, &mut planes);
        Some(Rows {
            diffuse: a.next()?,
            specular: b.next()?,
            shadow: c.next()?,
            distance: d.next()?,
        })
    })
    .collect();
    bands
        .into_par_iter()
        .enumerate()
        .map_init(OcclusionRays::default, |rays, (band, mut rows)| {
            let top = band as u32 * BAND;
            for at in squares(width, top..(top + BAND).min(height)) {
                pixel(frame, gbuffer, &mut rows, rays, at);
            }
            rays.resolve(frame.scene, frame.opaque, |(x, y), distance| {
                rows.shadow.set(x, y, 0.0);
                rows.distance.set(x, y, distance);
            })
        })
        .sum()
}

#[inline]
fn pixel(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    rows: &mut Rows<'_>,
    rays: &mut OcclusionRays<(u32, u32)>,
    (x, y): (u32, u32),
) {
    let Some(tile) = frame.tiles.get(frame.tile((x, y)) as usize) else { return };
    if tile.lights().is_empty() {
        return;
    }
    let surface = gbuffer.surface_at(frame.scene, frame.view, &frame.shading, (x, y));
    let Some(surface) = surface else { return };
    let position = surface.place.position;
    let wo = surface.frame.to_world(surface.wo);
    let shading = PolygonShading::new(&surface.bsdf, &surface.frame, position, wo);
    let Some(shading) = shading else { return };
    let sharp = gbuffer.roughness.get(x, y) < SHARP_ROUGHNESS;
    let sampler = frame.sampler((x, y));
    let mut choice = sampler.get_1d(dimensions::POLYGON_CHOICE);
    let (mut diffuse, mut specular, mut chosen, mut sum) = (Vec3::ZERO, Vec3::ZERO, None, 0.0f32);
    for &index in tile.lights() {
        let light = &frame.lights.polygons.lights()[index as usize];
        let radiance = light.radiance_towards(position);
        if radiance == Vec3::ZERO {
            continue;
        }
        let integral = shading.integrate(light.corners());
        let broad = integral.diffuse * radiance;
        let glossy = if sharp { Vec3::ZERO } else { integral.specular * radiance };
        let weight = (broad + glossy).element_sum();
        if !(weight > 0.0 && weight.is_finite()) {
            continue;
        }
        diffuse += broad;
        specular += glossy;
        // One of them by what it brings, with one number.
        sum += weight;
        let share = weight / sum;
        if choice < share {
            chosen = Some(light);
            choice /= share;
        } else {
            choice = (choice - share) / (1.0 - share);
        }
    }
    let Some(light) = chosen else { return };
    let (broad, glossy) = surface.bsdf.albedos_apart(surface.wo);
    rows.diffuse.set(x, y, diffuse / guarded(broad));
    rows.specular.set(x, y, specular / guarded(glossy));
    if !frame.settings.passes.shadows {
        return;
    }
    let Some(sample) = lit_point(&surface, light, &sampler, sharp) else { return };
    let direction = (sample.point - position).normalize_or_zero();
    let origin = surface.place.spawn(direction);
    let ray = Ray::with_interval(origin, direction, 0.0, sample.reach);
    rays.push(ray, frame.key((x, y)), (x, y));
}

/// Points of the light that are looked at before one is chosen.
const CANDIDATES: u32 = 4;

/// A point of a light about by what it brings: one of a few by what the
/// surface makes of them (resampling: Talbot, Cline, Egbert: "Importance Resampling for Global
/// Illumination", EGSR 2005). `None` where none of them brings anything.
#[inline]
fn lit_point(
    surface: &PixelSurface,
    light: &PolygonLight,
    sampler: &Sampler,
    sharp: bool,
) -> Option<PolygonSample> {
    let position = surface.place.position;
    let base = sampler.get_2d(dimensions::POLYGON_POINT);
    let mut choice = sampler.get_1d(dimensions::POLYGON_CANDIDATE);
    let (mut chosen, mut sum) = (None, 0.0f32);
    for i in 0..CANDIDATES {
        // Points of a lattice, shifted.
        let shift = Vec2::new(i as f32 / CANDIDATES as f32, 0.618_034 * i as f32);
        let u = (base + shift).fract();
        let Some(sample) = light.sample(position, u) else { continue };
        let direction = (sample.point - position).normalize_or_zero();
        let values = surface.bsdf.evaluate_apart(surface.wo, surface.frame.to_local(direction));
        let glossy = if sharp { Vec3::ZERO } else { values.glossy };
        let weight = (values.broad + glossy).element_sum() / sample.pdf;
        if !(weight > 0.0 && weight.is_finite()) {
            continue;
        }
        sum += weight;
        let share = weight / sum;
        if choice < share {
            chosen = Some(sample);
            choice /= share;
        } else {
            choice = (choice - share) / (1.0 - share);
        }
    }
    chosen
}
