//! Indirect light, reflections, mirrors and glass: where the paths of a frame start, and where what they
//! bring goes.
//!
//! The hybrid frame starts one reflection and one diffuse bounce for every 2×2 pixels (Stachowiak:
//! "Stochastic Screen-Space Reflections", SIGGRAPH 2015 courses; Barré-Brisebois et al.: "Hybrid Rendering
//! for Real-Time Ray Tracing", Ray Tracing Gems 2019, chapter 25); the path traced frame one path a pixel,
//! by one of the lobes.

use rayburst_image::{Band, Band3};
use rayburst_math::{Ray, glam::Vec3};
use rayburst_scene::BsdfSample;
use rayon::prelude::*;

use super::{
    analytic::SHARP_ROUGHNESS,
    gbuffer::{BAND, GBuffer, PixelKind, PixelSurface, squares},
    pass::FrameContext,
    paths::{PathRay, PathResult, Paths, density},
    quads::{QuadRows, Quads, Shared, asking},
    signals::{Signals, guarded},
};
use crate::{
    dimensions::Vertex,
    footprint::{Arrival, RayFootprint, Turn},
};

/// What a pass of paths took and saw.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gathered {
    pub(crate) rays: u64,
    /// Broadly scattered paths, the sum of their light, and the sum of the factors on what longer ones
    /// would bring.
    pub(crate) paths: u64,
    pub(crate) light: [f64; 3],
    pub(crate) tail: [f64; 3],
}

impl Gathered {
    fn note(&mut self, result: &PathResult) {
        self.paths += 1;
        for (sum, value) in self.light.iter_mut().zip(result.radiance.to_array()) {
            *sum += f64::from(value);
        }
        for (sum, value) in self.tail.iter_mut().zip(result.tail.to_array()) {
            *sum += f64::from(value);
        }
    }

    fn add(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.paths += other.paths;
        for i in 0..3 {
            self.light[i] += other.light[i];
            self.tail[i] += other.tail[i];
        }
        self
    }
}

/// Which signal a path adds to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lobe {
    Broad,
    Glossy,
    Whole,
}

/// Paths and where each adds to.
#[derive(Debug, Default)]
struct Work {
    paths: Paths,
    targets: Vec<(Lobe, (u32, u32))>,
}

/// Lobes from this width on keep the footprint and forget the surface that they left, radians.
const WIDE: f32 = 0.2;

/// Directions of the broad lobes and of the glossy one come from dimensions of their own.
fn numbers(lobe: Lobe) -> u32 {
    match lobe {
        Lobe::Broad => Vertex::at_depth(1).direction(),
        Lobe::Glossy | Lobe::Whole => Vertex::at_depth(1).direction() + 2,
    }
}

impl Work {
    fn clear(&mut self) {
        self.paths.clear();
        self.targets.clear();
    }

    fn results(&self) -> impl Iterator<Item = (&PathResult, &(Lobe, (u32, u32)))> {
        self.paths.results.iter().zip(&self.targets)
    }

    /// Starts a path at a surface by one lobe; `factor` multiplies what it brings.
    #[inline]
    fn start(
        &mut self,
        frame: &FrameContext<'_>,
        gbuffer: &GBuffer,
        surface: &PixelSurface,
        lobe: Lobe,
        factor: f32,
        (x, y): (u32, u32),
        target: (u32, u32),
    ) {
        let Some((ray, sample, throughput)) = first_ray(frame, surface, lobe, (x, y)) else {
            return;
        };
        let (wi, throughput) = (ray.direction, factor * throughput);
        let normal = surface.frame.normal;
        let turn = Turn { wi, transmitted: false, normal, eta: 1.0, spread: sample.spread };
        let footprint = self.turned(frame, gbuffer, (x, y), &turn);
        let sharp = lobe == Lobe::Glossy && gbuffer.roughness.get(x, y) < SHARP_ROUGHNESS;
        self.push(frame, (x, y), ray, throughput, &sample, footprint, sharp);
        self.targets.push((lobe, target));
    }

    /// The footprint of a ray that leaves a first hit.
    #[inline]
    fn turned(
        &self,
        frame: &FrameContext<'_>,
        gbuffer: &GBuffer,
        (x, y): (u32, u32),
        turn: &Turn,
    ) -> RayFootprint {
        let hit = &gbuffer.hits[(y * gbuffer.size().0 + x) as usize];
        let (eye, ray) = (frame.eye_footprint((x, y)), frame.view.ray(x, y));
        if let RayFootprint::Cone(cone) = eye
            && turn.spread >= WIDE
        {
            return RayFootprint::Cone(cone.propagate(hit.t, turn.spread));
        }
        if eye == RayFootprint::None {
            return eye;
        }
        let surface = frame.scene.surface(hit);
        eye.turned(&Arrival { scene: frame.scene, ray: &ray, hit, surface: &surface }, turn)
    }

