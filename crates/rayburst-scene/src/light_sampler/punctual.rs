//! Punctual lights: what arrives from them at a point (`KHR_lights_punctual`).

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rayburst_math::Frame;

use super::environment::luminance;
use crate::{Light, LightKind};

/// Light that arrives at a point: the direction to the light, its distance, and the illuminance on a
/// plane that faces it, in lux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Unit vector towards the light.
    pub direction: Vec3,
    /// Distance; infinite for directional lights.
    pub distance: f32,
    /// Illuminance.
    pub illuminance: Vec3,
}

impl Light {
    /// What arrives at a point; `u` in [0, 1)² picks a point of a directional light's disc. `None`
    /// where the light does not shine.
    pub fn arrival(&self, at: Vec3, u: Vec2) -> Option<Arrival> {
        let from_point = |position: Vec3, factor: f32, direction: Vec3, distance2: f32| Arrival {
            direction,
            distance: (position - at).length(),
            illuminance: self.intensity * (factor / distance2),
        };
        match self.kind {
            LightKind::Point { position } => {
                let to = position - at;
                let direction = to.try_normalize()?;
                Some(from_point(position, 1.0, direction, to.length_squared()))
            }
            LightKind::Spot { position, direction: axis, cos_inner, cos_outer } => {
                let to = position - at;
                let direction = to.try_normalize()?;
                let falloff = spot_falloff(-direction.dot(axis), cos_inner, cos_outer);
                (falloff > 0.0)
                    .then(|| from_point(position, falloff, direction, to.length_squared()))
            }
            LightKind::Directional { direction, angular_radius } => Some(Arrival {
                direction: disc_direction(-direction, angular_radius, u),
                distance: f32::INFINITY,
                illuminance: self.intensity,
            }),
        }
    }

    /// Radiance that a viewer sees in a unit direction: only directional lights with a disc can be
    /// seen.
    pub fn visible_radiance(&self, direction: Vec3) -> Vec3 {
        match self.kind {
            LightKind::Directional { direction: travel, angular_radius }
                if angular_radius > 0.0 =>
            {
                let sine = angular_radius.min(std::f32::consts::FRAC_PI_2).sin();
                // A chord keeps its digits where a cosine does not.
                if (direction + travel).length() <= 2.0 * (0.5 * angular_radius).sin() {
                    self.intensity / (std::f32::consts::PI * sine * sine)
                } else {
                    Vec3::ZERO
                }
            }
            _ => Vec3::ZERO,
        }
    }

    /// Luminous flux in lumens of a point or spot light; illuminance in lux of a directional one.
    pub(super) fn strength(&self) -> f32 {
        let intensity = luminance(self.intensity);
        match self.kind {
            LightKind::Point { .. } => 2.0 * TAU * intensity,
            LightKind::Spot { cos_inner, cos_outer, .. } => {
                TAU * intensity * (1.0 - 0.5 * (cos_inner + cos_outer))
            }
            LightKind::Directional { .. } => intensity,
        }
    }
}

/// Factor on a spot's intensity at `cos` from its axis.
fn spot_falloff(cos: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    let t = ((cos - cos_outer) / (cos_inner - cos_outer).max(0.001)).clamp(0.0, 1.0);
    t * t
}

/// A direction of a disc around `axis`, uniform in solid angle.
fn disc_direction(axis: Vec3, angular_radius: f32, u: Vec2) -> Vec3 {
    if angular_radius <= 0.0 {
        return axis;
    }
    let half = (0.5 * angular_radius).sin();
    // 1 − cos θ, which keeps the digits of small angles.
    let depth = 2.0 * half * half * u.x;
    let r = (depth * (2.0 - depth)).max(0.0).sqrt();
    let (sin, cos) = (TAU * u.y).sin_cos();
    Frame::from_normal(axis).to_world(Vec3::new(r * cos, r * sin, 1.0 - depth)).normalize()
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use rayburst_math::hash::Rng;
    use rayburst_testkit::statistics::{chi_square, test_directions};

    use super::*;

    #[test]
    fn light_falls_off_with_the_square_of_the_distance() {
        let light =
            Light { intensity: Vec3::splat(100.0), kind: LightKind::Point { position: Vec3::Y } };
        let a = light.arrival(Vec3::new(0.0, -1.0, 0.0), Vec2::ZERO).unwrap();
        assert_eq!((a.distance, a.direction, a.illuminance.x), (2.0, Vec3::Y, 25.0));
        assert!(light.arrival(Vec3::Y, Vec2::ZERO).is_none());
    }

    #[test]
    fn spots_shine_in_their_cone() {
        let kind = LightKind::Spot {
            position: Vec3::ZERO,
            direction: -Vec3::Y,
            cos_inner: 0.9,
            cos_outer: 0.8,
        };
        let light = Light { intensity: Vec3::ONE, kind };
        let at = |cos: f32| {
            let p = Vec3::new((1.0 - cos * cos).sqrt(), -cos, 0.0);
            light.arrival(p, Vec2::ZERO).map_or(0.0, |a| a.illuminance.x)
        };
        assert!((at(0.95) - 1.0).abs() < 1e-5);
        assert!((at(0.85) - 0.25).abs() < 1e-3);
        assert_eq!(at(0.79), 0.0);
        assert_eq!(at(-1.0), 0.0);
    }

    #[test]
    fn wide_discs_are_sampled_evenly() {
        let (axis, radius) = (Vec3::new(0.48, 0.6, 0.64), 0.5f32);
        let inside = 1.0 / (2.0 * PI * (1.0 - radius.cos()));
        let test = test_directions(
            200_000,
            2,
            |rng| Some(disc_direction(axis, radius, rng.vec2())),
            |d| if d.dot(axis) >= radius.cos() { inside } else { 0.0 },
        );
        // The rim cuts through bins, whose expectation is then a little off.
        assert!(test.statistic < 3.0 * test.degrees as f64, "{test:?}");
    }

    #[test]
    fn the_sun_is_seen_where_it_is_sampled() {
        let kind = LightKind::Directional { direction: -Vec3::X, angular_radius: 0.004_65 };
        let sun = Light { intensity: Vec3::splat(1e5), kind };
        let mut rng = Rng::new(1);
        let mut bins = [0u64; 10];
        for _ in 0..20_000 {
            let a = sun.arrival(Vec3::ZERO, rng.vec2()).unwrap();
            let r = a.direction.truncate().with_x(0.0).length().hypot(a.direction.z) / 0.004_65;
            bins[((r * r * 10.0) as usize).min(9)] += 1;
        }
        let test = chi_square(&bins, &[2000.0; 10]);
        assert!(test.passes(), "{test:?}");
        let inside = Vec3::new(1.0, 0.0046, 0.0).normalize();
        let radiance = sun.visible_radiance(inside).x;
        assert!((radiance * PI * 0.004_65f32.powi(2) / 1e5 - 1.0).abs() < 1e-3);
        assert_eq!(sun.visible_radiance(Vec3::new(1.0, 0.0047, 0.0).normalize()), Vec3::ZERO);
        assert_eq!(sun.visible_radiance(-Vec3::X), Vec3::ZERO);
    }
}
