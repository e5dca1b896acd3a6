//! The sphere.

use std::ops::ControlFlow;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::crossed::{self, Crossed, End, Ends};
use crate::line::{enclosing_box, turn};
use crate::{IntervalList, Line, Shape, ShapeHit, Solid};

/// A sphere. Without a positive finite radius and a finite centre it hits nothing.
///
/// Coordinates: `u` in [0, 1) goes around +y, anticlockwise seen from above, from +x on; `v` in
/// [0, 1] is the angle from +y as a part of half a turn.
///
/// Method: Haines, Günther, Akenine-Möller: "Precision Improvements for Ray/Sphere Intersection",
/// Ray Tracing Gems 2019 (the discriminant from the distance between line and centre, the root
/// nearer to the origin from the product of roots), here in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// The centre.
    pub centre: Vec3,
    /// The radius.
    pub radius: f32,
}

impl Sphere {
    fn is_solid(&self) -> bool {
        self.radius > 0.0 && self.radius.is_finite() && self.centre.is_finite()
    }
}

/// Where the line is nearest to the centre, from there, and the line's direction.
pub(crate) struct Local {
    nearest: DVec3,
    direction: DVec3,
}

impl Crossed for Sphere {
    type Local = Local;

    #[inline]
    fn cross(&self, line: &Line) -> Option<(Local, Ends)> {
        let (distance, nearest) = line.approach(self.centre.as_dvec3());
        let radius = f64::from(self.radius);
        let discriminant = (radius - nearest.length()) * (radius + nearest.length());
        if !(discriminant > 0.0 && self.is_solid()) {
            return None;
        }
        let half = discriminant.sqrt();
        let from_centre = (line.origin - self.centre.as_dvec3()).length();
        let product = (from_centre - radius) * (from_centre + radius);
        let far = distance + half.copysign(distance);
        let near = product / far;
        let (entry, exit) = if far > 0.0 { (near, far) } else { (far, near) };
        let mut ends = Ends::NONE;
        ends.push_pair(
            End { distance: entry, local: -half, face: 0 },
            End { distance: exit, local: half, face: 0 },
        );
        Some((Local { nearest, direction: line.direction }, ends))
    }

    #[inline]
    fn surface(&self, local: &Local, end: &End) -> (DVec3, Vec2) {
        let normal = (local.nearest + end.local * local.direction).normalize_or_zero();
        let from_axis = normal.x.hypot(normal.z);
        let angle = (from_axis as f32).atan2(normal.y as f32);
        (normal, Vec2::new(turn(-normal.z, normal.x), angle * std::f32::consts::FRAC_1_PI))
    }
}

impl Shape for Sphere {
    fn bounds(&self) -> Aabb {
        if !self.is_solid() {
            return Aabb::EMPTY;
        }
        let (centre, radius) = (self.centre.as_dvec3(), DVec3::splat(self.radius.into()));
        enclosing_box(centre - radius, centre + radius)
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        crossed::hits(self, ray, report);
    }
}

impl Solid for Sphere {
    fn intervals(&self, line: &Line, list: &mut IntervalList) {
        crossed::intervals(self, line, list);
    }
}
