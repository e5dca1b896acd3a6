//! Indirect light, reflections, mirrors and glass: where the paths of a frame start, and where what they
//! bring goes.
//!
//! The hybrid frame starts one reflection and one diffuse bounce for every 2×2 pixels (Stachowiak:
//! "Stochastic Screen-Space Reflections", SIGGRAPH 2015 courses; Barré-Brisebois et al.: "Hybrid Rendering
//! for Real-Time Ray Tracing", Ray Tracing Gems 2019, chapter 25); the path traced frame one path a pixel,
//! by one of the lobes.

use rayburst_image::{Band, Band3};
use rayburst_math::{
    Ray,
    glam::Vec3,
    lanes::{F32x16, LANES, Mask16, Vec3x16},
};
use rayburst_scene::{BsdfSample, wide::LobeSample16};
use rayburst_simd::{Isa, Kernel};
use rayon::prelude::*;

use super::{
    analytic::SHARP_ROUGHNESS,
    gbuffer::{BAND, GBuffer, PixelKind, PixelSurface, PixelSurfaces, Pixels, squares},
    pass::{FrameContext, isa_of},
    paths::{PathRay, PathResult, Paths, density},
    quads::{Quads, asking},
    signals::{LEAST_REFLECTANCE, Lobe, Signals, guarded},
};
use crate::{
    RayCounts,
    dimensions::Vertex,
    footprint::{Arrival, RayFootprint, Turn},
};

/// What a pass of paths took and saw.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gathered {
    pub(crate) rays: RayCounts,
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

/// Paths and where each adds to.
#[derive(Debug, Default)]
struct Work {
    paths: Paths,
    targets: Vec<(Lobe, (u32, u32))>,
    asking: Vec<Asking>,
}

/// Lobes from this width on keep the footprint and forget the surface that they left, radians.
const WIDE: f32 = 0.2;

/// Directions of the broad lobes and of the glossy one come from dimensions of their own.
fn numbers(lobe: Lobe) -> u32 {
    match lobe {
        Lobe::Broad => Vertex::at_depth(1).direction(),
        Lobe::Glossy => Vertex::at_depth(1).direction() + 2,
    }
}

impl Work {
    fn clear(&mut self) {
        self.paths.clear();
        self.targets.clear();
        self.asking.clear();
    }

    /// Follows all paths and gives what each brought to where it adds to.
    fn gather(
        &mut self,
        frame: &FrameContext<'_>,
        mut give: impl FnMut(Lobe, (u32, u32), &PathResult),
    ) -> Gathered {
        let mut gathered = Gathered { rays: self.paths.run(frame), ..Gathered::default() };
        for (result, &(lobe, at)) in self.paths.results.iter().zip(&self.targets) {
            give(lobe, at, result);
            if lobe == Lobe::Broad {
                gathered.note(result);
            }
        }
        gathered
    }

    /// Starts a path with a ray that leaves a first hit by one of its lobes.
    fn begin(
        &mut self,
        frame: &FrameContext<'_>,
        gbuffer: &GBuffer,
        (x, y): (u32, u32),
        target: (u32, u32),
        lobe: Lobe,
        (ray, sample, throughput): (Ray, BsdfSample, Vec3),
    ) {
        let at = gbuffer.kind.index(x, y);
        let (wi, normal) = (ray.direction, gbuffer.normal.at(at));
        let turn = Turn { wi, transmitted: false, normal, eta: 1.0, spread: sample.spread };
        let footprint = self.turned(frame, gbuffer, (x, y), &turn);
        let sharp = lobe == Lobe::Glossy && gbuffer.roughness.at(at) < SHARP_ROUGHNESS;
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
        self.targets.push((Lobe::Glossy, (x, y)));
    }
}

/// What a lobe weighs in the choice of one: its albedo, if it is wanted.
#[inline(always)]
fn weight(albedo: Vec3x16, wanted: bool) -> F32x16 {
    if wanted { (albedo.x + albedo.y) + albedo.z } else { F32x16::ZERO }
}

/// Which lobes sixteen paths start by.
enum Choice {
    /// All by one.
    All(Lobe),
    /// Each by one of its own, in proportion to the albedos of those that are wanted.
    Each { indirect: bool, reflections: bool },
}

/// Starts of paths: pixels and where what they bring goes, sixteen at a time.
struct Starts<'a> {
    work: &'a mut Work,
    frame: &'a FrameContext<'a>,
    gbuffer: &'a GBuffer,
    asking: &'a [Asking],
    choice: Choice,
}

/// A pixel, and where what its path brings goes.
type Asking = ((u32, u32), (u32, u32));

impl Kernel for Starts<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for asking in self.asking.chunks(LANES) {
            self.sixteen(asking);
        }
    }
}

