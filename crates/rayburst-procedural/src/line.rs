//! The whole line that a ray lies on, in double precision.

use glam::{DVec3, Vec3};
use rayburst_math::{Aabb, Ray};

/// The whole line of a ray, in object space and double precision: distances along it are in units of
/// space, and both directions belong to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// The ray's origin, where distances are zero.
    pub origin: DVec3,
    /// The ray's direction with length one.
    pub direction: DVec3,
    /// Length of the ray's direction.
    pub length: f64,
}

impl Line {
    /// The line of a ray; none of an invalid ray.
    #[inline]
    pub fn of(ray: &Ray) -> Option<Self> {
        if !ray.is_valid() {
            return None;
        }
        let direction = ray.direction.as_dvec3();
        let length = direction.length();
        Some(Self { origin: ray.origin.as_dvec3(), direction: direction / length, length })
    }

    /// The ray's `t` at a distance from the origin.
    #[inline]
    pub fn t(&self, distance: f64) -> f64 {
        distance / self.length
    }

    /// The distance at which the line is nearest to `centre`, and the vector from there to the line.
    ///
    /// Shapes solve their equations from this point on, which loses nothing when the origin is far
    /// away (Haines, Günther, Akenine-Möller: "Precision Improvements for Ray/Sphere Intersection",
    /// Ray Tracing Gems 2019).
    #[inline]
    pub fn approach(&self, centre: DVec3) -> (f64, DVec3) {
        let from_centre = self.origin - centre;
        let distance = -from_centre.dot(self.direction);
        (distance, from_centre + distance * self.direction)
    }

    /// Whether the line may meet the box: never false when it does.
    pub(crate) fn may_meet(&self, bounds: &Aabb) -> bool {
        if bounds.is_empty() {
            return false;
        }
        let (lower, upper) = (bounds.lower.as_dvec3(), bounds.upper.as_dvec3());
        let (distance, nearest) = self.approach(0.5 * (lower + upper));
        let half = 0.5 * (upper - lower);
        // Far more than rounding, far less than what would cost time.
        let half = half + DVec3::splat(1e-6 * half.max_element() + 1e-14 * distance.abs());
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let (d, p, h) = (self.direction[axis], nearest[axis], half[axis]);
            if d == 0.0 {
                if p.abs() > h {
                    return false;
                }
                continue;
            }
            let (a, b) = ((-h - p) / d, (h - p) / d);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter <= leave
    }
}

/// The smallest box in single precision around a finite one in double precision.
pub(crate) fn enclosing_box(lower: DVec3, upper: DVec3) -> Aabb {
    let down = |x: f64| if f64::from(x as f32) > x { (x as f32).next_down() } else { x as f32 };
    let up = |x: f64| if f64::from(x as f32) < x { (x as f32).next_up() } else { x as f32 };
    Aabb {
        lower: Vec3::new(down(lower.x), down(lower.y), down(lower.z)),
        upper: Vec3::new(up(upper.x), up(upper.y), up(upper.z)),
    }
}

/// The angle of `(x, y)` from the x axis in full turns, in [0, 1).
#[inline]
pub(crate) fn turn(y: f64, x: f64) -> f32 {
    let turns = (y as f32).atan2(x as f32) * std::f32::consts::FRAC_1_PI * 0.5;
    let turns = if turns < 0.0 { turns + 1.0 } else { turns };
    if turns < 1.0 { turns } else { 0.0 }
}
