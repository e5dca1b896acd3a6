//! Lights as points, for the integrator without randomness.
//!
//! A mesh of total area A, whose area vectors sum to V, and of radiance L becomes a point at its centre
//! with the intensity L·(max(0, V·ω) + (A − |V|)/4) towards ω. That is exact from afar for flat
//! emitters (V·ω is the projected area) and for closed convex ones (V = 0, and the mean projected area
//! is A/4; Cauchy).

use std::f32::consts::PI;

use rayburst_math::{
    Hit, HitKind,
    glam::{Vec2, Vec3},
};
use rayburst_scene::{Arrival, Environment, FlatScene, Footprint, Light, ShadingOptions};

/// The most emitting meshes that become lights; the brightest, scaled to the power of all.
const MAX_EMITTERS: usize = 16;

/// All lights of a scene as points.
#[derive(Clone, Debug, Default)]
pub(crate) struct PointLights {
    punctual: Vec<Light>,
    emitters: Vec<Emitter>,
    /// Mean radiance of the environment.
    pub(crate) ambient: Vec3,
}

#[derive(Clone, Copy, Debug)]
struct Emitter {
    instance: u32,
    geometry: u32,
    centre: Vec3,
    radiance: Vec3,
    area_vector: Vec3,
    area: f32,
    double_sided: bool,
}

impl PointLights {
    pub(crate) fn new(scene: &FlatScene) -> Self {
        let mut emitters: Vec<Emitter> = Vec::new();
        for (i, instance) in scene.instances.iter().enumerate() {
            for g in 0..instance.geometry_count {
                let geometry = &scene.geometries[(instance.first_geometry + g) as usize];
                if scene.materials[geometry.material as usize].is_emissive() {
                    emitters.extend(Emitter::new(scene, i as u32, g));
                }
            }
        }
        emitters.sort_by(|a, b| b.power().total_cmp(&a.power()));
        let all: f32 = emitters.iter().map(Emitter::power).sum();
        emitters.truncate(MAX_EMITTERS);
        let kept: f32 = emitters.iter().map(Emitter::power).sum();
        for emitter in &mut emitters {
            emitter.radiance *= all / kept;
        }
        Self { punctual: scene.lights.clone(), emitters, ambient: mean(&scene.environment) }
    }

    /// What arrives at a point from each light, if nothing is in between.
    pub(crate) fn seen_from(&self, point: Vec3) -> impl Iterator<Item = (u32, Arrival)> {
        let middle = Vec2::splat(0.5);
        let punctual = self.punctual.iter().map(move |light| light.arrival(point, middle));
        let emitters = self.emitters.iter().map(move |emitter| Some(emitter.arrival(point)));
        (0..).zip(punctual.chain(emitters)).filter_map(|(light, arrival)| Some((light, arrival?)))
    }

    /// Whether a ray to a light gets there: nothing is in its way but the emitter itself.
    pub(crate) fn is_reached(&self, light: u32, hit: &Hit) -> bool {
        !hit.is_hit()
            || (light as usize)
                .checked_sub(self.punctual.len())
                .and_then(|emitter| self.emitters.get(emitter))
                .is_some_and(|e| (e.instance, e.geometry) == (hit.instance, hit.geometry))
    }
}

impl Emitter {
    /// `None` if it has no area or shines black.
    fn new(scene: &FlatScene, instance: u32, geometry: u32) -> Option<Self> {
        let record = &scene.instances[instance as usize];
        let source = &scene.geometries[(record.first_geometry + geometry) as usize];
        let (mut area, mut centre, mut area_vector, mut power) =
            (0.0, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        for primitive in 0..source.primitive.indices.len() as u32 {
            let triangle = scene.world_triangle(instance, geometry, primitive);
            let vector = triangle.area_vector();
            let own = vector.length();
            if !own.is_finite() || own == 0.0 {
                continue;
            }
            let third = 1.0 / 3.0;
            let kind = HitKind::TRIANGLE_FRONT;
            let hit = Hit {
                t: 0.0,
                u: third,
                v: third,
                primitive,
                geometry,
                instance,
                kind,
                reserved: 0,
            };
            let surface = scene.surface(&hit);
            let normal = vector / own;
            let options = ShadingOptions::default();
            let emitted = scene
                .shading_point(&surface, normal, Footprint::cone(own.sqrt()), &options)
                .emitted;
            area += own;
            area_vector += vector;
            centre += own * triangle.points.iter().sum::<Vec3>() * third;
            power += own * emitted;
        }
        let radiance = power / area;
        (radiance.is_finite() && radiance.max_element() > 0.0).then(|| Self {
            instance,
            geometry,
            centre: centre / area,
            radiance,
            area_vector,
            area,
            double_sided: scene.materials[source.material as usize].is_double_sided(),
        })
    }

    fn power(&self) -> f32 {
        self.area * self.radiance.element_sum()
    }

    fn arrival(&self, point: Vec3) -> Arrival {
        let to = self.centre - point;
        let distance = to.length();
        let direction = to / distance.max(f32::MIN_POSITIVE);
        let facing = -direction.dot(self.area_vector);
        let flat = if self.double_sided { facing.abs() } else { facing.max(0.0) };
        let closed = 0.25 * (self.area - self.area_vector.length()).max(0.0);
        // Close up, no more than what fills the hemisphere.
        let solid_angle = ((flat + closed) / distance.powi(2).max(f32::MIN_POSITIVE)).min(PI);
        Arrival {
            direction,
            distance: distance * (1.0 - 1e-5),
            illuminance: self.radiance * solid_angle,
        }
    }
}

/// The mean radiance of an environment over the sphere.
fn mean(environment: &Environment) -> Vec3 {
    match environment {
        Environment::None => Vec3::ZERO,
        Environment::Constant(radiance) => *radiance,
        Environment::Map(map) => {
            let (width, height) = map.size;
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for (y, row) in map.texels.chunks_exact(width.max(1) as usize).enumerate() {
                let weight = ((y as f32 + 0.5) / height as f32 * PI).sin();
                sum += weight * row.iter().sum::<Vec3>() / width as f32;
                weights += weight;
            }
            map.intensity * sum / weights.max(f32::MIN_POSITIVE)
        }
    }
}
