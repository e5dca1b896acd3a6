//! The reference: crossings of a line found by stepping along it as far as the signed distance says
//! is empty (Hart: "Sphere Tracing", The Visual Computer 1996), and by bisection.
//!
//! With steps of at least 10⁻⁴ of the shape's radius (less where it is thin) no crossing is missed but
//! pairs closer than that, so pairs closer than three times that are left out on both sides: they are
//! the band round tangency.

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Ray, hash::Rng};
use rayburst_procedural::{Crossing, IntervalList, Line, Solid};

use crate::rays::{self, Distance, KINDS};

/// Least step, in radii, of a shape without a thin part.
const STEP: f64 = 1e-4;
/// Pairs of crossings closer than this, in steps, are left out.
const BAND: f64 = 3.0;
/// Largest error of a crossing, across the surface, in parts of the distance of the origin from the
/// centre and the radius.
const DISTANCE_ERROR: f64 = 2e-15;
/// Largest error of a normal as an angle.
const NORMAL_ERROR: f64 = 1e-7;

/// A solid and what is known of it independently.
pub(crate) struct Case<'a> {
    pub(crate) solid: &'a dyn Solid,
    /// The solid scaled by 2⁶⁰.
    pub(crate) scaled: &'a dyn Solid,
    /// Signed distance as a function of the place relative to the centre.
    pub(crate) distance: Distance<'a>,
    pub(crate) centre: DVec3,
    pub(crate) radius: f64,
    /// Radius of the least curve, in radii of the whole.
    pub(crate) feature: f64,
    /// The place, relative to the centre, of a normal and coordinates.
    pub(crate) place: &'a dyn Fn(Vec3, Vec2) -> DVec3,
}

/// The factor of [`Case::scaled`].
pub(crate) const SCALE: f32 = (1u64 << 60) as f32;

/// What was seen of many rays.
#[derive(Debug, Default)]
pub(crate) struct Seen {
    pub(crate) rays: usize,
    pub(crate) crossings: usize,
    pub(crate) four: usize,
    normals_left_out: usize,
    pairs_left_out: usize,
    /// Rays within a face up to rounding, where inside is a matter of taste.
    sliding: usize,
    distance_error: f64,
    normal_error: f64,
    place_error: f64,
}

/// Distances along a line at which the signed distance changes its sign.
fn crossings(
    distance: Distance,
    from_centre: DVec3,
    direction: DVec3,
    radius: f64,
    step: f64,
) -> Vec<f64> {
    let at = |s: f64| distance(from_centre + s * direction);
    let middle = -from_centre.dot(direction);
    let (mut s, end) = (middle - 1.01 * radius, middle + 1.01 * radius);
    let mut found = Vec::new();
    let mut value = at(s);
    while s < end {
        let next = s + (0.999 * value.abs()).max(step);
        let next_value = at(next);
        if (next_value < 0.0) != (value < 0.0) {
            let (mut lo, mut hi) = (s, next);
            loop {
                let mid = 0.5 * (lo + hi);
                if mid <= lo || mid >= hi {
                    break;
                }
                if (at(mid) < 0.0) == (value < 0.0) {
                    lo = mid;
                } else {
                    hi = mid;
                }
            }
            found.push(hi);
        }
        (s, value) = (next, next_value);
    }
    found
}

/// Leaves out neighbours that are too close together.
fn without_close_pairs<T: Copy>(all: &[T], at: impl Fn(&T) -> f64, band: f64) -> Vec<T> {
    let mut kept: Vec<T> = Vec::new();
    for item in all {
        match kept.last() {
            Some(last) if at(item) - at(last) < band => {
                kept.pop();
            }
            _ => kept.push(*item),
        }
    }
    kept
}

/// Checks a random ray of each kind.
pub(crate) fn check(rng: &mut Rng, case: &Case, rounds: usize, seen: &mut Seen) {
    for _ in 0..rounds {
        for kind in KINDS {
            let ray = rays::ray(rng, kind, case.centre, case.radius, case.distance);
            check_ray(rng, case, &ray, seen);
        }
    }
}

