//! Punctual lights in physical units (`KHR_lights_punctual`).

use glam::Vec3;

/// A light without a surface that rays could hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Linear colour times intensity: candela for point and spot lights, lux for directional ones.
    pub intensity: Vec3,
    /// What kind.
    pub kind: LightKind,
}

/// Kinds of punctual lights. In a [`crate::Scene`] a light sits at its node's origin and shines along
/// the node's −z; in a a flattened scene `position` and `direction` are in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines evenly in all directions.
    Point {
        /// World position.
        position: Vec3,
    },
    /// Shines in a cone.
    Spot {
        /// World position.
        position: Vec3,
        /// Unit axis, the way light travels.
        direction: Vec3,
        /// Cosine of the half-angle where falloff begins.
        cos_inner: f32,
        /// Cosine of the half-angle where light ends.
        cos_outer: f32,
    },
    /// Infinitely far.
    Directional {
        /// The unit direction in which light travels.
        direction: Vec3,
        /// Half the angle that the light covers in the sky, radians; 0 casts sharp shadows.
        angular_radius: f32,
    },
}
