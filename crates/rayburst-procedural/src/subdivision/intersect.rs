//! Where a ray meets a bicubic Bézier patch.
//!
//! Seen along the ray the patch is a map from (u, v) to a plane, whose zeros are the hits (Kajiya: "Ray
//! Tracing Parametric Patches", 1982). Parts whose control points have a side of the ray to themselves
//! hold none. In what is left, after a linear map that makes a part nearly the unit square's own (the
//! preconditioning of interval Newton methods; Toth: "On Ray Tracing Parametric Surfaces", 1985), the
//! derivatives' control points may show that there is at most one zero, which Newton's method finds;
//! else the part is halved.

use glam::{DMat2, DVec2, DVec3};

use super::patches::evaluate;
use crate::segment::Segment;

/// A hit of a patch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    pub(super) s: f64,
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) patch: usize,
    /// Which side of the patch is seen.
    pub(super) front: bool,
}

/// So far beyond a patch's borders hits still count, in parts of it: neighbours differ by rounding.
const BORDER: f64 = 1e-9;
/// Parts of a patch get no smaller along either side.
const SMALLEST: f64 = 1.0 / (1u64 << 26) as f64;
/// No more parts of a patch are halved.
const PARTS: usize = 4096;
/// Halvings that may wait at once: all of one path.
const STACK: usize = 56;

/// A part of a patch: control points in the ray's frame (z along it), and where in the patch it is.
#[derive(Clone, Copy)]
struct Part {
    points: [DVec3; 16],
    from: DVec2,
    size: DVec2,
}

/// Gives the hits with `s` in the segment and up to `limit`, in no order.
pub(super) fn intersect(
    points: &[DVec3; 16],
    segment: &Segment,
    limit: f64,
    found: &mut dyn FnMut(Found),
) {
    let (x, y) = segment.direction.any_orthonormal_pair();
    let local = points.map(|p| {
        let p = p - segment.origin;
        DVec3::new(p.dot(x), p.dot(y), p.dot(segment.direction))
    });
    let whole = Part { points: local, from: DVec2::ZERO, size: DVec2::ONE };
    let limit = limit.min(segment.length);
    let mut report = |part: &Part, at: DVec2| {
        let place = (part.from + at * part.size).clamp(DVec2::ZERO, DVec2::ONE);
        let (point, along, across) = evaluate(&local, place.x, place.y);
        if (0.0..=limit).contains(&point.z) {
            let front = along.cross(across).z < 0.0;
            found(Found { s: point.z, u: place.x, v: place.y, patch: 0, front });
        }
    };
    // Most patches are decided as a whole, without the large stack.
    match whole.zero(limit) {
        Zero::None => {}
        Zero::At(at) => report(&whole, at),
        Zero::Unknown(side) => search(&whole, side, limit, &mut report),
    }
}

#[inline(never)]
fn search(whole: &Part, side: usize, limit: f64, report: &mut dyn FnMut(&Part, DVec2)) {
    let mut stack = [*whole; STACK];
    let mut count = 0;
    let (mut part, mut side) = (*whole, side);
    for _ in 0..PARTS {
        if let Some(halves) = part.halves(side)
            && count + 2 <= STACK
        {
            stack[count] = halves[0];
            stack[count + 1] = halves[1];
            count += 2;
        }
        loop {
            if count == 0 {
                return;
            }
            count -= 1;
            part = stack[count];
            match part.zero(limit) {
                Zero::None => {}
                Zero::At(at) => report(&part, at),
                Zero::Unknown(next) => {
                    side = next;
                    break;
                }
            }
        }
    }
}

/// What is known of the zeros of a part.
enum Zero {
    None,
    /// The only one, in the part's own coordinates; may be a little beyond its borders.
    At(DVec2),
    /// Nothing; to be halved along u (0) or v (1).
    Unknown(usize),
}

impl Part {
    /// Whether the ray or the piece of it up to `limit` is outside the control points' box.
    fn misses(&self, limit: f64) -> bool {
        let (lower, upper) = self
            .points
            .iter()
            .fold((self.points[0], self.points[0]), |(a, b), &p| (a.min(p), b.max(p)));
        // As far as border hits of neighbours may be off.
        let slack = 2.0 * BORDER * (upper - lower) / self.size.min_element().max(BORDER);
        let slack = slack.min(upper - lower) + DVec3::splat(f64::MIN_POSITIVE);
        let (lower, upper) = (lower - slack, upper + slack);
        lower.x > 0.0
            || lower.y > 0.0
            || upper.x < 0.0
            || upper.y < 0.0
            || upper.z < 0.0
            || lower.z > limit
    }

