//! Direct light at the first hits: punctual lights exactly, with a shadow ray each; of all other lights one
//! at random (next-event estimation).
//!
//! What is sampled may be met by the rays of other passes, too. The balance heuristic (Veach, Guibas 1995)
//! shares it between them, lobe by lobe: the broad lobes with the indirect light, the glossy one with the
//! reflections.

use rayburst_image::Band3;
use rayburst_math::{
    Ray,
    glam::Vec3,
    lanes::{F32x16, LANES, Mask16, Sampler16, Vec3x16},
};
use rayburst_simd::{Isa, Kernel};
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, GBuffer, PixelSurfaces, Pixels},
    pass::{FrameContext, isa_of},
    shadow_map::ShadowMaps,
    shadows::ShadowRays,
    signals::{LEAST_REFLECTANCE, Signals},
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

/// Lights that may shine on sixteen pixels.
struct Lights16 {
    some: Mask16,
    direction: Vec3x16,
    distance: F32x16,
    /// Radiance over density.
    radiance: Vec3x16,
    pdf: F32x16,
    /// Which of them scattered rays cannot find.
    delta: Mask16,
}

/// Sixteen rays, and what their lights add to pixels side by side.
struct Asked {
    first: (u32, u32),
    some: Mask16,
    origin: Vec3x16,
    direction: Vec3x16,
    distance: F32x16,
    diffuse: Vec3x16,
    specular: Vec3x16,
}

/// What a thread keeps from band to band.
#[derive(Default)]
struct Work {
    shadows: ShadowRays<Light>,
    asked: Vec<Asked>,
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
    let isa = isa_of(frame.scene);
    let counts =
        rows.into_par_iter().enumerate().map_init(Work::default, |work, (band, mut rows)| {
            let top = band as u32 * BAND;
            isa.dispatch(Direct { frame, gbuffer, maps, rows: &mut rows, work, top });
            work.shadows.resolve(frame.scene, frame.opaque, |light, visible| {
                if visible {
                    add(&mut rows.diffuse, light.at, light.diffuse);
                    add(&mut rows.specular, light.at, light.specular);
                }
            })
        });
    counts.sum()
}

#[inline]
fn add(rows: &mut Band3<'_>, (x, y): (u32, u32), value: Vec3) {
    let sum = rows.get(x, y) + value;
    rows.set(x, y, sum);
}

/// A band: shades its pixels and lists their shadow rays.
struct Direct<'a, 'r> {
    frame: &'a FrameContext<'a>,
    gbuffer: &'a GBuffer,
    maps: Option<&'a [ShadowMaps]>,
    rows: &'a mut Rows<'r>,
    work: &'a mut Work,
    top: u32,
}

impl Kernel for Direct<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let (width, height) = self.gbuffer.size();
        let bottom = (self.top + BAND).min(height);
        for x in (0..width).step_by(LANES) {
            for y in self.top..bottom {
                self.pixels((x, y));
            }
            self.list();
        }
    }
}

impl Direct<'_, '_> {
    /// Sixteen pixels side by side.
    #[inline(always)]
    fn pixels(&mut self, first: (u32, u32)) {
        let (frame, gbuffer) = (self.frame, self.gbuffer);
        let pixels = Pixels::row(first, gbuffer.size());
        let Some(surfaces) = gbuffer.surfaces_at(frame.scene, frame.view, &frame.shading, &pixels)
        else {
            return;
        };
        let (broad, glossy) = surfaces.lobes.albedos_apart(surfaces.wo.z);
        put(&mut self.rows.diffuse_reflectance, first, surfaces.places.some, broad);
        put(&mut self.rows.specular_reflectance, first, surfaces.places.some, glossy);
        let passes = &frame.settings.passes;
        let some = surfaces.places.some & !surfaces.lobes.is_delta();
        if !passes.direct || frame.settings.max_depth < 2 || !some.any() {
            return;
        }
        let reflectances = [guarded(broad), guarded(glossy)];
        let samplers = frame.samplers(&pixels);
        for (number, exact) in frame.lights.exact.iter().enumerate() {
            let u = samplers.get_2d(dimensions::exact_light(number as u32));
            let arrival = exact.arrival16(surfaces.places.position, u);
            let mut some = some & arrival.shines;
            let map = self.maps.and_then(|maps| maps.get(number));
            if let Some(map) = map {
                keep_lit(map, &surfaces, &mut some);
            }
            let lights = Lights16 {
                some,
                direction: arrival.direction,
                distance: arrival.distance,
                radiance: arrival.illuminance,
                pdf: F32x16::ONE,
                delta: Mask16::ALL,
            };
            let by_rays = passes.shadows && map.is_none();
            self.shine(first, &surfaces, &reflectances, &lights, by_rays);
        }
        if !frame.lights.primary.is_empty() {
            let lights = sampled(frame, &surfaces, &pixels, &samplers, some);
            self.shine(first, &surfaces, &reflectances, &lights, passes.shadows);
        }
    }

