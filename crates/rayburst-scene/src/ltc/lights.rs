//! The lamps of a scene that are polygons.

use glam::{Vec2, Vec3};
use rayburst_image::colour::luminance;
use rayburst_math::{Aabb, Hit};

use super::{
    merge::{Merged, merge},
    polygon::MAX_CORNERS,
};
use crate::{
    AlphaMode, FlatScene, Material,
    light_sampler::{short_of, triangle},
};

/// Which lamps become polygons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PolygonLightLimits {
    /// Geometries of more triangles are left out.
    pub triangles: u32,
    /// The most polygons; the weakest are left out.
    pub lights: u32,
}

impl Default for PolygonLightLimits {
    fn default() -> Self {
        Self { triangles: 128, lights: 1024 }
    }
}

/// A convex polygon of constant radiance in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct PolygonLight {
    corners: [Vec3; MAX_CORNERS],
    count: u32,
    /// Unit normal of the front, about which the corners go counter-clockwise.
    pub normal: Vec3,
    /// Mean of the corners.
    pub centre: Vec3,
    /// Around the corners.
    pub bounds: Aabb,
    /// Area.
    pub area: f32,
    /// Radiance of the sides that shine, cd/m².
    pub radiance: Vec3,
    /// Whether the back shines, too.
    pub two_sided: bool,
    /// The instance that it is of.
    pub instance: u32,
    /// The geometry in the instance.
    pub geometry: u32,
    first_primitive: u32,
    primitive_count: u32,
}

impl PolygonLight {
    /// Corners in order.
    #[inline]
    pub fn corners(&self) -> &[Vec3] {
        &self.corners[..self.count as usize]
    }

    /// Radiance on the side where `point` is; zero behind one-sided lights and, so that lamps do not
    /// shine on themselves, in the light's plane.
    #[inline]
    pub fn radiance_towards(&self, point: Vec3) -> Vec3 {
        let height = (point - self.centre).dot(self.normal);
        let slack = 1e-5 * self.area.sqrt() + 5e-7 * point.abs().max_element();
        let shines = height > slack || (self.two_sided && height < -slack);
        if shines { self.radiance } else { Vec3::ZERO }
    }

    /// A point of the light as seen from `from`, that `u` in [0, 1)² picks. `None` where it is too near.
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<PolygonSample> {
        let corners = self.corners();
        let first = *corners.first()?;
        let area = |pair: &[Vec3]| 0.5 * (pair[0] - first).cross(pair[1] - first);
        let total: f32 = corners[1..].windows(2).map(|pair| area(pair).length()).sum();
        // A triangle of the fan by its area.
        let mut left = u.x * total;
        let mut fan = corners[1..].windows(2).peekable();
        while let Some(pair) = fan.next() {
            let vector = area(pair);
            let size = vector.length();
            if left < size || fan.peek().is_none() {
                let u = Vec2::new((left / size).clamp(0.0, 1.0 - f32::EPSILON), u.y);
                let points = [first, pair[0], pair[1]];
                let at = triangle::sample(points, from, u);
                let point = first + at.x * (pair[0] - first) + at.y * (pair[1] - first);
                let pdf = size / total * triangle::pdf(points, vector, from, point);
                let reach = short_of(point, from.distance(point))?;
                return (pdf > 0.0 && pdf.is_finite()).then_some(PolygonSample {
                    point,
                    reach,
                    pdf,
                });
            }
            left -= size;
        }
        None
    }

    /// Luminous power per steradian of facing area: luminance times area.
    #[inline]
    pub fn intensity(&self) -> f32 {
        luminance(self.radiance) * self.area
    }
}

/// A sampled point of a [`PolygonLight`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolygonSample {
    /// In the world.
    pub point: Vec3,
    /// Length of a shadow ray to it that does not meet the light itself.
    pub reach: f32,
    /// Density per solid angle.
    pub pdf: f32,
}

