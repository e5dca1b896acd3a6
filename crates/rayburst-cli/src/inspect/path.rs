//! One path of the `path` integrator, vertex by vertex: the same decisions from the same random
//! numbers, and a record of each.

use rayburst::{
    accel::{Counters, TraceOptions},
    glam::{Vec2, Vec3},
    image::PixelFilter,
    math::{Hit, Ray, Sampler, hash},
    render::{
        RayFootprint, RenderSettings,
        footprint::{Arrival, Turn},
    },
    scene::{
        AlphaFilter, BsdfSample, Camera, FlatScene, LightSample, LightSampler, ShadingOptions,
        Surface,
    },
};

/// From this depth on paths may end at random.
const ROULETTE_DEPTH: u32 = 4;

/// A ray and what it met.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    pub(super) ray: Ray,
    pub(super) hit: Hit,
    pub(super) counts: Counters,
}

/// Light that a vertex looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lookup {
    pub(super) light: LightSample,
    pub(super) shadow: Segment,
    /// f·|cos θ| towards the light, and the density with which the surface itself would look there.
    pub(super) f: Vec3,
    pub(super) pdf: f32,
    pub(super) weight: f32,
    /// What it adds to the sample.
    pub(super) adds: Vec3,
}

/// Where a path turns or ends.
#[derive(Clone, Debug)]
pub(super) struct Vertex {
    pub(super) depth: u32,
    pub(super) segment: Segment,
    /// Where it is and what it is made of; `None` outside the scene.
    pub(super) place: Option<Place>,
    /// Light that the path met here by chance, its weight, and what it adds to the sample.
    pub(super) met: Vec3,
    pub(super) met_weight: f32,
    pub(super) met_adds: Vec3,
    pub(super) lookup: Option<Lookup>,
    pub(super) turn: Option<BsdfSample>,
    /// Probability of going on, below 1 where chance decides.
    pub(super) survival: f32,
    /// Of the path after this vertex.
    pub(super) throughput: Vec3,
}

/// A surface with its material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) surface: Surface,
    pub(super) base_color: Vec3,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
}

/// Traces paths of one picture.
pub(super) struct Tracer<'a> {
    scene: &'a FlatScene,
    camera: &'a Camera,
    settings: &'a RenderSettings,
    lights: LightSampler,
    filter: PixelFilter,
    shading: ShadingOptions,
}

impl<'a> Tracer<'a> {
    pub(super) fn new(
        scene: &'a FlatScene,
        camera: &'a Camera,
        settings: &'a RenderSettings,
    ) -> Self {
        let filter = PixelFilter::new(settings.filter);
        let shading = ShadingOptions {
            lod: settings.texture_lod,
            energy_compensation: settings.energy_compensation,
            ..ShadingOptions::default()
        };
        Self { scene, camera, settings, lights: LightSampler::new(scene), filter, shading }
    }

    /// All vertices of one sample of a pixel, and its radiance.
    pub(super) fn path(&self, (x, y): (u32, u32), sample: u32) -> (Vec<Vertex>, Vec3) {
        let (width, height) = self.settings.size;
        let pixel = y * width + x;
        let (kind, seed) = (self.settings.sampler, self.settings.seed);
        let sampler = Sampler::at(kind, seed, (x, y), width, sample);
        let key = hash::words(&[self.settings.seed, pixel, sample]);
        let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + self.filter.sample(sampler.get_2d(0));
        let (size, lens) = ((width, height), sampler.get_2d(2));
        let (mut ray, cone) = self.camera.ray(at, size, lens);
        let lod = self.settings.texture_lod;
        let mut footprint = RayFootprint::of_eye(lod, self.camera, at, size, lens, cone);
        let mut state =
            State { sampler, key, throughput: Vec3::ONE, pdf: f32::INFINITY, specular: true };
        let mut radiance = Vec3::ZERO;
        let mut vertices = Vec::new();
        for depth in 1..=self.settings.max_depth {
            let segment = self.trace(&ray, hash::combine(key, depth));
            let (vertex, next) = self.vertex(depth, segment, &footprint, &mut state);
            radiance += vertex.met_adds + vertex.lookup.map_or(Vec3::ZERO, |l| l.adds);
            vertices.push(vertex);
            match next {
                Some(next) => (ray, footprint) = next,
                None => break,
            }
        }
        (vertices, radiance)
    }

