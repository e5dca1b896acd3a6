//! The cylinder with flat ends.

use std::ops::ControlFlow;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::crossed::{self, Crossed, End, Ends};
use crate::frustum::{self, Frustum};
use crate::{IntervalList, Line, Shape, ShapeHit, Solid};

/// A solid cylinder with flat ends. Unless all is finite, the radius positive and the ends apart it
/// hits nothing.
///
/// Coordinates: `u` in [0, 1) goes around the axis, anticlockwise seen against it, from the tangent
/// of [`rayburst_math::Frame::from_normal`] on; `v` goes from 0 at `from` to 1 at `to` on the side, and
/// from 0 in the centre to 1 at the rim on the ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Centre of one end.
    pub from: Vec3,
    /// Centre of the other end.
    pub to: Vec3,
    /// The radius.
    pub radius: f32,
}

impl Cylinder {
    #[inline]
    fn frustum(&self) -> Option<Frustum> {
        Frustum::new(self.from, self.to, self.radius, self.radius)
    }
}

impl Crossed for Cylinder {
    type Local = frustum::Local;

    #[inline]
    fn cross(&self, line: &Line) -> Option<(frustum::Local, Ends)> {
        self.frustum()?.cross(line)
    }

    #[inline]
    fn surface(&self, local: &frustum::Local, end: &End) -> (DVec3, Vec2) {
        local.surface(end)
    }
}

impl Shape for Cylinder {
    fn bounds(&self) -> Aabb {
        self.frustum().map_or(Aabb::EMPTY, |frustum| {
            let disks = [(self.from, self.radius), (self.to, self.radius)];
            frustum::bounds_of_disks(frustum.axis(), disks)
        })
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        crossed::hits(self, ray, report);
    }
}

impl Solid for Cylinder {
    fn intervals(&self, line: &Line, list: &mut IntervalList) {
        crossed::intervals(self, line, list);
    }
}
