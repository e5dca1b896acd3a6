//! Fresnel reflectances: exact for dielectrics, Schlick's approximation for microfacets.
//!
//! Schlick: "An Inexpensive BRDF Model for Physically-based Rendering", Computer Graphics Forum 1994.
//! Born, Wolf: "Principles of Optics", section 1.5 (unpolarised light).

use glam::Vec3;

/// Reflectance at normal incidence between air and a dielectric of index `ior`.
#[inline]
pub fn normal_reflectance(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

/// Reflectance of a smooth interface for unpolarised light.
///
/// `eta` is the index on the incident side divided by the one on the other side, `cos_i ≥ 0` the
/// cosine of incidence. Returns the reflectance and the cosine of refraction; under total internal
/// reflection (1, 0).
#[inline]
pub fn dielectric(cos_i: f32, eta: f32) -> (f32, f32) {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let cos_t2 = 1.0 - eta * eta * (1.0 - cos_i * cos_i);
    if cos_t2 <= 0.0 {
        return (1.0, 0.0);
    }
    let cos_t = cos_t2.sqrt();
    let parallel = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let perpendicular = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

/// Schlick's weight (1 − cos θ)⁵: 0 at normal incidence, 1 at grazing angles.
#[inline]
pub fn schlick_weight(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// Schlick's reflectance, from `f0` at normal incidence to `f90` at grazing angles.
#[inline]
pub fn schlick(f0: Vec3, f90: f32, cos: f32) -> Vec3 {
    f0 + (Vec3::splat(f90) - f0) * schlick_weight(cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_incidence_and_brewster() {
        for ior in [1.0f32, 1.33, 1.5, 2.4] {
            let (r, t) = dielectric(1.0, 1.0 / ior);
            assert!((r - normal_reflectance(ior)).abs() < 1e-6 && (t - 1.0).abs() < 1e-6);
        }
        // At Brewster's angle, tan θ = n, parallel light is not reflected.
        let n = 1.5f32;
        let cos = 1.0 / (1.0 + n * n).sqrt();
        let (r, cos_t) = dielectric(cos, 1.0 / n);
        let perpendicular = ((cos - n * cos_t) / (cos + n * cos_t)).powi(2);
        assert!((r - 0.5 * perpendicular).abs() < 1e-6);
    }

    #[test]
    fn reflectance_is_the_same_from_both_sides() {
        for i in 1..100 {
            let cos_i = i as f32 / 100.0;
            let (outside, cos_t) = dielectric(cos_i, 1.0 / 1.5);
            let (inside, back) = dielectric(cos_t, 1.5);
            assert!(
                (outside - inside).abs() < 1e-4 && (back - cos_i).abs() < 2e-4 / cos_i.max(0.1),
                "{cos_i}"
            );
        }
    }

    #[test]
    fn beyond_the_critical_angle_everything_is_reflected() {
        let critical = (1.0 - 1.0 / (1.5f32 * 1.5)).sqrt();
        assert_eq!(dielectric(critical * 0.999, 1.5), (1.0, 0.0));
        assert!(dielectric(critical * 1.01, 1.5).0 < 1.0);
    }
}