    fn trace(&self, ray: &Ray, key: u32) -> Segment {
        let keys = [key];
        let filter = AlphaFilter::new(self.scene, &keys);
        let (mut hits, mut counts) = ([Hit::MISS], [Counters::default()]);
        let options = TraceOptions::default();
        self.scene.tlas.closest_hits_counted(&[*ray], &mut hits, &mut counts, &options, &filter);
        Segment { ray: *ray, hit: hits[0], counts: counts[0] }
    }

    fn vertex(
        &self,
        depth: u32,
        segment: Segment,
        footprint: &RayFootprint,
        state: &mut State,
    ) -> (Vertex, Option<(Ray, RayFootprint)>) {
        let mut vertex = Vertex {
            depth,
            segment,
            place: None,
            met: Vec3::ZERO,
            met_weight: 1.0,
            met_adds: Vec3::ZERO,
            lookup: None,
            turn: None,
            survival: 1.0,
            throughput: state.throughput,
        };
        let Segment { ray, hit, .. } = segment;
        let weight = |pdf: f32, other: f32| {
            if pdf == f32::INFINITY { 1.0 } else { pdf / (pdf + other) }
        };
        if !hit.is_hit() {
            vertex.met = self.lights.environment_radiance(self.scene, ray.direction);
            let other = self.lights.environment_pdf(self.scene, ray.direction);
            vertex.met_weight = weight(state.pdf, other);
            vertex.met_adds = state.throughput * vertex.met * vertex.met_weight;
            if state.specular {
                let sun = self.lights.sun_radiance(self.scene, ray.direction);
                vertex.met += sun;
                vertex.met_adds += state.throughput * sun;
            }
            return (vertex, None);
        }
        let surface = self.scene.surface(&hit);
        let wo = -ray.direction;
        let seen = footprint.at(&ray, &hit, &surface);
        let point = self.scene.shading_point(&surface, wo, seen, &self.shading);
        vertex.place = Some(Place {
            surface,
            base_color: point.base_color,
            metallic: point.metallic,
            roughness: point.roughness,
        });
        vertex.met = point.emitted;
        let other = self.lights.emitter_pdf(self.scene, &hit, ray.origin, ray.direction);
        vertex.met_weight = weight(state.pdf, other);
        vertex.met_adds = state.throughput * point.emitted * vertex.met_weight;
        if depth >= self.settings.max_depth {
            return (vertex, None);
        }
        let numbers = 4 + 8 * (depth - 1);
        let sampler = state.sampler;
        let light = self.lights.sample(
            self.scene,
            &surface,
            sampler.get_1d(numbers + 2),
            sampler.get_2d(numbers),
        );
        if let Some(light) = light.filter(|_| !point.bsdf.is_delta()) {
            let (f, pdf) = point.evaluate(wo, light.direction);
            let weight = if light.delta { 1.0 } else { light.pdf / (light.pdf + pdf) };
            let origin = surface.spawn(light.direction);
            let ray = Ray::with_interval(origin, light.direction, 0.0, light.distance);
            let shadow = self.trace(&ray, hash::combine(state.key, !depth));
            let adds = if shadow.hit.is_hit() {
                Vec3::ZERO
            } else {
                state.throughput * f * light.radiance * (weight / light.pdf)
            };
            vertex.lookup = Some(Lookup { light, shadow, f, pdf, weight, adds });
        }
        let u = sampler.get_2d(numbers + 4).extend(sampler.get_1d(numbers + 6));
        let Some(turn) = point.sample(wo, u) else { return (vertex, None) };
        vertex.turn = Some(turn);
        let mut factor = turn.weight;
        if self.settings.russian_roulette && depth >= ROULETTE_DEPTH {
            vertex.survival = (state.throughput * factor).max_element().clamp(0.05, 1.0);
            if sampler.get_1d(numbers + 3) >= vertex.survival {
                vertex.throughput = Vec3::ZERO;
                return (vertex, None);
            }
            factor /= vertex.survival;
        }
        state.throughput *= factor;
        state.pdf = if turn.delta { f32::INFINITY } else { turn.pdf };
        state.specular &= turn.delta;
        vertex.throughput = state.throughput;
        let next = Ray::new(surface.spawn(turn.wi), turn.wi);
        let arrival = Arrival { scene: self.scene, ray: &ray, hit: &hit, surface: &surface };
        let footprint = footprint.turned(&arrival, &Turn::of_sample(&point, &turn));
        (vertex, Some((next, footprint)))
    }
}

/// What a path carries from vertex to vertex.
struct State {
    sampler: Sampler,
    key: u32,
    throughput: Vec3,
    /// Density of the last turn; infinite where there was no choice.
    pdf: f32,
    /// Whether it has met nothing but perfect mirrors and glass.
    specular: bool,
}
