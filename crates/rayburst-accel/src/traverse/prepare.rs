//! What is computed once for a ray in the space of a structure: its scale, slabs and shear.
//!
//! **Scale.** The direction is multiplied by a power of two so that its longest component lies
//! between one and two (four for the very longest). Distances along it are *internal*; powers of two
//! make the conversion exact, and neither test overflows for very long or very short directions.
//!
//! **Error bound.** Boxes must hold the ray wherever the triangle test would find a triangle, and that
//! test is right only up to its own rounding errors. With `ε = 2⁻²⁴`, `o` the origin, `m` the greatest
//! distance on an axis between the origin and any vertex, and z the direction's longest axis:
//! shearing moves a vertex by at most `ε(2m + 4m_z)` (Woop, Benthin, Wald 2013, section 4), the plane
//! distance has errors worth `3ε(m + |o|)` of position (reciprocal, offset, final rounding, and the
//! product where it is not fused), and the distance of a hit `6ε·m_z`. The planes are moved by
//! `8ε(m + m_z) + 4ε|o|`. Components of the direction smaller than 2⁻³² of the longest are replaced
//! by 2⁻³², which moves the ray by much less.
//!
//! A structure of instances adds what the transform into an instance's space may be wrong by.

use glam::Vec4;
use rayburst_math::{Aabb, Ray};
use rayburst_simd::{ShearRay, SlabRay};

/// Origins beyond this are misses: seen from there all vertices coincide.
pub(crate) const MAX_ORIGIN: f32 = (1u128 << 90) as f32;
const EPSILON: f32 = 0.5 * f32::EPSILON;
pub(crate) const SMALLEST_COMPONENT: f32 = 1.0 / (1u64 << 32) as f32;
/// Lifts directions whose every component is subnormal.
const LIFT: f32 = (1u128 << 64) as f32;

/// By how much the planes of boxes are moved: the error bound above, from the greatest distances to
/// vertices along an axis and along the longest one, and the origin.
#[inline(always)]
pub(crate) fn box_error(reach: f32, reach_z: f32, origin: f32) -> f32 {
    8.0 * EPSILON * (reach + reach_z) + 4.0 * EPSILON * origin.abs()
}

/// An interval of internal distances, inclusive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub(crate) t_min: f32,
    pub(crate) t_max: f32,
}

/// A ray in the space of a structure.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedRay {
    pub(crate) slab: SlabRay,
    pub(crate) shear: ShearRay,
    scale: f32,
    lift: f32,
    smallest: f32,
}

impl PreparedRay {
    /// Prepares a ray for a structure of these bounds; `slack` widens all boxes. `None` if the ray
    /// is invalid or cannot hit anything.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, bounds: &Aabb, slack: f32) -> Option<Self> {
        let origin = ray.origin.extend(0.0);
        let mut direction = ray.direction.extend(0.0);
        let mut longest = direction.abs().max_element();
        // Comparisons are false for NaN, which a maximum might skip.
        let within = |v: Vec4, limit: f32| v.abs().cmple(Vec4::splat(limit)).all();
        let able = within(origin, MAX_ORIGIN)
            & within(direction, f32::MAX)
            & (longest > 0.0)
            & (ray.t_min <= ray.t_max)
            & !bounds.is_empty();
        if !able {
            return None;
        }
        let mut lift = 1.0;
        if longest < f32::MIN_POSITIVE {
            lift = LIFT;
            direction *= LIFT;
            longest *= LIFT;
        }
        let exponent = (longest.to_bits() >> 23).clamp(1, 253);
        let scale = f32::from_bits((254 - exponent) << 23);
        let shear = if lift == 1.0 {
            ShearRay::new(ray.origin.as_ref(), ray.direction.as_ref(), scale)
        } else {
            ShearRay::new(ray.origin.as_ref(), direction.truncate().as_ref(), scale)
        };
        let direction = direction * scale;

        let (lower, upper) = (bounds.lower.extend(0.0), bounds.upper.extend(0.0));
        let reach = (lower - origin).abs().max((upper - origin).abs());
        let reach_z = Vec4::splat(reach.to_array()[shear.axes()[2] & 3]);
        let error =
            8.0 * EPSILON * (reach + reach_z) + 4.0 * EPSILON * origin.abs() + Vec4::splat(slack);
        let size = direction.abs().max(Vec4::splat(SMALLEST_COMPONENT));
        let inverse = Vec4::ONE / size.copysign(direction);
        let centre = origin * inverse;
        let margin = error * inverse.abs() + Vec4::splat(f32::MIN_POSITIVE);
        let slab = SlabRay::new(
            inverse.to_array(),
            (centre + margin).to_array(),
            (centre - margin).to_array(),
        );
        // A subnormal limit would be slow to compute; lifted directions have a large scale.
        let smallest = f32::MIN_POSITIVE * reciprocal(scale).max(1.0);
        Some(Self { slab, shear, scale, lift, smallest })
    }

    /// The internal interval of an interval in units of the ray's direction. Distances that such
    /// units cannot express are left out; of those that they express as `t_max`, all are in.
    #[inline(always)]
    pub(crate) fn span(&self, t_min: f32, t_max: f32) -> Span {
        // Distances that differ may be the same subnormal number.
        let t_max = if t_max.abs() < f32::MIN_POSITIVE { t_max.next_up() } else { t_max };
        let clamp = |t: f32| t.clamp(-f32::MAX, f32::MAX);
        // Exact: the reciprocals of powers of two are powers of two.
        let (unscale, unlift) = (reciprocal(self.scale), reciprocal(self.lift));
        // Adding zero makes −0 a 0, whose bits sort like its value.
        let internal = |t: f32| clamp(clamp(t) * unscale * unlift) + 0.0;
        Span { t_min: internal(t_min), t_max: internal(t_max) }
    }

    /// The least internal distance that units of the ray's direction express exactly.
    #[inline(always)]
    pub(crate) fn smallest(&self) -> f32 {
        self.smallest
    }

    /// An internal distance in units of the ray's direction.
    #[inline(always)]
    pub(crate) fn external(&self, t: f32) -> f32 {
        t * self.scale * self.lift
    }
}

/// One over a power of two between 2⁻¹²⁶ and 2¹²⁶.
#[inline(always)]
fn reciprocal(power: f32) -> f32 {
    f32::from_bits((254 << 23) - power.to_bits())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn scales_are_powers_of_two_and_conversion_is_exact() {
        let bounds = Aabb { lower: Vec3::NEG_ONE, upper: Vec3::ONE };
        for power in -149..=127 {
            let longest = 2f64.powi(power) as f32;
            let direction = Vec3::new(0.0, -longest, longest * 0.25);
            let ray = PreparedRay::new(&Ray::new(Vec3::ONE, direction), &bounds, 0.0).unwrap();
            assert_eq!(reciprocal(ray.scale) * ray.scale, 1.0);
            for t in [1.0, -3.0, 0.125] {
                let internal = ray.span(t, t).t_max;
                // Distances of subnormal directions are halves of subnormal numbers at worst.
                if internal.abs() >= f32::MIN_POSITIVE {
                    assert_eq!(ray.external(internal), t, "2^{power}");
                }
            }
        }
    }
}