/// All polygon lights of a scene, and which hits belong to them. All other lights (textured, partly
/// transparent or finely tessellated emitters, the environment, punctual lights) are left for sampling:
/// see [`crate::LightSampler::of_kinds`].
#[derive(Clone, Debug, Default)]
pub struct PolygonLights {
    lights: Vec<PolygonLight>,
    /// Primitives of the lights, one after another.
    primitives: Vec<u32>,
    /// For each instance where its geometries begin in `geometries`. Empty without lights.
    instances: Vec<u32>,
    /// For each geometry of each instance where its primitives begin in `light_of`, and how many.
    geometries: Vec<(u32, u32)>,
    /// For each primitive of geometries with lights its light, or `NONE`.
    light_of: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl PolygonLights {
    /// Finds the lights of a scene.
    pub fn new(scene: &FlatScene, limits: &PolygonLightLimits) -> Self {
        let mut found: Vec<(PolygonLight, Vec<u32>)> = Vec::new();
        for (i, instance) in scene.instances.iter().enumerate() {
            for g in 0..instance.geometry_count {
                found.extend(polygons(scene, i as u32, g, limits.triangles));
            }
        }
        if found.len() > limits.lights as usize {
            // Stable, so that equal lamps stay in order.
            found.sort_by(|a, b| b.0.intensity().total_cmp(&a.0.intensity()));
            found.truncate(limits.lights as usize);
        }
        let mut all = Self::default();
        for (light, primitives) in found {
            let first_primitive = all.primitives.len() as u32;
            let primitive_count = primitives.len() as u32;
            all.primitives.extend(primitives);
            all.lights.push(PolygonLight { first_primitive, primitive_count, ..light });
        }
        all.index(scene);
        all
    }

    fn index(&mut self, scene: &FlatScene) {
        if self.lights.is_empty() {
            return;
        }
        for instance in &scene.instances {
            self.instances.push(self.geometries.len() as u32);
            let end = self.geometries.len() + instance.geometry_count as usize;
            self.geometries.resize(end, (0, 0));
        }
        for (index, light) in (0..).zip(&self.lights) {
            let record = &scene.instances[light.instance as usize];
            let place = (self.instances[light.instance as usize] + light.geometry) as usize;
            if self.geometries[place].1 == 0 {
                let flat = &scene.geometries[(record.first_geometry + light.geometry) as usize];
                let count = flat.primitive.indices.len();
                self.geometries[place] = (self.light_of.len() as u32, count as u32);
                self.light_of.resize(self.light_of.len() + count, NONE);
            }
            let first = self.geometries[place].0;
            let begin = light.first_primitive as usize;
            for &primitive in &self.primitives[begin..][..light.primitive_count as usize] {
                self.light_of[(first + primitive) as usize] = index;
            }
        }
    }

    /// The lights.
    #[inline]
    pub fn lights(&self) -> &[PolygonLight] {
        &self.lights
    }

    /// Whether there are none.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// The triangles that a light is made of, by their numbers in its geometry.
    #[inline]
    pub fn primitives(&self, light: &PolygonLight) -> &[u32] {
        &self.primitives[light.first_primitive as usize..][..light.primitive_count as usize]
    }

    /// The light that a triangle is part of, as an index of [`PolygonLights::lights`].
    #[inline]
    pub fn light_of(&self, instance: u32, geometry: u32, primitive: u32) -> Option<u32> {
        let first = *self.instances.get(instance as usize)?;
        let (begin, count) = *self.geometries.get((first + geometry) as usize)?;
        if primitive >= count {
            return None;
        }
        let light = self.light_of[(begin + primitive) as usize];
        (light != NONE).then_some(light)
    }

    /// The light that was hit.
    #[inline]
    pub fn light_of_hit(&self, hit: &Hit) -> Option<u32> {
        if hit.is_hit() { self.light_of(hit.instance, hit.geometry, hit.primitive) } else { None }
    }
}

/// Whether a material shines evenly.
fn is_even(material: &Material) -> bool {
    material.is_emissive()
        && material.emissive_texture.index().is_none()
        && material.emissive.iter().all(|e| e.is_finite() && *e >= 0.0)
        && material.alpha_mode() == AlphaMode::Opaque
}

/// The polygons of one geometry with their primitives; none if it does not shine evenly.
fn polygons(
    scene: &FlatScene,
    instance: u32,
    geometry: u32,
    most: u32,
) -> Vec<(PolygonLight, Vec<u32>)> {
    let record = &scene.instances[instance as usize];
    let flat = &scene.geometries[(record.first_geometry + geometry) as usize];
    let count = flat.primitive.indices.len();
    let material = scene.materials.get(flat.material as usize).filter(|m| is_even(m));
    let Some(material) = material.filter(|_| count <= most as usize) else { return Vec::new() };
    let triangles: Vec<[Vec3; 3]> = (0..count as u32)
        .map(|primitive| {
            let triangle = scene.world_triangle(instance, geometry, primitive);
            let [a, b, c] = triangle.points;
            if triangle.flipped { [a, c, b] } else { [a, b, c] }
        })
        .collect();
    let light = |merged: Merged| {
        let count = merged.corners.len();
        let mut corners = [Vec3::ZERO; MAX_CORNERS];
        corners[..count].copy_from_slice(&merged.corners);
        let vector: Vec3 = (1..count - 1)
            .map(|i| 0.5 * (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]))
            .sum();
        let light = PolygonLight {
            corners,
            count: count as u32,
            normal: vector.normalize_or(Vec3::Y),
            centre: merged.corners.iter().sum::<Vec3>() / count as f32,
            bounds: Aabb::of_points(merged.corners.iter().copied()),
            area: vector.length(),
            radiance: Vec3::from_array(material.emissive),
            two_sided: material.is_double_sided(),
            instance,
            geometry,
            first_primitive: 0,
            primitive_count: 0,
        };
        (light, merged.triangles)
    };
    merge(&triangles).into_iter().filter(|m| m.corners.len() >= 3).map(light).collect()
}