    /// Adds shadow rays to lights, or their light where no rays go.
    #[inline(always)]
    fn shine(
        &mut self,
        first: (u32, u32),
        surfaces: &PixelSurfaces,
        reflectances: &[Vec3x16; 2],
        lights: &Lights16,
        by_rays: bool,
    ) {
        let facing =
            surfaces.places.geometric_normal.dot(lights.direction).is_greater(F32x16::ZERO);
        let wi = surfaces.frame.to_local(lights.direction);
        let values = surfaces.lobes.evaluate_apart(surfaces.wo, wi);
        let passes = &self.frame.settings.passes;
        let broad = share(lights, values.broad_pdf, passes.indirect);
        let glossy = share(lights, values.glossy_pdf, passes.reflections);
        let diffuse = values.broad * lights.radiance * broad;
        let specular = values.glossy * lights.radiance * glossy;
        let diffuse = divided(diffuse, reflectances[0]);
        let specular = divided(specular, reflectances[1]);
        let sum = diffuse + specular;
        let fine = ((sum.x + sum.y) + sum.z).is_finite();
        let lit = sum.max_element().is_greater(F32x16::ZERO);
        let some = lights.some & facing & fine & lit;
        if !some.any() {
            return;
        }
        if by_rays {
            let (direction, distance) = (lights.direction, lights.distance);
            let origin = surfaces.places.spawn(direction);
            let asked = Asked { first, some, origin, direction, distance, diffuse, specular };
            self.work.asked.push(asked);
        } else {
            accumulate(&mut self.rows.diffuse, first, some, diffuse);
            accumulate(&mut self.rows.specular, first, some, specular);
        }
    }

    /// Lists the rays of two squares of pixels, so that neighbours in the list are neighbours in the picture.
    #[inline(never)]
    fn list(&mut self) {
        let Work { shadows, asked } = &mut *self.work;
        for half in [0..LANES / 2, LANES / 2..LANES] {
            for asked in &*asked {
                for lane in half.clone().filter(|&lane| asked.some.lane(lane)) {
                    let at = (asked.first.0 + lane as u32, asked.first.1);
                    let ray = Ray::with_interval(
                        asked.origin.lane(lane),
                        asked.direction.lane(lane),
                        0.0,
                        asked.distance.0[lane],
                    );
                    let (diffuse, specular) = (asked.diffuse.lane(lane), asked.specular.lane(lane));
                    let key = if self.frame.opaque { 0 } else { self.frame.key(at) };
                    shadows.push(ray, key, Light { at, diffuse, specular });
                }
            }
        }
        asked.clear();
    }
}

/// The share of light sampling in what scattered rays may find as well; all of it where no rays go.
#[inline(always)]
fn share(lights: &Lights16, pdf: F32x16, found: bool) -> F32x16 {
    if !found {
        return F32x16::ONE;
    }
    lights.delta.select(F32x16::ONE, lights.pdf / (lights.pdf + pdf))
}

/// One of the lights that are sampled at random for each pixel; none of those that have a closed form there.
#[inline(never)]
fn sampled(
    frame: &FrameContext<'_>,
    surfaces: &PixelSurfaces,
    pixels: &Pixels,
    samplers: &Sampler16,
    wanted: Mask16,
) -> Lights16 {
    let mut found = Lights16 {
        some: Mask16::NONE,
        direction: Vec3x16::splat(Vec3::Z),
        distance: F32x16::ZERO,
        radiance: Vec3x16::ZERO,
        pdf: F32x16::ONE,
        delta: Mask16::NONE,
    };
    let numbers = dimensions::Vertex::at_depth(1);
    for lane in wanted.lanes() {
        let sampler = samplers.lane(lane);
        let choice = sampler.get_1d(numbers.light_choice());
        let u = sampler.get_2d(numbers.light_point());
        let tile = frame.tile((pixels.x[lane], pixels.y[lane]));
        let from = surfaces.places.position.lane(lane);
        let excluded = |instance, geometry, primitive| {
            frame.is_analytic(tile, [instance, geometry, primitive])
        };
        let primary = &frame.lights.primary;
        let Some(light) = primary.sample_except(frame.scene, from, choice, u, excluded) else {
            continue;
        };
        found.some.set_lane(lane, true);
        found.direction.set_lane(lane, light.direction);
        found.distance.0[lane] = light.distance;
        found.radiance.set_lane(lane, light.radiance / light.pdf);
        found.pdf.0[lane] = light.pdf;
        found.delta.set_lane(lane, light.delta);
    }
    found
}

#[inline(never)]
fn keep_lit(map: &ShadowMaps, surfaces: &PixelSurfaces, some: &mut Mask16) {
    for lane in 0..LANES {
        let (position, normal) =
            (surfaces.places.position.lane(lane), surfaces.places.geometric_normal.lane(lane));
        some.set_lane(lane, some.lane(lane) && map.is_lit(position, normal));
    }
}

/// Albedos that light can be divided by; see [`super::guarded`].
#[inline(always)]
fn guarded(reflectance: Vec3x16) -> Vec3x16 {
    reflectance.max(Vec3x16::splat(Vec3::splat(LEAST_REFLECTANCE)))
}

#[inline(always)]
fn divided(light: Vec3x16, by: Vec3x16) -> Vec3x16 {
    Vec3x16 { x: light.x / by.x, y: light.y / by.y, z: light.z / by.z }
}

/// Writes sixteen vectors from a pixel on, zero where there is nothing.
#[inline(always)]
fn put(rows: &mut Band3<'_>, (x, y): (u32, u32), some: Mask16, values: Vec3x16) {
    let [a, b, c] = rows.from_pixel_mut(x, y);
    some.select(values.x, F32x16::ZERO).store(a);
    some.select(values.y, F32x16::ZERO).store(b);
    some.select(values.z, F32x16::ZERO).store(c);
}

/// Adds sixteen vectors from a pixel on.
#[inline(always)]
fn accumulate(rows: &mut Band3<'_>, (x, y): (u32, u32), some: Mask16, values: Vec3x16) {
    let [a, b, c] = rows.from_pixel_mut(x, y);
    (F32x16::load(a) + some.select(values.x, F32x16::ZERO)).store(a);
    (F32x16::load(b) + some.select(values.y, F32x16::ZERO)).store(b);
    (F32x16::load(c) + some.select(values.z, F32x16::ZERO)).store(c);
}
