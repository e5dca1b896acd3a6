//! Which polygon lights matter most to a part of the picture.

use glam::Vec3;
use rayburst_image::colour::luminance;
use rayburst_math::Aabb;

use super::lights::{PolygonLight, PolygonLights};

/// The surfaces of a part of the picture: where they are and how they are turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceBounds {
    /// Around all points.
    pub positions: Aabb,
    /// Unit axis of a cone that holds all normals.
    pub axis: Vec3,
    /// Half the cone's opening angle in radians; π or more holds all normals.
    pub spread: f32,
}

impl SurfaceBounds {
    /// Nothing is known of the normals.
    pub fn of_positions(positions: Aabb) -> Self {
        Self { positions, axis: Vec3::Y, spread: std::f32::consts::PI }
    }
}

impl PolygonLights {
    /// A bound on the illuminance from a light at any of some surfaces: power, distance and facing of
    /// both sides, each at its best. 0 means that the light reaches none of them. In lux.
    pub fn importance(light: &PolygonLight, surfaces: &SurfaceBounds) -> f32 {
        if surfaces.positions.is_empty() {
            return 0.0;
        }
        let distance = between(&surfaces.positions, &light.bounds);
        let facing = light_facing(light, &surfaces.positions, distance);
        let solid_angle = light.area * facing / (distance * distance).max(f32::MIN_POSITIVE);
        let cosine = surface_facing(light, surfaces);
        // Lights that fill the hemisphere give π times their luminance.
        luminance(light.radiance) * (solid_angle * cosine).min(std::f32::consts::PI)
    }

    /// Writes the lights that are most important to some surfaces into `chosen`, the first first, as
    /// indices of [`PolygonLights::lights`]; returns how many. Lights that reach none of the surfaces
    /// are not among them. Of equally important ones the first are taken.
    pub fn most_important(&self, surfaces: &SurfaceBounds, chosen: &mut [(u32, f32)]) -> usize {
        let mut count = 0;
        for (index, light) in (0..).zip(self.lights()) {
            let importance = Self::importance(light, surfaces);
            if importance.is_nan() || importance <= 0.0 {
                continue;
            }
            let place = chosen[..count].partition_point(|&(_, other)| other >= importance);
            if place == chosen.len() {
                continue;
            }
            count = (count + 1).min(chosen.len());
            chosen[place..count].rotate_right(1);
            chosen[place] = (index, importance);
        }
        count
    }
}

/// Least distance between two boxes; 0 where they touch.
fn between(a: &Aabb, b: &Aabb) -> f32 {
    (a.lower - b.upper).max(b.lower - a.upper).max(Vec3::ZERO).length()
}

/// The most that the light can be turned towards a point of the box, as a cosine.
fn light_facing(light: &PolygonLight, positions: &Aabb, distance: f32) -> f32 {
    let height = |normal: Vec3| {
        let furthest = Vec3::select(normal.cmpge(Vec3::ZERO), positions.upper, positions.lower);
        (furthest - light.centre).dot(normal)
    };
    let front = height(light.normal);
    let height = if light.two_sided { front.max(height(-light.normal)) } else { front };
    if height <= 0.0 {
        0.0
    } else if distance > 0.0 {
        (height / distance).min(1.0)
    } else {
        1.0
    }
}

/// The most that a surface can be turned towards a point of the light, as a cosine.
fn surface_facing(light: &PolygonLight, surfaces: &SurfaceBounds) -> f32 {
    let to = light.bounds.centre() - surfaces.positions.centre();
    let (length, radius) =
        (to.length(), 0.5 * (light.bounds.diagonal() + surfaces.positions.diagonal()));
    if length <= radius {
        return 1.0;
    }
    let between = (to.dot(surfaces.axis) / length).clamp(-1.0, 1.0).acos();
    let least = between - surfaces.spread.max(0.0) - (radius / length).asin();
    least.max(0.0).cos().max(0.0)
}
