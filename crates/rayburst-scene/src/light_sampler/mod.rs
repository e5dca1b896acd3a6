//! Which light to ask, and where on it: direct light at a point from one sample.
//!
//! A source is chosen first: the environment, a punctual light, or the emissive triangles of one
//! geometry of one instance; then a triangle by its power, then a point of it. Sources are chosen by
//! power, halfway mixed with an even choice among the three kinds that a scene has (environment,
//! directional lights, lights within the scene), because powers do not say what reaches a point: a sun
//! outside does not drown the lamps of a room.
//!
//! Multiple importance sampling: [`LightSampler::emitter_pdf`] and [`LightSampler::environment_pdf`]
//! are the densities with which this sampler finds what a scattered ray met. Punctual lights are
//! `delta`: no scattered ray finds them. That includes directional lights with a disc: [`LightSample`]
//! picks a point of the disc, and scattered rays do not see it; only rays that come from the camera
//! directly or over perfect mirrors and glass see suns, by [`LightSampler::sun_radiance`]. What is left
//! out are suns seen by rough surfaces in mirrors, which path tracing finds as fireflies only.

mod environment;
mod punctual;
#[cfg(test)]
mod tests;
pub(crate) mod triangle;

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use rayburst_math::{Hit, HitKind, distribution::Distribution1d};

pub use punctual::Arrival;

use crate::{FlatScene, LightKind, Material, Surface};
use environment::{EnvironmentSampler, luminance};

/// Light that may reach a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub direction: Vec3,
    /// Length of the shadow ray: a little short of emissive surfaces, infinite for the environment.
    pub distance: f32,
    /// Radiance that comes from there; for `delta` lights the illuminance on a facing plane. Both are
    /// multiplied by f·|cos θ| / `pdf`.
    pub radiance: Vec3,
    /// Density per solid angle, for `delta` lights probability; of the choice of the light, too.
    pub pdf: f32,
    /// Whether scattered rays cannot find this light.
    pub delta: bool,
}

/// Kinds of lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightKinds {
    /// What surrounds the scene.
    pub environment: bool,
    /// Points, spots, suns.
    pub punctual: bool,
    /// Surfaces that shine.
    pub emitters: bool,
}

impl LightKinds {
    /// All of them.
    pub const ALL: Self = Self { environment: true, punctual: true, emitters: true };
}

/// Samples the lights of a scene; built once for it.
#[derive(Clone, Debug)]
pub struct LightSampler {
    sources: Vec<Source>,
    choice: Distribution1d,
    environment: EnvironmentSampler,
    /// Probability of choosing the environment.
    environment_probability: f32,
    /// For each instance where its entries in `source_of` begin.
    first: Vec<u32>,
    /// For each geometry of each instance its source, or `NO_SOURCE`. Empty without emitters.
    source_of: Vec<u32>,
}

#[derive(Clone, Debug)]
enum Source {
    Environment,
    Punctual(u32),
    Emitter(Emitter),
}

/// Emissive triangles of one geometry of one instance.
#[derive(Clone, Debug)]
struct Emitter {
    instance: u32,
    geometry: u32,
    triangles: Distribution1d,
}

const NO_SOURCE: u32 = u32::MAX;

/// Share of the brightness of a triangle's own part of the texture in its weight; the rest is the
/// mean of the texture, so that no triangle that glows anywhere is forgotten.
const LOCAL_SHARE: f32 = 0.9;

/// What was gathered of a source: which kind it is, and its power.
struct Candidate {
    source: Source,
    kind: usize,
    power: f32,
}

impl LightSampler {
    /// Prepares the lights of a scene.
    pub fn new(scene: &FlatScene) -> Self {
        Self::of_kinds(scene, LightKinds::ALL, |_, _, _| false)
    }