    #[inline]
    fn push(
        &mut self,
        frame: &FrameContext<'_>,
        at: (u32, u32),
        ray: Ray,
        throughput: Vec3,
        sample: &BsdfSample,
        footprint: RayFootprint,
        sharp: bool,
    ) {
        let state = PathRay {
            throughput,
            slot: 0,
            footprint,
            pdf: density(sample),
            specular: sample.delta,
            sampler: frame.sampler(at),
            key: frame.key(at),
            tile: frame.tile(at),
            sharp,
        };
        self.paths.start(ray, state);
    }

    /// Starts a path at a perfect mirror or glass.
    fn start_specular(&mut self, frame: &FrameContext<'_>, gbuffer: &GBuffer, (x, y): (u32, u32)) {
        let hit = &gbuffer.hits[(y * gbuffer.size().0 + x) as usize];
        let surface = frame.scene.surface(hit);
        let eye = frame.view.ray(x, y);
        let (wo, footprint) = (-eye.direction, frame.eye_footprint((x, y)));
        let seen = footprint.at(&eye, hit, &surface);
        let point = frame.scene.shading_point(&surface, wo, seen, &frame.shading);
        let sampler = frame.sampler((x, y));
        let numbers = Vertex::at_depth(1);
        let u = sampler.get_2d(numbers.direction()).extend(sampler.get_1d(numbers.lobe()));
        let Some(sample) = point.sample(wo, u) else { return };
        let ray = Ray::new(surface.spawn(sample.wi), sample.wi);
        let arrival = Arrival { scene: frame.scene, ray: &eye, hit, surface: &surface };
        let footprint = footprint.turned(&arrival, &Turn::of_sample(&point, &sample));
        self.push(frame, (x, y), ray, sample.weight, &sample, footprint, true);
        self.targets.push((Lobe::Whole, (x, y)));
    }
}

/// A ray that leaves a first hit by one of its lobes, how it was sampled, and the demodulated factor on what
/// it brings.
#[inline]
fn first_ray(
    frame: &FrameContext<'_>,
    surface: &PixelSurface,
    lobe: Lobe,
    at: (u32, u32),
) -> Option<(Ray, BsdfSample, Vec3)> {
    let u = frame.sampler(at).get_2d(numbers(lobe));
    let (broad, glossy) = surface.bsdf.albedos_apart(surface.wo);
    let (sample, reflectance) = match lobe {
        Lobe::Broad if broad != Vec3::ZERO => (surface.bsdf.sample_broad(surface.wo, u), broad),
        Lobe::Glossy if glossy != Vec3::ZERO => (surface.bsdf.sample_glossy(surface.wo, u), glossy),
        _ => return None,
    };
    let sample = sample?;
    let throughput = sample.weight / guarded(reflectance);
    if throughput == Vec3::ZERO || !throughput.is_finite() {
        return None;
    }
    let wi = surface.frame.to_world(sample.wi).normalize();
    Some((Ray::new(surface.place.spawn(wi), wi), sample, throughput))
}

/// A reflected ray of a first hit and the demodulated factor on what it brings.
#[inline]
pub(crate) fn reflected_ray(
    frame: &FrameContext<'_>,
    surface: &PixelSurface,
    at: (u32, u32),
) -> Option<(Ray, Vec3)> {
    let (ray, _, throughput) = first_ray(frame, surface, Lobe::Glossy, at)?;
    Some((ray, throughput))
}

/// One reflection, unless these are made otherwise, and one diffuse bounce a block of 2×2 pixels, and a path for each pixel of mirrors and
/// glass.
pub(crate) fn gather_quads(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    quads: &mut Quads,
    signals: &mut Signals,
    reflections: bool,
) -> Gathered {
    let passes = &frame.settings.passes;
    let columns = quads.size().0;
    let transparency: Vec<Band3<'_>> = signals.transparency.bands_mut(BAND).collect();
    let bands = quads.rows().into_par_iter().zip(transparency);
    let gathered: Vec<Gathered> = bands
        .map_init(<[Work; 2]>::default, |work, (mut rows, mut transparency)| {
            // Rays that go about the same way apart from those that do not.
            let [glossy, broad] = work;
            glossy.clear();
            broad.clear();
            for block in rows.blocks(columns) {
                rows.clear(block, reflections || !passes.reflections);
                let Some(at) = asking(rows.chosen.get(block.0, block.1), block) else { continue };
                let surface = gbuffer.surface_at(frame.scene, frame.view, &frame.shading, at);
                let Some(surface) = surface else { continue };
                if reflections {
                    glossy.start(frame, gbuffer, &surface, Lobe::Glossy, 1.0, at, block);
                }
                if passes.indirect {
                    broad.start(frame, gbuffer, &surface, Lobe::Broad, 1.0, at, block);
                }
            }
            specular_pixels(frame, gbuffer, glossy, band_rows(&rows));
            let rays = glossy.paths.run(frame) + broad.paths.run(frame);
            let mut gathered = Gathered { rays, ..Gathered::default() };
            for (result, &(lobe, at)) in glossy.results().chain(broad.results()) {
                match lobe {
                    Lobe::Broad => {
                        rows.diffuse.set(at.0, at.1, result.radiance);
                        rows.diffuse_distance.set(at.0, at.1, result.distance);
                        gathered.note(result);
                    }
                    Lobe::Glossy => {
                        rows.specular.set(at.0, at.1, result.radiance);
                        rows.specular_distance.set(at.0, at.1, result.distance);
                    }
                    Lobe::Whole => transparency.set(at.0, at.1, result.radiance),
                }
            }
            gathered
        })
        .collect();
    quads.share(gbuffer, signals, Shared { light: true, occlusion: false });
    gathered.into_iter().fold(Gathered::default(), Gathered::add)
}

