//! Signed distance fields.
//!
//! Hart: "Sphere Tracing: A Geometric Method for the Antialiased Ray Tracing of Implicit Surfaces"
//! (1996), from inside too, and with a smallest step: it bounds the number of steps, and leads over
//! the surface, so that zeros lie between two signs and are found like those of any function.

use std::ops::ControlFlow;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::segment::{Segment, padded};
use crate::{Shape, ShapeHit, root};

/// Why a function makes no distance field.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DistanceFieldError {
    /// The box is empty, not finite, or has no extent at all.
    #[error("the box of a distance field must be finite and not empty")]
    Bounds,
    /// The Lipschitz bound is not a positive number.
    #[error("the Lipschitz bound of a distance field must be positive and finite, not {0}")]
    Lipschitz(f32),
    /// The smallest step is not a positive part of the box's diagonal, at most 1.
    #[error("the smallest step must be a part of the box's diagonal, over 0 and up to 1, not {0}")]
    Step(f32),
}

/// The surface where a function is zero: outside it is positive, inside negative.
///
/// The function must not change by more than the Lipschitz bound times the distance between two
/// points: 1 for distances, more for what is bent or blended. What it holds must lie in the box: where
/// the box cuts a solid there is no surface. A value that is not a number counts as the value before.
///
/// All changes of sign are found, entries and exits, but for pairs of them that are nearer to each
/// other along the ray than the smallest step, by default 1/16384 of the box's diagonal: rays that
/// graze, and walls thinner than that, may be missed. A ray costs at most as many values as smallest
/// steps fit into the part of it in the box, and some forty more a hit.
///
/// Normals are central differences over 1/1000 of the box's diagonal; where the function is flat they
/// point against the ray. `uv` is zero.
#[derive(Clone, Debug)]
pub struct DistanceField<F> {
    field: F,
    bounds: Aabb,
    lipschitz: f64,
    diagonal: f64,
    step: f64,
}

impl<F: Fn(Vec3) -> f32 + Send + Sync> DistanceField<F> {
    /// The zeros in `bounds` of a function that changes by at most `lipschitz` a unit of length.
    pub fn new(field: F, bounds: Aabb, lipschitz: f32) -> Result<Self, DistanceFieldError> {
        let diagonal = (bounds.upper.as_dvec3() - bounds.lower.as_dvec3()).length();
        let finite = bounds.lower.is_finite() && bounds.upper.is_finite();
        if !finite || bounds.is_empty() || diagonal == 0.0 {
            return Err(DistanceFieldError::Bounds);
        }
        if !(lipschitz > 0.0 && lipschitz.is_finite()) {
            return Err(DistanceFieldError::Lipschitz(lipschitz));
        }
        let step = diagonal / 16_384.0;
        Ok(Self { field, bounds, lipschitz: f64::from(lipschitz), diagonal, step })
    }

    /// Another smallest step, as a part of the box's diagonal. Parts under 1/2²⁰ count as that.
    pub fn with_smallest_step(self, part: f32) -> Result<Self, DistanceFieldError> {
        if !(part > 0.0 && part <= 1.0) {
            return Err(DistanceFieldError::Step(part));
        }
        let step = self.diagonal * f64::from(part).max(0.5f64.powi(20));
        Ok(Self { step, ..self })
    }

    fn value(&self, point: DVec3) -> f64 {
        f64::from((self.field)(point.as_vec3()))
    }

    fn normal(&self, point: DVec3, segment: &Segment) -> DVec3 {
        // Wide enough that differences of `f32` are of use, also far away from zero.
        let h = (1e-3 * self.diagonal).max(1e-4 * point.abs().max_element());
        let slope = DVec3::from_array(
            [DVec3::X, DVec3::Y, DVec3::Z]
                .map(|axis| self.value(point + h * axis) - self.value(point - h * axis)),
        );
        slope.try_normalize().unwrap_or(-segment.direction)
    }

    fn march(
        &self,
        segment: &Segment,
        report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let hit = |s: f64| segment.hit(s, self.normal(segment.at(s), segment), Vec2::ZERO);
        let mut s = 0.0;
        let mut value = self.value(segment.origin);
        if value == 0.0 {
            report(hit(0.0))?;
        }
        while s < segment.length {
            let safe = value.abs() / self.lipschitz;
            let step = if safe > self.step { safe } else { self.step };
            let next = (s + step).min(segment.length);
            let after = self.value(segment.at(next));
            if after.is_nan() {
                s = next;
                continue;
            }
            if value * after < 0.0 {
                let f = |s: f64| self.value(segment.at(s));
                let tolerance = 1e-9 * self.diagonal;
                report(hit(root::between(f, (s, value), (next, after), tolerance)))?;
            } else if after == 0.0 && value != 0.0 {
                report(hit(next))?;
            }
            (s, value) = (next, after);
        }
        ControlFlow::Continue(())
    }
}

impl<F: Fn(Vec3) -> f32 + Send + Sync> Shape for DistanceField<F> {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        let (lower, upper) = padded(self.bounds.lower.as_dvec3(), self.bounds.upper.as_dvec3());
        if let Some(segment) = Segment::clip(ray, lower, upper) {
            let _ = self.march(&segment, report);
        }
    }
}