    /// Prepares the lights of some kinds, but for some emissive triangles, whose light is found otherwise:
    /// what is left out is never sampled, and its density is zero. Whoever meets such a triangle by a
    /// scattered ray must not add its light. `excluded` gets instance, geometry and primitive.
    pub fn of_kinds(
        scene: &FlatScene,
        kinds: LightKinds,
        excluded: impl Fn(u32, u32, u32) -> bool,
    ) -> Self {
        // Powers that enter the scene's bounding sphere.
        let radius =
            if scene.bounds.is_empty() { 1.0 } else { 0.5 * scene.bounds.extent().length() };
        let entering = PI * radius * radius;
        let mut candidates = Vec::new();
        let (environment, total) = EnvironmentSampler::new(&scene.environment);
        if total > 0.0 {
            let power = total * entering;
            candidates.push(Candidate { source: Source::Environment, kind: 0, power });
        }
        for (i, light) in scene.lights.iter().enumerate() {
            let (kind, factor) = match light.kind {
                LightKind::Directional { .. } => (1, entering),
                LightKind::Point { .. } | LightKind::Spot { .. } => (2, 1.0),
            };
            let power = light.strength() * factor;
            candidates.push(Candidate { source: Source::Punctual(i as u32), kind, power });
        }
        let emissive: Vec<bool> = scene.materials.iter().map(Material::is_emissive).collect();
        for (i, instance) in scene.instances.iter().enumerate() {
            for g in 0..instance.geometry_count {
                let geometry = &scene.geometries[(instance.first_geometry + g) as usize];
                if !emissive.get(geometry.material as usize).is_some_and(|&e| e) {
                    continue;
                }
                let triangles = emitter_weights(scene, i as u32, g, &excluded);
                let power = triangles.total();
                let source =
                    Source::Emitter(Emitter { instance: i as u32, geometry: g, triangles });
                candidates.push(Candidate { source, kind: 2, power });
            }
        }
        let wanted = |source: &Source| match source {
            Source::Environment => kinds.environment,
            Source::Punctual(_) => kinds.punctual,
            Source::Emitter(_) => kinds.emitters,
        };
        candidates.retain(|c| c.power > 0.0 && c.power.is_finite() && wanted(&c.source));
        Self::choose_among(scene, candidates, environment)
    }

    fn choose_among(
        scene: &FlatScene,
        candidates: Vec<Candidate>,
        environment: EnvironmentSampler,
    ) -> Self {
        let mut totals = [0.0f64; 3];
        for c in &candidates {
            totals[c.kind] += f64::from(c.power);
        }
        let all: f64 = totals.iter().sum();
        let kinds = totals.iter().filter(|&&t| t > 0.0).count() as f64;
        let share = |c: &Candidate| {
            let kind = 0.5 * totals[c.kind] / all + 0.5 / kinds;
            (kind * f64::from(c.power) / totals[c.kind]) as f32
        };
        let weights: Vec<f32> = candidates.iter().map(share).collect();
        let choice = Distribution1d::new(&weights);

        let has_emitters = candidates.iter().any(|c| matches!(c.source, Source::Emitter(_)));
        let (mut first, mut source_of) = (Vec::new(), Vec::new());
        if has_emitters {
            for instance in &scene.instances {
                first.push(source_of.len() as u32);
                let end = source_of.len() + instance.geometry_count as usize;
                source_of.resize(end, NO_SOURCE);
            }
        }
        let mut environment_probability = 0.0;
        for (i, c) in candidates.iter().enumerate() {
            match &c.source {
                Source::Environment => environment_probability = choice.probability(i),
                Source::Punctual(_) => {}
                Source::Emitter(e) => {
                    source_of[(first[e.instance as usize] + e.geometry) as usize] = i as u32;
                }
            }
        }
        let sources = candidates.into_iter().map(|c| c.source).collect();
        Self { sources, choice, environment, environment_probability, first, source_of }
    }

    /// Whether there is nothing to sample.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// One light that may shine on a surface: `choice` in [0, 1) picks which, `u` where on it.
    pub fn sample(
        &self,
        scene: &FlatScene,
        surface: &Surface,
        choice: f32,
        u: Vec2,
    ) -> Option<LightSample> {
        self.sample_from(scene, surface.position, choice, u)
    }

