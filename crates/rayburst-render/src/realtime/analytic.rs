//! Polygon lights in closed form, and the share of them that is seen.
//!
//! The light that would arrive if nothing were in between has no noise (linearly transformed cosines); a
//! shadow ray to one point of one of the lights says how much of it does arrive (Heitz, Hill, McGuire:
//! "Combining Analytic Direct Illumination and Stochastic Shadows", I3D 2018). The light is chosen by what
//! it brings. Bias: within a light, points count by the solid angle that they cover and not by what the
//! surface makes of them.

use rayburst_image::{Band, Band3};
use rayburst_math::{Hit, Ray, glam::Vec3};
use rayburst_scene::ltc::PolygonShading;
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, GBuffer, squares},
    pass::FrameContext,
    shadows::closest_hits,
    signals::{Signals, guarded},
};
use crate::dimensions;

struct Rows<'a> {
    diffuse: Band3<'a>,
    specular: Band3<'a>,
    shadow: Band<'a>,
    distance: Band<'a>,
}

#[derive(Debug, Default)]
struct Work {
    rays: Vec<Ray>,
    keys: Vec<u32>,
    hits: Vec<Hit>,
    targets: Vec<(u32, u32)>,
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
        .map_init(Work::default, |work, (band, mut rows)| {
            work.rays.clear();
            work.keys.clear();
            work.targets.clear();
            let top = band as u32 * BAND;
            for at in squares(width, top..(top + BAND).min(height)) {
                pixel(frame, gbuffer, &mut rows, work, at);
            }
            closest_hits(frame.scene, frame.opaque, &work.rays, &work.keys, &mut work.hits);
            for (hit, &(x, y)) in work.hits.iter().zip(&work.targets) {
                if hit.is_hit() {
                    rows.shadow.set(x, y, 0.0);
                    rows.distance.set(x, y, hit.t);
                }
            }
            work.rays.len() as u64
        })
        .sum()
}

#[inline]
fn pixel(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    rows: &mut Rows<'_>,
    work: &mut Work,
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
        let (broad, glossy) = (integral.diffuse * radiance, integral.specular * radiance);
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
    let u = sampler.get_2d(dimensions::POLYGON_POINT);
    let Some((point, reach)) = light.sample(position, u) else { return };
    let direction = (point - position).normalize_or_zero();
    if surface.place.geometric_normal.dot(direction) <= 0.0 {
        // The part of the light that the surface does not see is not in the closed form either.
        return;
    }
    let origin = surface.place.spawn(direction);
    work.rays.push(Ray::with_interval(origin, direction, 0.0, reach));
    work.keys.push(frame.key((x, y)));
    work.targets.push((x, y));
}
