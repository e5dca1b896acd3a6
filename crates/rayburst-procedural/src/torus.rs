//! The torus.

use std::ops::ControlFlow;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::crossed::{self, Crossed, End, Ends};
use crate::line::{enclosing_box, turn};
use crate::roots::{cubic_roots, sign_changes};
use crate::{IntervalList, Line, Shape, ShapeHit, Solid};

/// A solid torus about the y axis. Unless all is finite and both radii positive it hits nothing. A
/// tube thicker than the ring (`minor > major`) is filled: its inner surface is not one.
///
/// Coordinates: `u` in [0, 1) goes around +y, anticlockwise seen from above, from +x on; `v` in
/// [0, 1) goes around the tube, from outside over the top.
///
/// Method: along the line the implicit equation is a quartic (Hanrahan: "A Survey of Ray-Surface
/// Intersection Algorithms", in Glassner: "An Introduction to Ray Tracing", 1989). Its extrema part the
/// line into pieces with at most one root each (Yuksel: "High-Performance Polynomial Root Finding for
/// Graphics", HPG 2022); the roots are then searched for with the signed distance to the tube, which
/// loses nothing to cancellation in thin tubes and does not have the quartic's roots on the inner
/// surface. All starts from the point nearest to the centre, in units of the whole radius, and stays
/// within the sphere and the slab around the torus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    /// The centre.
    pub centre: Vec3,
    /// Radius of the circle in the middle of the tube.
    pub major: f32,
    /// Radius of the tube.
    pub minor: f32,
}

/// The line seen from the centre, in units of the torus's whole radius.
pub(crate) struct Local {
    major: f64,
    minor: f64,
    nearest: DVec3,
    direction: DVec3,
}

impl Local {
    fn at(&self, x: f64) -> DVec3 {
        self.nearest + x * self.direction
    }

    /// Distance to the surface, negative inside, and its growth along the line.
    fn distance(&self, x: f64) -> (f64, f64) {
        let p = self.at(x);
        let from_axis = (p.x * p.x + p.z * p.z).sqrt();
        let across = from_axis - self.major;
        let from_circle = (across * across + p.y * p.y).sqrt();
        let outwards = (p.x * self.direction.x + p.z * self.direction.z) / from_axis;
        let growth = (across * outwards + p.y * self.direction.y) / from_circle;
        (from_circle - self.minor, growth)
    }

    /// The part of the line that holds all there is to find.
    fn within(&self) -> Option<(f64, f64)> {
        const SLACK: f64 = 1.0 + 1e-9;
        let reach = SLACK - self.nearest.length_squared();
        if reach.is_nan() || reach <= 0.0 {
            return None;
        }
        let (mut lo, mut hi) = (-reach.sqrt(), reach.sqrt());
        let (y, dy, top) = (self.nearest.y, self.direction.y, self.minor * SLACK);
        if dy == 0.0 {
            return (y.abs() < top).then_some((lo, hi));
        }
        let (a, b) = ((-top - y) / dy, (top - y) / dy);
        lo = lo.max(a.min(b));
        hi = hi.min(a.max(b));
        (lo < hi).then_some((lo, hi))
    }

    /// Slope along the line of the implicit function
    /// `(|p|² + major² − minor²)² − 4 major² (x² + z²)`, a quartic. From the nearest point on, where
    /// position and direction are at right angles, one term is zero.
    fn slope(&self) -> [f64; 4] {
        let (p, d) = (self.nearest, self.direction);
        let (major, minor) = (self.major, self.minor);
        let whole = p.length_squared() + (major - minor) * (major + minor);
        let scale = 4.0 * major * major;
        [
            -2.0 * scale * (p.x * d.x + p.z * d.z),
            2.0 * (2.0 * whole - scale * (d.x * d.x + d.z * d.z)),
            0.0,
            4.0,
        ]
    }
}

impl Torus {
    fn is_solid(&self) -> bool {
        self.major > 0.0
            && self.minor > 0.0
            && self.major.is_finite()
            && self.minor.is_finite()
            && self.centre.is_finite()
    }
}

impl Crossed for Torus {
    type Local = Local;

    fn cross(&self, line: &Line) -> Option<(Local, Ends)> {
        if !self.is_solid() {
            return None;
        }
        let (major, minor) = (f64::from(self.major), f64::from(self.minor));
        let unit = major + minor;
        let (distance, nearest) = line.approach(self.centre.as_dvec3());
        let local = Local {
            major: major / unit,
            minor: minor / unit,
            nearest: nearest / unit,
            direction: line.direction,
        };
        let (lo, hi) = local.within()?;
        let extrema = cubic_roots(&local.slope(), lo, hi);
        let roots = sign_changes(|x| local.distance(x), lo, hi, &extrema, false, false);
        let end = |at: f64| End { distance: distance + at * unit, local: at, face: 0 };
        let mut ends = Ends::NONE;
        for pair in roots.as_slice().chunks_exact(2) {
            ends.push_pair(end(pair[0]), end(pair[1]));
        }
        Some((local, ends))
    }

    fn surface(&self, local: &Local, end: &End) -> (DVec3, Vec2) {
        let p = local.at(end.local);
        let from_axis = p.x.hypot(p.z);
        let across = from_axis - local.major;
        let outwards =
            if from_axis > 0.0 { DVec3::new(p.x, 0.0, p.z) / from_axis } else { DVec3::ZERO };
        let normal = (across * outwards + p.y * DVec3::Y).normalize_or(DVec3::Y);
        (normal, Vec2::new(turn(-p.z, p.x), turn(p.y, across)))
    }
}

impl Shape for Torus {
    fn bounds(&self) -> Aabb {
        if !self.is_solid() {
            return Aabb::EMPTY;
        }
        let (major, minor) = (f64::from(self.major), f64::from(self.minor));
        let reach = DVec3::new(major + minor, minor, major + minor);
        enclosing_box(self.centre.as_dvec3() - reach, self.centre.as_dvec3() + reach)
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        crossed::hits(self, ray, report);
    }
}

impl Solid for Torus {
    fn intervals(&self, line: &Line, list: &mut IntervalList) {
        crossed::intervals(self, line, list);
    }
}