    fn zero(&self, limit: f64) -> Zero {
        if self.misses(limit) {
            return Zero::None;
        }
        let p: [DVec2; 16] = self.points.map(|p| DVec2::new(p.x, p.y));
        let along = 0.5 * (p[3] - p[0] + p[15] - p[12]);
        let across = 0.5 * (p[12] - p[0] + p[15] - p[3]);
        let longer = {
            let at = |i: usize, j: usize| self.points[4 * j + i];
            let row =
                |j: usize| (0..3).map(|i| at(i, j).distance_squared(at(i + 1, j))).sum::<f64>();
            let column =
                |i: usize| (0..3).map(|j| at(i, j).distance_squared(at(i, j + 1))).sum::<f64>();
            usize::from(row(0).max(row(3)) < column(0).max(column(3)))
        };
        let determinant = along.perp_dot(across);
        if determinant.abs() <= 1e-10 * along.length() * across.length() || determinant.is_nan() {
            return Zero::Unknown(longer);
        }
        let inverse = DMat2::from_cols(along, across).inverse();
        let q = p.map(|p| inverse * p);

        let (lower, upper) = q.iter().fold((q[0], q[0]), |(a, b), &q| (a.min(q), b.max(q)));
        let slack = 2.0 * BORDER / self.size;
        if (lower - slack).max_element() > 0.0 || (upper + slack).min_element() < 0.0 {
            return Zero::None;
        }
        if !is_injective(&q) {
            return Zero::Unknown(longer);
        }
        match newton(&q) {
            Some(at)
                if (at + slack * 0.5).min_element() >= 0.0
                    && (at - slack * 0.5).max_element() <= 1.0 =>
            {
                Zero::At(at)
            }
            _ => Zero::Unknown(longer),
        }
    }

    fn halves(&self, longer: usize) -> Option<[Self; 2]> {
        let side = if self.size[longer] > SMALLEST { longer } else { 1 - longer };
        if self.size[side] <= SMALLEST {
            return None;
        }
        let (mut low, mut high) = (*self, *self);
        let (step, line) = if side == 0 { (1, 4) } else { (4, 1) };
        for k in 0..4 {
            let at = |i: usize| k * line + i * step;
            let p = [0, 1, 2, 3].map(|i| self.points[at(i)]);
            let (a, b, c) = (p[0].midpoint(p[1]), p[1].midpoint(p[2]), p[2].midpoint(p[3]));
            let (ab, bc) = (a.midpoint(b), b.midpoint(c));
            let middle = ab.midpoint(bc);
            for (i, q) in [p[0], a, ab, middle].into_iter().enumerate() {
                low.points[at(i)] = q;
            }
            for (i, q) in [middle, bc, c, p[3]].into_iter().enumerate() {
                high.points[at(i)] = q;
            }
        }
        low.size[side] *= 0.5;
        high.size[side] *= 0.5;
        high.from[side] += high.size[side];
        Some([low, high])
    }
}

/// Whether no two places of the unit square can have the same value: all derivatives along u are to the
/// right of all derivatives along v.
fn is_injective(q: &[DVec2; 16]) -> bool {
    let mut along = (f64::INFINITY, 0.0f64);
    let mut across = (f64::INFINITY, 0.0f64);
    for k in 0..4 {
        for i in 0..3 {
            let d = 3.0 * (q[4 * k + i + 1] - q[4 * k + i]);
            along = (along.0.min(d.x), along.1.max(d.y.abs()));
            let d = 3.0 * (q[4 * (i + 1) + k] - q[4 * i + k]);
            across = (across.0.min(d.y), across.1.max(d.x.abs()));
        }
    }
    along.0 > 0.0 && across.0 > 0.0 && along.0 * across.0 > along.1 * across.1
}

/// A zero not far from the unit square.
fn newton(q: &[DVec2; 16]) -> Option<DVec2> {
    let flat = q.map(|q| q.extend(0.0));
    let mut at = DVec2::splat(0.5);
    for _ in 0..12 {
        let (value, along, across) = evaluate(&flat, at.x, at.y);
        let (along, across) = (along.truncate(), across.truncate());
        let determinant = along.perp_dot(across);
        let step = DVec2::new(value.truncate().perp_dot(across), along.perp_dot(value.truncate()))
            / determinant;
        at -= step;
        if !(at - 0.5).abs().cmple(DVec2::splat(1.5)).all() {
            return None;
        }
        if step.abs().max_element() < 1e-14 {
            break;
        }
        if step.abs().max_element() < 1e-8 {
            // The next step is below rounding.
            let (value, along, across) = evaluate(&flat, at.x, at.y);
            let matrix = DMat2::from_cols(along.truncate(), across.truncate());
            at -= matrix.inverse() * value.truncate();
            break;
        }
    }
    let (value, ..) = evaluate(&flat, at.x, at.y);
    (value.truncate().abs().max_element() < 1e-11).then_some(at)
}