/// The first rays of sixteen paths.
struct FirstRays {
    glossy: Mask16,
    samples: LobeSample16,
    origin: Vec3x16,
    direction: Vec3x16,
    /// Demodulated factors on what they bring.
    throughput: Vec3x16,
}

impl Starts<'_> {
    #[inline(always)]
    fn sixteen(&mut self, asking: &[Asking]) {
        let Self { frame, gbuffer, .. } = *self;
        let mut at = [(0, 0); LANES];
        for (at, asking) in at.iter_mut().zip(asking) {
            *at = asking.0;
        }
        let pixels = Pixels::anywhere(&at[..asking.len()], gbuffer.size());
        let options = &frame.shading;
        let Some(surfaces) = gbuffer.surfaces_at(frame.scene, frame.view, options, &pixels) else {
            return;
        };
        let PixelSurfaces { lobes, wo, .. } = &surfaces;
        let samplers = frame.samplers(&pixels);
        let (broad, glossy) = lobes.albedos_apart(wo.z);
        let albedos = [broad, glossy];
        match self.choice {
            Choice::All(Lobe::Broad) => {
                let samples = lobes.sample_broad(*wo, samplers.get_2d(numbers(Lobe::Broad)));
                self.leave(asking, &surfaces, albedos, Mask16::NONE, F32x16::ONE, samples);
            }
            Choice::All(Lobe::Glossy) => {
                let samples = lobes.sample_glossy(*wo, samplers.get_2d(numbers(Lobe::Glossy)));
                self.leave(asking, &surfaces, albedos, Mask16::ALL, F32x16::ONE, samples);
            }
            Choice::Each { indirect, reflections } => {
                let (b, g) = (weight(broad, indirect), weight(glossy, reflections));
                let p = g / (b + g);
                let choice = samplers.get_1d(Vertex::at_depth(1).survival());
                let by_glossy = choice.is_less(p);
                let factor = 1.0 / by_glossy.select(p, 1.0 - p);
                let samples = lobes.sample_broad(*wo, samplers.get_2d(numbers(Lobe::Broad)));
                let others = lobes.sample_glossy(*wo, samplers.get_2d(numbers(Lobe::Glossy)));
                let samples = others.or(by_glossy, samples);
                self.leave(asking, &surfaces, albedos, by_glossy, factor, samples);
            }
        }
    }

    /// Lists the rays of samples; `factor` multiplies what they bring.
    #[inline(always)]
    fn leave(
        &mut self,
        asking: &[Asking],
        surfaces: &PixelSurfaces,
        [broad, glossy]: [Vec3x16; 2],
        by_glossy: Mask16,
        factor: F32x16,
        mut samples: LobeSample16,
    ) {
        let reflectance = by_glossy.select(glossy, broad);
        let guarded = reflectance.max(Vec3x16::splat(Vec3::splat(LEAST_REFLECTANCE)));
        let throughput = Vec3x16 {
            x: samples.weight.x / guarded.x,
            y: samples.weight.y / guarded.y,
            z: samples.weight.z / guarded.z,
        } * factor;
        let fine = ((throughput.x + throughput.y) + throughput.z).is_finite();
        let bright = throughput.max_element().is_greater(F32x16::ZERO);
        let coloured = reflectance.max_element().is_greater(F32x16::ZERO);
        samples.some = samples.some & surfaces.places.some & fine & bright & coloured;
        let up = Vec3x16::splat(Vec3::Y);
        let direction = surfaces.frame.to_world(samples.wi).normalize_or(up);
        let origin = surfaces.places.spawn(direction);
        let rays = FirstRays { glossy: by_glossy, samples, origin, direction, throughput };
        self.list(asking, &rays);
    }

    #[inline(never)]
    fn list(&mut self, asking: &[Asking], rays: &FirstRays) {
        for (lane, &(at, target)) in asking.iter().enumerate() {
            if !rays.samples.some.lane(lane) {
                continue;
            }
            let lobe = if rays.glossy.lane(lane) { Lobe::Glossy } else { Lobe::Broad };
            let wi = rays.direction.lane(lane);
            let ray = Ray::new(rays.origin.lane(lane), wi);
            let sample = BsdfSample {
                wi,
                weight: rays.samples.weight.lane(lane),
                pdf: rays.samples.pdf.0[lane],
                delta: rays.samples.delta.lane(lane),
                transmitted: false,
                spread: rays.samples.spread.0[lane],
            };
            let first = (ray, sample, rays.throughput.lane(lane));
            self.work.begin(self.frame, self.gbuffer, at, target, lobe, first);
        }
    }
}