    /// As [`LightSampler::sample`], for a point in space.
    pub fn sample_from(
        &self,
        scene: &FlatScene,
        from: Vec3,
        choice: f32,
        u: Vec2,
    ) -> Option<LightSample> {
        self.sample_except(scene, from, choice, u, |_, _, _| false)
    }

    /// As [`LightSampler::sample_from`], but `None` where an emissive triangle is chosen for which
    /// `excluded` says so, by instance, geometry and primitive. Densities of all else stay what they
    /// are: the mean over all samples, those without light counted as zero, is the light of what is not
    /// excluded. For lights that are found otherwise in a part of the picture only.
    pub fn sample_except(
        &self,
        scene: &FlatScene,
        from: Vec3,
        choice: f32,
        u: Vec2,
        excluded: impl Fn(u32, u32, u32) -> bool,
    ) -> Option<LightSample> {
        let (index, probability, rest) = self.choice.sample(choice)?;
        match &self.sources[index] {
            Source::Environment => {
                let (direction, pdf, radiance) = self.environment.sample(&scene.environment, u)?;
                Some(LightSample {
                    direction,
                    distance: f32::INFINITY,
                    radiance,
                    pdf: probability * pdf,
                    delta: false,
                })
            }
            Source::Punctual(i) => {
                let arrival = scene.lights[*i as usize].arrival(from, u)?;
                Some(LightSample {
                    direction: arrival.direction,
                    distance: arrival.distance,
                    radiance: arrival.illuminance,
                    pdf: probability,
                    delta: true,
                })
            }
            Source::Emitter(emitter) => {
                let (primitive, p, _) = emitter.triangles.sample(rest)?;
                if excluded(emitter.instance, emitter.geometry, primitive as u32) {
                    return None;
                }
                sample_emitter(scene, emitter, primitive, from, probability * p, u)
            }
        }
    }

    /// Density per solid angle with which [`LightSampler::sample`] finds the emissive surface that a
    /// ray from `origin` in the unit direction `direction` met; 0 if it never does.
    pub fn emitter_pdf(&self, scene: &FlatScene, hit: &Hit, origin: Vec3, direction: Vec3) -> f32 {
        let Some(&first) = self.first.get(hit.instance as usize) else { return 0.0 };
        let source = self.source_of[(first + hit.geometry) as usize];
        let Some(Source::Emitter(emitter)) = self.sources.get(source as usize) else { return 0.0 };
        let triangle = scene.world_triangle(hit.instance, hit.geometry, hit.primitive);
        let area_vector = triangle.area_vector();
        let (_, geometry) = scene.records(hit);
        let two_sided = scene.materials[geometry.material as usize].is_double_sided();
        if !two_sided && area_vector.dot(direction) >= 0.0 {
            return 0.0;
        }
        let to = origin + direction * hit.t;
        self.choice.probability(source as usize)
            * emitter.triangles.probability(hit.primitive as usize)
            * triangle::pdf(triangle.points, area_vector, origin, to)
    }

    /// Density per solid angle with which [`LightSampler::sample`] finds the environment in a unit
    /// direction.
    pub fn environment_pdf(&self, scene: &FlatScene, direction: Vec3) -> f32 {
        self.environment_probability * self.environment.pdf(&scene.environment, direction)
    }

    /// Radiance of the environment in a unit direction, without suns, and the density of
    /// [`LightSampler::environment_pdf`].
    pub fn environment_found(&self, scene: &FlatScene, direction: Vec3) -> (Vec3, f32) {
        if self.environment_probability == 0.0 {
            return (scene.environment.radiance(direction), 0.0);
        }
        let (radiance, pdf) = self.environment.found(&scene.environment, direction);
        (radiance, self.environment_probability * pdf)
    }

    /// Radiance of the environment in a unit direction, without suns.
    pub fn environment_radiance(&self, scene: &FlatScene, direction: Vec3) -> Vec3 {
        scene.environment.radiance(direction)
    }

    /// Radiance of the directional lights' discs in a unit direction, for rays that come from the
    /// camera or over perfectly specular surfaces only.
    pub fn sun_radiance(&self, scene: &FlatScene, direction: Vec3) -> Vec3 {
        scene.lights.iter().map(|light| light.visible_radiance(direction)).sum()
    }
}

