//! The disk and the annulus.

use std::ops::ControlFlow;

use glam::{Vec2, Vec3};
use rayburst_math::{Aabb, Frame, Ray};

use crate::crossed::InInterval;
use crate::frustum::bounds_of_disks;
use crate::line::turn;
use crate::{Line, Shape, ShapeHit};

/// A disk, or an annulus, its edges included: a sheet. Unless all is finite,
/// `0 ≤ inner_radius < radius` and the normal not zero it hits nothing, and neither do rays in its
/// plane.
///
/// The front is the side that the normal points to. Coordinates: `u` in [0, 1) goes around the
/// normal, anticlockwise seen against it, from the tangent of [`rayburst_math::Frame::from_normal`] on;
/// `v` goes from 0 at the inner radius to 1 at the outer one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    /// The centre.
    pub centre: Vec3,
    /// The normal, of any length.
    pub normal: Vec3,
    /// The outer radius.
    pub radius: f32,
    /// Radius of the hole: zero for a whole disk.
    pub inner_radius: f32,
}

impl Disk {
    /// A disk without a hole.
    pub const fn new(centre: Vec3, normal: Vec3, radius: f32) -> Self {
        Self { centre, normal, radius, inner_radius: 0.0 }
    }

    fn is_surface(&self) -> bool {
        0.0 <= self.inner_radius
            && self.inner_radius < self.radius
            && self.radius.is_finite()
            && self.centre.is_finite()
            && self.normal.is_finite()
            && self.normal != Vec3::ZERO
    }
}

impl Shape for Disk {
    fn bounds(&self) -> Aabb {
        if !self.is_surface() {
            return Aabb::EMPTY;
        }
        bounds_of_disks(self.normal.as_dvec3().normalize(), [(self.centre, self.radius); 2])
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        let Some(line) = Line::of(ray) else { return };
        if !self.is_surface() {
            return;
        }
        let normal = self.normal.as_dvec3().normalize();
        let (distance, nearest) = line.approach(self.centre.as_dvec3());
        let local = -normal.dot(nearest) / normal.dot(line.direction);
        let place = nearest + local * line.direction;
        let from_centre = place.length();
        let (inner, outer) = (f64::from(self.inner_radius), f64::from(self.radius));
        // Also false for what is not a number: along the plane.
        if !(inner <= from_centre && from_centre <= outer) {
            return;
        }
        if let InInterval::At(t) = InInterval::of(line.t(distance + local), ray) {
            let frame = Frame::from_normal(normal.as_vec3());
            let (x, y) =
                (place.dot(frame.tangent.as_dvec3()), place.dot(frame.bitangent.as_dvec3()));
            let uv = Vec2::new(turn(y, x), ((from_centre - inner) / (outer - inner)) as f32);
            let _ = report(ShapeHit { t, normal: normal.as_vec3(), uv });
        }
    }
}
