//! The part of a ray that lies in a shape's box, in `f64` and in units of length.

use glam::{DVec3, Vec2};
use rayburst_math::Ray;

use crate::ShapeHit;

/// Points `origin + s · direction` with `0 ≤ s ≤ length` and a unit direction: coordinates are small
/// numbers near the shape, however far away the ray starts and however long its direction is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) length: f64,
    start: f64,
    t_a_length: f64,
    t_min: f32,
    t_max: f32,
}

impl Segment {
    /// What of the ray's interval lies in the closed box; nothing of invalid rays.
    pub(crate) fn clip(ray: &Ray, lower: DVec3, upper: DVec3) -> Option<Self> {
        if !ray.is_valid() {
            return None;
        }
        let (t_min, t_max) = (ray.t_min.max(f32::MIN), ray.t_max.min(f32::MAX));
        let (mut near, mut far) = (f64::from(t_min), f64::from(t_max));
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            if d == 0.0 {
                if !(lower[axis] <= o && o <= upper[axis]) {
                    return None;
                }
            } else {
                let (a, b) = ((lower[axis] - o) / d, (upper[axis] - o) / d);
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
        }
        let scale = direction.length();
        let length = (far - near) * scale;
        (near <= far && length.is_finite()).then(|| Self {
            origin: origin + near * direction,
            direction: direction / scale,
            length,
            start: near,
            t_a_length: scale.recip(),
            t_min,
            t_max,
        })
    }

    pub(crate) fn at(&self, s: f64) -> DVec3 {
        self.origin + s * self.direction
    }

    /// The hit at `s`. Rounding never leaves the ray's interval and never swaps two hits.
    pub(crate) fn hit(&self, s: f64, normal: DVec3, uv: Vec2) -> ShapeHit {
        let t = (self.start + s * self.t_a_length) as f32;
        ShapeHit { t: t.clamp(self.t_min, self.t_max), normal: normal.as_vec3(), uv }
    }
}

/// A box grown by what rounding to `f32` may have moved what is in it.
pub(crate) fn padded(lower: DVec3, upper: DVec3) -> (DVec3, DVec3) {
    let pad = 1e-6 * lower.abs().max(upper.abs()) + DVec3::splat(f64::from(f32::MIN_POSITIVE));
    (lower - pad, upper + pad)
}
