//! The cone with flat ends, whole or cut off.

use std::ops::ControlFlow;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::crossed::{self, Crossed, End, Ends};
use crate::frustum::{self, Frustum};
use crate::{IntervalList, Line, Shape, ShapeHit, Solid};

/// A solid cone with flat ends; one of the radii may be zero (a tip), and both may be equal. Unless
/// all is finite, no radius negative, one positive and the ends apart it hits nothing.
///
/// Coordinates: `u` in [0, 1) goes around the axis, anticlockwise seen against it, from the tangent
/// of [`rayburst_math::Frame::from_normal`] on; `v` goes from 0 at `from` to 1 at `to` on the side, and
/// from 0 in the centre to 1 at the rim on the ends. The normal of the tip is the axis outwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Centre of one end.
    pub from: Vec3,
    /// Radius at `from`.
    pub from_radius: f32,
    /// Centre of the other end.
    pub to: Vec3,
    /// Radius at `to`.
    pub to_radius: f32,
}

impl Cone {
    /// A cone with a tip.
    pub const fn with_tip(base: Vec3, radius: f32, tip: Vec3) -> Self {
        Self { from: base, from_radius: radius, to: tip, to_radius: 0.0 }
    }

    #[inline]
    fn frustum(&self) -> Option<Frustum> {
        Frustum::new(self.from, self.to, self.from_radius, self.to_radius)
    }
}

impl Crossed for Cone {
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

impl Shape for Cone {
    fn bounds(&self) -> Aabb {
        self.frustum().map_or(Aabb::EMPTY, |frustum| {
            let disks = [(self.from, self.from_radius), (self.to, self.to_radius)];
            frustum::bounds_of_disks(frustum.axis(), disks)
        })
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        crossed::hits(self, ray, report);
    }
}

impl Solid for Cone {
    fn intervals(&self, line: &Line, list: &mut IntervalList) {
        crossed::intervals(self, line, list);
    }
}
