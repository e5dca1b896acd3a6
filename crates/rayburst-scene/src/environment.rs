//! What a ray that leaves the scene sees.

use std::sync::Arc;

use glam::{Vec2, Vec3};

/// Radiance from infinity. The sun is not part of it: it is a directional light.
#[derive(Clone, Debug, Default)]
pub enum Environment {
    /// Black.
    #[default]
    None,
    /// The same radiance from everywhere, cd/m².
    Constant(Vec3),
    /// A picture of the surroundings.
    Map(EnvironmentMap),
}

/// An equirectangular picture: u runs around +Y, v from +Y (0) down to −Y (1).
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    /// Row-major linear radiance, before `intensity`.
    pub texels: Arc<[Vec3]>,
    /// Texels a row and rows.
    pub size: (u32, u32),
    /// Turn about +Y in radians, counter-clockwise seen from above.
    pub rotation: f32,
    /// Factor on the radiance.
    pub intensity: f32,
}

impl EnvironmentMap {
    /// The point of the picture in [0, 1)² seen in a unit direction.
    #[inline]
    pub fn uv_of(&self, direction: Vec3) -> Vec2 {
        let phi = direction.x.atan2(-direction.z) + self.rotation;
        let u = (phi * std::f32::consts::FRAC_1_PI * 0.5 + 0.5).rem_euclid(1.0);
        let v = direction.y.clamp(-1.0, 1.0).acos() * std::f32::consts::FRAC_1_PI;
        Vec2::new(u.min(1.0 - f32::EPSILON), v.min(1.0 - f32::EPSILON))
    }

    /// The unit direction of a point of the picture; inverse of [`EnvironmentMap::uv_of`].
    #[inline]
    pub fn direction_of(&self, uv: Vec2) -> Vec3 {
        self.direction_and_sine_of(uv).0
    }

    /// The same with the sine of the angle to the vertical axis.
    #[inline]
    pub(crate) fn direction_and_sine_of(&self, uv: Vec2) -> (Vec3, f32) {
        let phi = (uv.x - 0.5) * std::f32::consts::TAU - self.rotation;
        let (sin_theta, cos_theta) = (uv.y * std::f32::consts::PI).sin_cos();
        let (sin_phi, cos_phi) = phi.sin_cos();
        (Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi), sin_theta)
    }
}
