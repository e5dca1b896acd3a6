//! The parallelogram.

use std::ops::ControlFlow;

use glam::{Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::crossed::InInterval;
use crate::line::enclosing_box;
use crate::{Line, Shape, ShapeHit};

/// A parallelogram, its edges included: a sheet. Unless all is finite and it has an area it hits
/// nothing, and neither do rays in its plane.
///
/// The front is the side from which `edge_u` turns to `edge_v` anticlockwise. Coordinates: the parts
/// of the two edges, in [0, 1].
///
/// Method: Cramer's rule as Möller and Trumbore: "Fast, Minimum Storage Ray-Triangle Intersection",
/// Journal of Graphics Tools 1997, in double precision from the point nearest to the middle on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// The corner that both edges start from.
    pub corner: Vec3,
    /// One edge.
    pub edge_u: Vec3,
    /// The other edge.
    pub edge_v: Vec3,
}

impl Shape for Quad {
    fn bounds(&self) -> Aabb {
        let (corner, u, v) =
            (self.corner.as_dvec3(), self.edge_u.as_dvec3(), self.edge_v.as_dvec3());
        let good = self.corner.is_finite() && u.cross(v).length() > 0.0 && u.cross(v).is_finite();
        if !good {
            return Aabb::EMPTY;
        }
        let (one, other, opposite) = (corner + u, corner + v, corner + u + v);
        enclosing_box(
            corner.min(one).min(other.min(opposite)),
            corner.max(one).max(other.max(opposite)),
        )
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        let Some(line) = Line::of(ray) else { return };
        let (u, v) = (self.edge_u.as_dvec3(), self.edge_v.as_dvec3());
        let normal = u.cross(v);
        let facing = normal.dot(line.direction);
        let middle = self.corner.as_dvec3() + 0.5 * (u + v);
        let (distance, nearest) = line.approach(middle);
        let local = -normal.dot(nearest) / facing;
        let place = nearest + local * line.direction;
        let area = normal.length_squared();
        let (a, b) = (normal.dot(place.cross(v)) / area, normal.dot(u.cross(place)) / area);
        // Also false for what is not a number: no area, or along the plane.
        if !(a.abs() <= 0.5 && b.abs() <= 0.5) {
            return;
        }
        if let InInterval::At(t) = InInterval::of(line.t(distance + local), ray) {
            let uv = Vec2::new((0.5 + a) as f32, (0.5 + b) as f32);
            let normal = normal.normalize().as_vec3();
            let _ = report(ShapeHit { t, normal, uv });
        }
    }
}