/// A reflected ray of a first hit and the demodulated factor on what it brings.
#[inline]
pub(crate) fn reflected_ray(
    frame: &FrameContext<'_>,
    surface: &PixelSurface,
    at: (u32, u32),
) -> Option<(Ray, Vec3)> {
    let (_, glossy) = surface.bsdf.albedos_apart(surface.wo);
    let u = frame.sampler(at).get_2d(numbers(Lobe::Glossy));
    let sample = surface.bsdf.sample_glossy(surface.wo, u)?;
    let throughput = sample.weight / guarded(glossy);
    if throughput == Vec3::ZERO || !throughput.is_finite() {
        return None;
    }
    let wi = surface.frame.to_world(sample.wi).normalize();
    Some((Ray::new(surface.place.spawn(wi), wi), throughput))
}

/// One path a block of 2×2 pixels, by one of the lobes: reflections, or diffuse bounces.
pub(crate) fn gather_quads(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    quads: &mut Quads,
    lobe: Lobe,
) -> Gathered {
    let columns = quads.size().0;
    let isa = isa_of(frame.scene);
    let gathered: Vec<Gathered> = quads
        .rows()
        .into_par_iter()
        .map_init(Work::default, |work, mut rows| {
            work.clear();
            let mut listed = std::mem::take(&mut work.asking);
            for block in rows.blocks(columns) {
                rows.set(lobe, block, Vec3::ZERO, 0.0);
                let at = asking(rows.chosen.get(block.0, block.1), block);
                listed.extend(at.map(|at| (at, block)));
            }
            let choice = Choice::All(lobe);
            isa.dispatch(Starts { work, frame, gbuffer, asking: &listed, choice });
            work.asking = listed;
            work.gather(frame, |lobe, block, result| {
                rows.set(lobe, block, result.radiance, result.distance);
            })
        })
        .collect();
    gathered.into_iter().fold(Gathered::default(), Gathered::add)
}

/// A path for each pixel of a perfect mirror or glass; returns the rays it took.
pub(crate) fn gather_specular(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    signals: &mut Signals,
) -> RayCounts {
    let (width, height) = gbuffer.size();
    let bands: Vec<Band3<'_>> = signals.transparency.bands_mut(BAND).collect();
    let gathered: Vec<Gathered> = bands
        .into_par_iter()
        .enumerate()
        .map_init(Work::default, |work, (band, mut rows)| {
            work.clear();
            let top = band as u32 * BAND;
            for at in squares(width, top..(top + BAND).min(height)) {
                if gbuffer.kind.get(at.0, at.1) == PixelKind::Specular as u32 {
                    work.start_specular(frame, gbuffer, at);
                }
            }
            work.gather(frame, |_, (x, y), result| rows.set(x, y, result.radiance))
        })
        .collect();
    gathered.into_iter().fold(Gathered::default(), Gathered::add).rays
}

struct PixelRows<'a> {
    diffuse: Band3<'a>,
    specular: Band3<'a>,
    diffuse_distance: Band<'a>,
    specular_distance: Band<'a>,
}

/// One path a pixel; returns the rays it took.
pub(crate) fn gather_pixels(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    signals: &mut Signals,
) -> RayCounts {
    let passes = &frame.settings.passes;
    let (width, height) = gbuffer.size();
    let mut vectors =
        [signals.indirect_diffuse.bands_mut(BAND), signals.indirect_specular.bands_mut(BAND)];
    let mut planes = [
        signals.diffuse_hit_distance.bands_mut(BAND),
        signals.specular_hit_distance.bands_mut(BAND),
    ];
    let bands: Vec<PixelRows<'_>> = std::iter::from_fn(|| {
        let ([a, b], [c, d]) = (&mut vectors, &mut planes);
        Some(PixelRows {
            diffuse: a.next()?,
            specular: b.next()?,
            diffuse_distance: c.next()?,
            specular_distance: d.next()?,
        })
    })
    .collect();
    let isa = isa_of(frame.scene);
    let gathered: Vec<Gathered> = bands
        .into_par_iter()
        .enumerate()
        .map_init(Work::default, |work, (band, mut rows)| {
            work.clear();
            let top = band as u32 * BAND;
            let mut listed = std::mem::take(&mut work.asking);
            listed.extend(squares(width, top..(top + BAND).min(height)).map(|at| (at, at)));
            let (indirect, reflections) = (passes.indirect, passes.reflections);
            let choice = Choice::Each { indirect, reflections };
            isa.dispatch(Starts { work, frame, gbuffer, asking: &listed, choice });
            work.asking = listed;
            work.gather(frame, |lobe, (x, y), result| {
                let (light, distances) = match lobe {
                    Lobe::Broad => (&mut rows.diffuse, &mut rows.diffuse_distance),
                    Lobe::Glossy => (&mut rows.specular, &mut rows.specular_distance),
                };
                light.set(x, y, result.radiance);
                distances.set(x, y, result.distance);
            })
        })
        .collect();
    gathered.into_iter().fold(Gathered::default(), Gathered::add).rays
}
