//! Thick curves: tubes around cubic Béziers.

mod sweep;

use std::ops::ControlFlow;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::segment::{Segment, padded};
use crate::{Shape, ShapeHit};

/// Why numbers make no curve.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CurveError {
    /// A coordinate or radius is not finite.
    #[error("the points and radii of a curve must be finite")]
    NotFinite,
    /// A radius is negative.
    #[error("the radii of a curve must not be negative: {0}")]
    Radius(f32),
}

/// The solid that a ball sweeps along a cubic Bézier curve while its radius changes linearly in the
/// curve's parameter. The ends are round.
///
/// Hits are where rays enter and leave the solid; what is inside, where the tube overlaps itself, is
/// no surface. Normals are those of the ball that touches there. `uv` is the parameter of that ball,
/// from 0 to 1, and the angle around the curve in turns, counted from a fixed direction across the
/// chord; where the curve goes along that direction, the angle jumps. Rays may miss that graze to
/// within rounding, in `f64` and of the curve's squared size; radii down to 10⁻⁵ of it are tested.
#[derive(Clone, Copy, Debug)]
pub struct Curve {
    points: [DVec3; 4],
    radii: [f64; 2],
    bounds: Aabb,
    /// From where angles are counted.
    reference: DVec3,
}

impl Curve {
    /// The tube around the Bézier curve of four control points, with a radius at each end.
    pub fn new(points: [Vec3; 4], radii: [f32; 2]) -> Result<Self, CurveError> {
        if !(points.iter().all(|p| p.is_finite()) && radii.iter().all(|r| r.is_finite())) {
            return Err(CurveError::NotFinite);
        }
        if let Some(&radius) = radii.iter().find(|&&r| r < 0.0) {
            return Err(CurveError::Radius(radius));
        }
        let points = points.map(|p| p.as_dvec3());
        let radii = radii.map(f64::from);
        // A ball between is a mean of balls at the control points, whose radii change linearly too.
        let mut bounds = Aabb::EMPTY;
        for (i, p) in points.into_iter().enumerate() {
            let radius = radii[0] + (radii[1] - radii[0]) * i as f64 / 3.0;
            bounds = bounds.grow((p - radius).as_vec3()).grow((p + radius).as_vec3());
        }
        let chord = (points[3] - points[0]).try_normalize().unwrap_or(DVec3::X);
        Ok(Self { points, radii, bounds, reference: chord.any_orthonormal_vector() })
    }

    /// The curve's point and derivative, and the radius.
    fn ball(&self, u: f64) -> (DVec3, DVec3, f64) {
        let p = &self.points;
        let (a, b, c) = (p[0].lerp(p[1], u), p[1].lerp(p[2], u), p[2].lerp(p[3], u));
        let (ab, bc) = (a.lerp(b, u), b.lerp(c, u));
        (ab.lerp(bc, u), 3.0 * (bc - ab), self.radii[0] + u * (self.radii[1] - self.radii[0]))
    }

    fn hit(&self, segment: &Segment, s: f64, u: f64) -> ShapeHit {
        let (centre, tangent, _) = self.ball(u);
        let normal = (segment.at(s) - centre).try_normalize().unwrap_or(-segment.direction);
        let tangent = tangent
            .try_normalize()
            .or_else(|| (self.points[3] - self.points[0]).try_normalize())
            .unwrap_or(DVec3::X);
        let start = self
            .reference
            .reject_from_normalized(tangent)
            .try_normalize()
            .unwrap_or_else(|| tangent.any_orthonormal_vector());
        let turn = normal.dot(tangent.cross(start)).atan2(normal.dot(start));
        let turn = (turn / std::f64::consts::TAU).rem_euclid(1.0);
        segment.hit(s, normal, Vec2::new(u as f32, turn as f32))
    }
}

impl Shape for Curve {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        let (lower, upper) = padded(self.bounds.lower.as_dvec3(), self.bounds.upper.as_dvec3());
        let Some(segment) = Segment::clip(ray, lower, upper) else { return };
        for stretch in sweep::stretches(&self.points, self.radii, &segment).iter() {
            for (s, u) in [stretch.enter, stretch.leave] {
                if (0.0..=segment.length).contains(&s)
                    && report(self.hit(&segment, s, u)).is_break()
                {
                    return;
                }
            }
        }
    }
}
