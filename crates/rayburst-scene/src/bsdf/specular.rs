//! Perfect mirrors and smooth dielectrics: directions of probability one.
//!
//! Chapter 26.1, Figure 26.4; "Real-Time Rendering", section 14.5.2. Refraction carries *basic
//! radiance* L/n², which an interface does not change: no (n₁/n₂)² appears in the weights, reflected
//! and transmitted weights of a clear interface sum to one, and cameras and lights, which are in air,
//! see ordinary radiance.

use glam::Vec3;

use super::fresnel;

/// A perfectly specular direction and the fraction of light that takes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularPath {
    /// Where to, a unit vector in the local frame.
    pub wi: Vec3,
    /// The fraction.
    pub weight: Vec3,
}

/// The mirror direction about local z.
#[inline]
pub(super) fn reflect(wo: Vec3) -> Vec3 {
    Vec3::new(-wo.x, -wo.y, wo.z)
}

/// The refracted direction given the cosine of refraction; `eta` as in [`fresnel::dielectric`].
#[inline]
pub(super) fn refract(wo: Vec3, eta: f32, cos_t: f32) -> Vec3 {
    Vec3::new(-eta * wo.x, -eta * wo.y, -cos_t).normalize()
}

/// Reflection and refraction at a smooth interface; no refraction under total internal reflection.
#[inline]
pub(super) fn interface(wo: Vec3, eta: f32, tint: Vec3) -> (SpecularPath, Option<SpecularPath>) {
    let (reflectance, cos_t) = fresnel::dielectric(wo.z, eta);
    let reflected = SpecularPath { wi: reflect(wo), weight: Vec3::splat(reflectance) };
    let refracted = (reflectance < 1.0)
        .then(|| SpecularPath { wi: refract(wo, eta, cos_t), weight: (1.0 - reflectance) * tint });
    (reflected, refracted)
}