fn check_ray(rng: &mut Rng, case: &Case, ray: &Ray, seen: &mut Seen) {
    seen.rays += 1;
    let from_centre = ray.origin.as_dvec3() - case.centre;
    let length = ray.direction.as_dvec3().length();
    let direction = ray.direction.as_dvec3() / length;
    let step = STEP * case.feature.sqrt() * case.radius;
    let expected = crossings(case.distance, from_centre, direction, case.radius, step);
    let band = BAND * step;

    let mut list = IntervalList::new();
    case.solid.intervals(&Line::of(ray).expect("a valid ray"), &mut list);
    let found: Vec<Crossing> = list.as_slice().iter().flat_map(|i| [i.entry, i.exit]).collect();
    assert!(found.is_sorted_by(|a, b| a.t <= b.t), "{found:?}");
    assert!(list.as_slice().iter().all(|i| i.entry.t < i.exit.t));

    let slides = |s: &[f64]| {
        let mut middles = s.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        let rounding = 1e-13 * (from_centre.length() + case.radius);
        middles.any(|s| (case.distance)(from_centre + s * direction).abs() < rounding)
    };
    let found_at: Vec<f64> = found.iter().map(|c| c.t * length).collect();
    if slides(&found_at) || slides(&expected) {
        seen.sliding += 1;
        return;
    }
    let kept = without_close_pairs(&found, |c| c.t * length, band);
    let expected_kept = without_close_pairs(&expected, |s| *s, band);
    seen.pairs_left_out += (expected.len() - expected_kept.len()) / 2;
    seen.four += usize::from(expected_kept.len() == 4);
    assert_eq!(kept.len(), expected_kept.len(), "{found:?}, not {expected:?}: {ray:?}");
    for (i, (crossing, s)) in kept.iter().zip(expected_kept).enumerate() {
        seen.crossings += 1;
        let p = from_centre + s * direction;
        // The step with the least error of both kinds.
        let step = (1e-16 * case.feature * case.feature).cbrt();
        let normal = rays::gradient(case.distance, p, step * case.radius);
        let cosine = crossing.normal.as_dvec3().dot(direction);
        let finer = rays::gradient(case.distance, p, 0.5 * step * case.radius);
        // Near edges and tips the gradient is none of a face.
        let unsure = (normal.length() - 1.0).abs().max(normal.distance(finer));
        if unsure > 1e-8 + 1e-15 / step {
            seen.normals_left_out += 1;
        } else {
            let faces = if i % 2 == 0 { cosine < 1e-6 } else { cosine > -1e-6 };
            assert!(faces, "{crossing:?} {ray:?}");
            let angle = normal.cross(crossing.normal.as_dvec3()).length();
            assert!(angle < NORMAL_ERROR, "{angle}: {crossing:?}, not {normal} {ray:?}");
            seen.normal_error = seen.normal_error.max(angle);
            let error = (crossing.t * length - s).abs() * normal.dot(direction).abs();
            let error = error / (from_centre.length() + case.radius);
            assert!(error < DISTANCE_ERROR, "{error}: {crossing:?}, not {s} {ray:?}");
            seen.distance_error = seen.distance_error.max(error);
        }
        let place = (case.place)(crossing.normal, crossing.uv);
        let error = place.distance(p) / case.radius;
        let far = 1e-15 * from_centre.length() / (case.radius * cosine.abs().max(1e-12));
        assert!(error < 1e-5 + far, "{error}: {place}, not {p}: {crossing:?} {ray:?}");
        seen.place_error = seen.place_error.max(error);
    }

    // The same crossings are hits, with `t` rounded once.
    let hits = rays::all_hits(case.solid, ray);
    assert_eq!(hits.len(), found.len());
    for (hit, crossing) in hits.iter().zip(&found) {
        let same = (hit.t, hit.normal, hit.uv) == (crossing.t as f32, crossing.normal, crossing.uv);
        assert!(same, "{hit:?} {crossing:?}");
    }
    rays::check_numbers(&hits);
    rays::check_bounds(case.solid, ray, &hits);
    rays::check_intervals(rng, case.solid, ray, &hits);
    rays::check_scaled(case.solid, case.scaled, ray, SCALE);
}

impl Seen {
    /// Checks that the rays were worth it: `least` crossings a ray, and few left out.
    pub(crate) fn check(&self, least: f64) {
        assert!(self.rays >= 100_000, "{self:?}");
        assert!(self.crossings as f64 > least * self.rays as f64, "{self:?}");
        assert!(self.normals_left_out * 25 < self.crossings, "{self:?}");
        assert!(self.sliding * 25 < self.rays, "{self:?}");
        assert!(self.pairs_left_out * 20 < self.rays, "{self:?}");
    }
}

/// Distance of a point from a segment.
fn from_segment(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (edge, to) = ((b.0 - a.0, b.1 - a.1), (p.0 - a.0, p.1 - a.1));
    let part = (to.0 * edge.0 + to.1 * edge.1) / (edge.0 * edge.0 + edge.1 * edge.1);
    let part = if part.is_nan() { 0.0 } else { part.clamp(0.0, 1.0) };
    (to.0 - part * edge.0).hypot(to.1 - part * edge.1)
}

/// Signed distance to a cone cut off at both ends, from the middle of its axis.
pub(crate) fn frustum_distance(p: DVec3, axis: DVec3, half: f64, from: f64, to: f64) -> f64 {
    let along = p.dot(axis);
    let p = (p.cross(axis).length(), along);
    let (a, b) = ((from, -half), (to, half));
    let nearest = from_segment(p, (0.0, -half), a).min(from_segment(p, a, b)).min(from_segment(
        p,
        b,
        (0.0, half),
    ));
    let radius = from + (to - from) * (p.1 + half) / (2.0 * half);
    if p.1.abs() < half && p.0 < radius { -nearest } else { nearest }
}

/// Signed distance to a box, from its centre.
pub(crate) fn box_distance(p: DVec3, half: DVec3) -> f64 {
    let q = p.abs() - half;
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
}

/// Signed distance to a torus about y, from its centre.
pub(crate) fn torus_distance(p: DVec3, major: f64, minor: f64) -> f64 {
    (p.x.hypot(p.z) - major).hypot(p.y) - minor
}