/// The triangles of an emissive geometry by power in lumens, excluded ones with none.
fn emitter_weights(
    scene: &FlatScene,
    instance: u32,
    geometry: u32,
    excluded: &impl Fn(u32, u32, u32) -> bool,
) -> Distribution1d {
    let record = &scene.instances[instance as usize];
    let flat = &scene.geometries[(record.first_geometry + geometry) as usize];
    let material = &scene.materials[flat.material as usize];
    let emissive = Vec3::from_array(material.emissive);
    let mean = luminance(emissive * scene.texture_mean(&material.emissive_texture).truncate());
    let sides = if material.is_double_sided() { 2.0 } else { 1.0 };
    let slot = &material.emissive_texture;
    let uvs = flat.primitive.uvs.get(slot.uv_set as usize).or(flat.primitive.uvs.first());
    let uvs = uvs.filter(|_| slot.index().is_some());
    let weights: Vec<f32> = (0..flat.primitive.indices.len())
        .map(|i| {
            if excluded(instance, geometry, i as u32) {
                return 0.0;
            }
            let area = scene.world_triangle(instance, geometry, i as u32).area_vector().length();
            let local = uvs.map_or(mean, |uvs| {
                let [a, b, c] = flat.primitive.indices[i].map(|v| uvs[v as usize]);
                let footprint = (0.5 * (b - a).perp_dot(c - a).abs()).sqrt();
                let texel = scene.texture(slot, (a + b + c) / 3.0, footprint).truncate();
                luminance(emissive * texel)
            });
            // Even a texture whose mean rounds to black may glow somewhere.
            let floor = 1e-3 * luminance(emissive);
            let bright = LOCAL_SHARE * local + (1.0 - LOCAL_SHARE) * mean.max(floor);
            PI * area * sides * bright
        })
        .collect();
    Distribution1d::new(&weights)
}

/// How far a shadow ray to a point of an emitter reaches: its end must not meet the emitter itself.
pub(crate) fn short_of(point: Vec3, distance: f32) -> Option<f32> {
    let slack = 1e-4 * distance + 4e-6 * point.abs().max_element();
    (distance > slack).then_some(distance - slack)
}

fn sample_emitter(
    scene: &FlatScene,
    emitter: &Emitter,
    primitive: usize,
    from: Vec3,
    probability: f32,
    u: Vec2,
) -> Option<LightSample> {
    let (instance, geometry) = (emitter.instance, emitter.geometry);
    let triangle = scene.world_triangle(instance, geometry, primitive as u32);
    let [a, b, c] = triangle.points;
    let uv = triangle::sample(triangle.points, from, u);
    let point = a + uv.x * (b - a) + uv.y * (c - a);
    let to = point - from;
    let distance = to.length();
    let reach = short_of(point, distance)?;
    let direction = to / distance;
    let area_vector = triangle.area_vector();
    let hit = Hit {
        t: distance,
        u: uv.x,
        v: uv.y,
        primitive: primitive as u32,
        geometry,
        instance,
        kind: HitKind::TRIANGLE_FRONT,
        ..Hit::MISS
    };
    let (_, record) = scene.records(&hit);
    let material = &scene.materials[record.material as usize];
    if !material.is_double_sided() && area_vector.dot(direction) >= 0.0 {
        return None;
    }
    // A scattered ray would find the lamp only where alpha does not let it pass.
    let mut radiance = Vec3::from_array(material.emissive) * scene.coverage(&hit);
    let slot = &material.emissive_texture;
    if slot.index().is_some() {
        radiance *= scene.texture(slot, scene.uv_at(&hit, slot.uv_set), 0.0).truncate();
    }
    let pdf = probability * triangle::pdf(triangle.points, area_vector, from, point);
    (pdf > 0.0 && pdf.is_finite()).then_some(LightSample {
        direction,
        distance: reach,
        radiance,
        pdf,
        delta: false,
    })
}
