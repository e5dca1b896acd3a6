//! The box along the axes.

use std::ops::ControlFlow;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::crossed::{self, Crossed, End, Ends};
use crate::{IntervalList, Line, Shape, ShapeHit, Solid};

/// A solid box along the axes. Unless it is finite and `lower < upper` on all three axes it hits
/// nothing. A line that slides along a face is inside.
///
/// Coordinates: the place between `lower` (0) and `upper` (1) on the two axes other than the face's,
/// in the order y, z on faces across x; z, x across y; x, y across z.
///
/// Method: the slabs of Kay and Kajiya: "Ray Tracing Complex Scenes", SIGGRAPH 1986.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Smallest coordinates.
    pub lower: Vec3,
    /// Largest coordinates.
    pub upper: Vec3,
}

impl Cuboid {
    /// The cuboid that fills a box.
    pub const fn of_box(bounds: Aabb) -> Self {
        Self { lower: bounds.lower, upper: bounds.upper }
    }

    fn is_solid(&self) -> bool {
        self.lower.cmplt(self.upper).all() && self.lower.is_finite() && self.upper.is_finite()
    }
}

impl Crossed for Cuboid {
    type Local = Line;

    #[inline]
    fn cross(&self, line: &Line) -> Option<(Line, Ends)> {
        if !self.is_solid() {
            return None;
        }
        let lower = self.lower.as_dvec3() - line.origin;
        let upper = self.upper.as_dvec3() - line.origin;
        // Faces: the axis, plus 3 where the normal points in the axis's direction.
        let (mut enter, mut enter_face) = (f64::NEG_INFINITY, 0);
        let (mut leave, mut leave_face) = (f64::INFINITY, 0);
        for axis in 0..3 {
            let d = line.direction[axis];
            if d == 0.0 {
                if lower[axis] > 0.0 || upper[axis] < 0.0 {
                    return None;
                }
                continue;
            }
            let (first, last, face) = if d > 0.0 {
                (lower[axis] / d, upper[axis] / d, axis as u8)
            } else {
                (upper[axis] / d, lower[axis] / d, axis as u8 + 3)
            };
            if first > enter {
                (enter, enter_face) = (first, face);
            }
            if last < leave {
                (leave, leave_face) = (last, (face + 3) % 6);
            }
        }
        let mut ends = Ends::NONE;
        ends.push_pair(
            End { distance: enter, local: enter, face: enter_face },
            End { distance: leave, local: leave, face: leave_face },
        );
        Some((*line, ends))
    }

    #[inline]
    fn surface(&self, line: &Line, end: &End) -> (DVec3, Vec2) {
        let axis = usize::from(end.face % 3);
        let mut normal = DVec3::ZERO;
        normal[axis] = if end.face < 3 { -1.0 } else { 1.0 };
        let (lower, upper) = (self.lower.as_dvec3(), self.upper.as_dvec3());
        let place = (line.origin + end.local * line.direction - lower) / (upper - lower);
        let place = place.as_vec3().clamp(Vec3::ZERO, Vec3::ONE);
        (normal, Vec2::new(place[(axis + 1) % 3], place[(axis + 2) % 3]))
    }
}

impl Shape for Cuboid {
    fn bounds(&self) -> Aabb {
        if self.is_solid() { Aabb { lower: self.lower, upper: self.upper } } else { Aabb::EMPTY }
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        crossed::hits(self, ray, report);
    }
}

impl Solid for Cuboid {
    fn intervals(&self, line: &Line, list: &mut IntervalList) {
        crossed::intervals(self, line, list);
    }
}
