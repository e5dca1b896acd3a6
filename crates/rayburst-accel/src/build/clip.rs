//! The boxes of a triangle's parts on both sides of a plane.

use glam::Vec4;

use super::bounds::Bounds4;

/// Corners of a triangle; the last lane is meaningless.
pub(super) type Corners = [Vec4; 3];

/// A plane across an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub(super) axis: usize,
    pub(super) position: f32,
    /// Its position on its axis, and infinity.
    below: Vec4,
    /// Its position on its axis, and negative infinity.
    above: Vec4,
}

impl Plane {
    pub(super) fn new(axis: usize, position: f32) -> Self {
        let (mut below, mut above) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
        below[axis] = position;
        above[axis] = position;
        Self { axis, position, below, above }
    }

    /// The boxes around what of a triangle is in a box, on both sides of the plane. A box is empty if
    /// nothing is on its side.
    ///
    /// The boxes may be too large but never too small: together they must hold every point of the
    /// triangle that the given box holds, or rays would pass through the seam. Across the axis both end
    /// exactly at the plane. Where an edge `a b` meets the plane, at `a + t (b − a)`, the rounding of
    /// the two differences and the quotient in `t`, of `b − a`, of the product and of the sum move a
    /// coordinate by at most `11 u` times the greater one of `a` and `b`, with `u = ε / 2`, plus what
    /// underflow loses; such points are widened by `8 ε`.
    #[inline(always)]
    pub(super) fn clip(&self, corners: &Corners, bounds: &Bounds4) -> (Bounds4, Bounds4) {
        const ERROR: f32 = 8.0 * f32::EPSILON;
        let (mut left, mut right) = (Bounds4::EMPTY, Bounds4::EMPTY);
        let mut a = &corners[2];
        for b in corners {
            let (from, to) = (a[self.axis], b[self.axis]);
            if to <= self.position {
                left.grow(*b, *b);
            }
            if to >= self.position {
                right.grow(*b, *b);
            }
            if (from < self.position) & (self.position < to)
                | (to < self.position) & (self.position < from)
            {
                let t = (self.position - from) / (to - from);
                let point = *a + (*b - *a) * t;
                let error = a.abs().max(b.abs()) * ERROR + Vec4::splat(f32::MIN_POSITIVE);
                left.grow(point - error, point + error);
                right.grow(point - error, point + error);
            }
            a = b;
        }
        left.upper = left.upper.min(self.below);
        right.lower = right.lower.max(self.above);
        (left.intersection(bounds), right.intersection(bounds))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};
    use rayburst_math::hash::Rng;

    use super::*;

    #[test]
    fn clipped_boxes_cover_the_triangle() {
        let mut rng = Rng::new(3);
        for round in 0..20_000 {
            let scale = 2f32.powi((rng.below(120)) as i32 - 60);
            let shift = if round % 2 == 0 { Vec3::ZERO } else { scale * 1e3 * rng.vec3() };
            let triangle = [(); 3].map(|()| shift + scale * (rng.vec3() - 0.5));
            let corners = triangle.map(|p| p.extend(0.0));
            let mut boxes = vec![Bounds4::EMPTY];
            for corner in corners {
                boxes[0].grow(corner, corner);
            }
            // A few planes after each other, each through all boxes that it meets.
            for _ in 0..4 {
                let axis = rng.below(3) as usize;
                let all = boxes[0].aabb();
                let plane = all.lower[axis] + rng.f32() * (all.upper[axis] - all.lower[axis]);
                boxes = boxes
                    .iter()
                    .flat_map(|b| {
                        if b.lower[axis] < plane && plane < b.upper[axis] {
                            let (left, right) = Plane::new(axis, plane).clip(&corners, b);
                            vec![left, right]
                        } else {
                            vec![*b]
                        }
                    })
                    .filter(|b| !b.aabb().is_empty())
                    .collect();
            }
            for _ in 0..20 {
                let (u, v) = (rng.f32(), rng.f32());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let [a, b, c] = triangle.map(Vec3::as_dvec3);
                let p: DVec3 = a + f64::from(u) * (b - a) + f64::from(v) * (c - a);
                let held = boxes.iter().any(|b| {
                    let b = b.aabb();
                    b.lower.as_dvec3().cmple(p).all() && p.cmple(b.upper.as_dvec3()).all()
                });
                assert!(held, "{triangle:?}: {p} is in no box");
            }
        }
    }
}
