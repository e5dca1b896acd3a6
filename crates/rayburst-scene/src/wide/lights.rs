//! What arrives from punctual lights at sixteen points: the twin of [`Light::arrival`].

use glam::Vec3;
use rayburst_math::{
    Frame,
    lanes::{F32x16, Frame16, Mask16, Vec2x16, Vec3x16},
};

use crate::{Light, LightKind};

/// Light that arrives at sixteen points; see [`crate::Arrival`].
#[derive(Clone, Copy, Debug)]
pub struct Arrival16 {
    /// Where the light shines.
    pub shines: Mask16,
    /// Unit vectors towards the light.
    pub direction: Vec3x16,
    /// Distances; infinite for directional lights.
    pub distance: F32x16,
    /// Illuminances.
    pub illuminance: Vec3x16,
}

impl Light {
    /// What arrives at sixteen points; see [`Light::arrival`].
    #[inline(always)]
    pub fn arrival16(&self, at: Vec3x16, u: Vec2x16) -> Arrival16 {
        let intensity = Vec3x16::splat(self.intensity);
        match self.kind {
            LightKind::Point { position } => from_point(intensity, position, at, F32x16::ONE),
            LightKind::Spot { position, direction: axis, cos_inner, cos_outer } => {
                let to = Vec3x16::splat(position) - at;
                let cos = -to.normalize_or(Vec3x16::ZERO).dot(Vec3x16::splat(axis));
                let width = (cos_inner - cos_outer).max(0.001);
                let t = ((cos - cos_outer) * (1.0 / width)).clamp(0.0, 1.0);
                from_point(intensity, position, at, t * t)
            }
            LightKind::Directional { direction, angular_radius } => Arrival16 {
                shines: Mask16::ALL,
                direction: disc_direction(-direction, angular_radius, u),
                distance: F32x16::splat(f32::INFINITY),
                illuminance: intensity,
            },
        }
    }
}

#[inline(always)]
fn from_point(intensity: Vec3x16, position: Vec3, at: Vec3x16, factor: F32x16) -> Arrival16 {
    let to = Vec3x16::splat(position) - at;
    let direction = to.normalize_or(Vec3x16::ZERO);
    let away = direction.dot(direction).is_greater(F32x16::ZERO);
    Arrival16 {
        shines: away & factor.is_greater(F32x16::ZERO),
        direction,
        distance: to.length(),
        illuminance: intensity * (factor / to.dot(to)),
    }
}

/// Directions of a disc around `axis`, uniform in solid angle.
#[inline(always)]
fn disc_direction(axis: Vec3, angular_radius: f32, u: Vec2x16) -> Vec3x16 {
    if angular_radius <= 0.0 {
        return Vec3x16::splat(axis);
    }
    let half = (0.5 * angular_radius).sin();
    let depth = u.x * (2.0 * half * half);
    let r = (depth * (2.0 - depth)).max(F32x16::ZERO).sqrt();
    let (sine, cosine) = u.y.sin_cos_turns();
    let Frame { tangent, bitangent, normal } = Frame::from_normal(axis);
    let frame = Frame16 {
        tangent: Vec3x16::splat(tangent),
        bitangent: Vec3x16::splat(bitangent),
        normal: Vec3x16::splat(normal),
    };
    let direction = frame.to_world(Vec3x16 { x: r * cosine, y: r * sine, z: 1.0 - depth });
    direction.normalize_or(Vec3x16::splat(axis))
}

#[cfg(test)]
mod tests {
    use rayburst_math::{hash::Rng, lanes::LANES, warp};

    use super::*;

    #[test]
    fn sixteen_arrivals_are_sixteen_times_one() {
        let mut rng = Rng::new(13);
        let axis = warp::uniform_sphere(rng.vec2());
        let position = Vec3::new(0.2, 0.1, -0.3);
        let kinds = [
            LightKind::Point { position },
            LightKind::Spot { position, direction: axis, cos_inner: 0.7, cos_outer: 0.2 },
            LightKind::Directional { direction: axis, angular_radius: 0.0 },
            LightKind::Directional { direction: axis, angular_radius: 0.005 },
            LightKind::Directional { direction: axis, angular_radius: 0.4 },
        ];
        for kind in kinds {
            let light = Light { intensity: Vec3::new(5.0, 3.0, 1.0), kind };
            let mut dark = 0;
            for _ in 0..50 {
                let (mut at, mut u) = (Vec3x16::ZERO, Vec2x16::ZERO);
                for lane in 0..LANES {
                    at.set_lane(lane, 4.0 * (rng.vec3() - 0.5));
                    u.set_lane(lane, rng.vec2());
                }
                at.set_lane(3, position);
                let arrivals = light.arrival16(at, u);
                for lane in 0..LANES {
                    let one = light.arrival(at.lane(lane), u.lane(lane));
                    assert_eq!(one.is_some(), arrivals.shines.lane(lane));
                    let Some(one) = one else {
                        dark += 1;
                        continue;
                    };
                    assert!((one.direction - arrivals.direction.lane(lane)).length() < 1e-6);
                    assert_eq!(one.distance, arrivals.distance.0[lane]);
                    let illuminance = arrivals.illuminance.lane(lane);
                    let bound = 1e-5 * one.illuminance.length();
                    assert!((one.illuminance - illuminance).length() <= bound);
                }
            }
            assert!(dark > 0 || matches!(kind, LightKind::Directional { .. }));
        }
    }
}