/// The pixel rows of a band of blocks.
fn band_rows(rows: &QuadRows<'_>) -> std::ops::Range<u32> {
    2 * rows.chosen.top()..2 * (rows.chosen.top() + rows.chosen.rows())
}

fn specular_pixels(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    work: &mut Work,
    rows: std::ops::Range<u32>,
) {
    if !frame.settings.passes.transparency {
        return;
    }
    let (width, height) = gbuffer.size();
    for at in squares(width, rows.start..rows.end.min(height)) {
        if gbuffer.kind.get(at.0, at.1) == PixelKind::Specular as u32 {
            work.start_specular(frame, gbuffer, at);
        }
    }
}

struct PixelRows<'a> {
    diffuse: Band3<'a>,
    specular: Band3<'a>,
    transparency: Band3<'a>,
    diffuse_distance: Band<'a>,
    specular_distance: Band<'a>,
}

/// One path a pixel.
pub(crate) fn gather_pixels(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    signals: &mut Signals,
) -> Gathered {
    let passes = &frame.settings.passes;
    let (width, height) = gbuffer.size();
    let mut vectors = [
        signals.indirect_diffuse.bands_mut(BAND),
        signals.indirect_specular.bands_mut(BAND),
        signals.transparency.bands_mut(BAND),
    ];
    let mut planes = [
        signals.diffuse_hit_distance.bands_mut(BAND),
        signals.specular_hit_distance.bands_mut(BAND),
    ];
    let bands: Vec<PixelRows<'_>> = std::iter::from_fn(|| {
        let ([a, b, c], [d, e]) = (&mut vectors, &mut planes);
        Some(PixelRows {
            diffuse: a.next()?,
            specular: b.next()?,
            transparency: c.next()?,
            diffuse_distance: d.next()?,
            specular_distance: e.next()?,
        })
    })
    .collect();
    let gathered: Vec<Gathered> = bands
        .into_par_iter()
        .enumerate()
        .map_init(Work::default, |work, (band, mut rows)| {
            work.clear();
            let top = band as u32 * BAND;
            for at in squares(width, top..(top + BAND).min(height)) {
                let surface = gbuffer.surface_at(frame.scene, frame.view, &frame.shading, at);
                let Some(surface) = surface else { continue };
                let (broad, glossy) = surface.bsdf.albedos_apart(surface.wo);
                let (b, g) = (
                    if passes.indirect { broad.element_sum() } else { 0.0 },
                    if passes.reflections { glossy.element_sum() } else { 0.0 },
                );
                let p = if b + g > 0.0 { g / (b + g) } else { continue };
                let choice = frame.sampler(at).get_1d(Vertex::at_depth(1).survival());
                let (lobe, p) = if choice < p { (Lobe::Glossy, p) } else { (Lobe::Broad, 1.0 - p) };
                work.start(frame, gbuffer, &surface, lobe, 1.0 / p, at, at);
            }
            specular_pixels(frame, gbuffer, work, top..top + BAND);
            let mut gathered = Gathered { rays: work.paths.run(frame), ..Gathered::default() };
            for (result, &(lobe, (x, y))) in work.results() {
                match lobe {
                    Lobe::Broad => {
                        rows.diffuse.set(x, y, result.radiance);
                        rows.diffuse_distance.set(x, y, result.distance);
                        gathered.note(result);
                    }
                    Lobe::Glossy => {
                        rows.specular.set(x, y, result.radiance);
                        rows.specular_distance.set(x, y, result.distance);
                    }
                    Lobe::Whole => rows.transparency.set(x, y, result.radiance),
                }
            }
            gathered
        })
        .collect();
    gathered.into_iter().fold(Gathered::default(), Gathered::add)
}
