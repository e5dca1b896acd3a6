//! The GGX microfacet distribution with height-correlated Smith masking, isotropic.
//!
//! Walter, Marschner, Li, Torrance: "Microfacet Models for Refraction through Rough Surfaces", EGSR
//! 2007. Heitz: "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 2014
//! (Eq. 72, 99). Sampling of visible normals: Dupuy, Benyoub: "Sampling Visible GGX Normals with
//! Spherical Caps", HPG 2023.
//!
//! Directions are unit vectors in a local frame with z along the normal, in the upper hemisphere.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::{Vec2, Vec3};

/// √(α² + (1 − α²) cos²θ): cos θ·√(1 + α² tan²θ), finite at grazing angles.
#[inline]
fn slope(cos: f32, alpha2: f32) -> f32 {
    (alpha2 + (1.0 - alpha2) * cos * cos).sqrt()
}

/// Density of normals D(h). Written with sin²θ so that sharp lobes keep their digits.
#[inline]
pub fn distribution(h: Vec3, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let t = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    FRAC_1_PI / (a2 * t * t)
}

/// G₂(o, i) / (4 cos o cos i).
#[inline]
pub fn visibility(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    0.5 / (cos_i * slope(cos_o, a2) + cos_o * slope(cos_i, a2)).max(f32::MIN_POSITIVE)
}

/// G₂(o, i) / G₁(o): what is left of the light that [`sample`] reflects, before Fresnel.
#[inline]
pub fn shadowing(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let (so, si) = (slope(cos_o, a2), slope(cos_i, a2));
    cos_i * (cos_o + so) / (cos_i * so + cos_o * si).max(f32::MIN_POSITIVE)
}

/// Density of the direction that [`sample`]d normals `h` reflect `o` to, per solid angle.
#[inline]
pub fn reflection_pdf(cos_o: f32, h: Vec3, alpha: f32) -> f32 {
    distribution(h, alpha) * 0.5 / (cos_o + slope(cos_o, alpha * alpha))
}

/// A normal in proportion to its area that `o` sees.
#[inline]
pub fn sample(o: Vec3, alpha: f32, u: Vec2) -> Vec3 {
    let (sin, cos) = (TAU * u.x).sin_cos();
    sample_turned(o, alpha, Vec2::new(cos, sin), u.y)
}

/// [`sample`] with the unit vector of the azimuth given instead of a number.
#[inline]
pub(super) fn sample_turned(o: Vec3, alpha: f32, azimuth: Vec2, u: f32) -> Vec3 {
    let stretched = Vec3::new(o.x * alpha, o.y * alpha, o.z).normalize();
    let z = (1.0 - u) * (1.0 + stretched.z) - stretched.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let h = (r * azimuth).extend(z) + stretched;
    Vec3::new(h.x * alpha, h.y * alpha, h.z.max(0.0)).normalize_or(Vec3::Z)
}
