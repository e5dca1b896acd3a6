//! The hits of a shape against those of a reference.

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use rayburst_math::Ray;
use rayburst_procedural::{Shape, ShapeHit};

use crate::random_rays::Rays;

/// A place where the whole line, whatever the ray's interval, meets the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expected {
    pub(crate) t: f64,
    pub(crate) normal: DVec3,
    /// Not to be asked of the shape: on a border, say.
    pub(crate) soft: bool,
}

/// What is tolerated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// How far hits may be from the surface, and along the ray from where they should be if the ray
    /// meets the surface at a right angle; on top of a few units of `f32` in the ray's point.
    pub(crate) distance: f64,
    /// The silhouette: hits at a smaller cosine between ray and normal may differ.
    pub(crate) band: f64,
    /// Largest distance of unit normals.
    pub(crate) normal: f64,
}

#[derive(Default, Debug)]
pub(crate) struct Counts {
    pub(crate) rays: usize,
    pub(crate) hits: usize,
    pub(crate) soft: usize,
    pub(crate) worst_distance: f64,
    pub(crate) worst_normal: f64,
}

pub(crate) fn all_hits(shape: &dyn Shape, ray: &Ray) -> Vec<ShapeHit> {
    let mut hits = Vec::new();
    shape.hits(ray, &mut |hit| {
        hits.push(hit);
        ControlFlow::Continue(())
    });
    hits
}

/// Shoots random rays; `line` gives all places where a ray's line meets the surface, `distance` how far
/// a point is from it (or a bound).
pub(crate) fn compare(
    shape: &dyn Shape,
    rays: &mut Rays,
    count: usize,
    tolerance: Tolerance,
    line: &mut dyn FnMut(DVec3, DVec3) -> Vec<Expected>,
    distance: &dyn Fn(DVec3) -> f64,
) -> Counts {
    let mut counts = Counts::default();
    for index in 0..count {
        let ray = rays.next();
        let hits = all_hits(shape, &ray);
        if let Some(hit) = hits.last() {
            rays.remember(&ray, hit);
        }
        check_rules(shape, &ray, &hits);
        let expected = line(ray.origin.as_dvec3(), ray.direction.as_dvec3());
        compare_ray(index, &ray, &hits, &expected, tolerance, distance, &mut counts);
    }
    counts
}

fn compare_ray(
    index: usize,
    ray: &Ray,
    hits: &[ShapeHit],
    expected: &[Expected],
    tolerance: Tolerance,
    distance: &dyn Fn(DVec3) -> f64,
    counts: &mut Counts,
) {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (length, way) = (direction.length(), direction.normalize());
    let slack = |t: f64| tolerance.distance + 2.0 * f64::from(f32::EPSILON) * (t * length).abs();
    let slack_t = |t: f64, cosine: f64| slack(t) / length / cosine.max(tolerance.band);
    counts.rays += 1;
    counts.hits += hits.len();

    let mut used = vec![false; hits.len()];
    for wanted in expected {
        let cosine = wanted.normal.dot(way);
        let by = slack_t(wanted.t, cosine.abs());
        let inside = wanted.t > f64::from(ray.t_min) + by && wanted.t < f64::from(ray.t_max) - by;
        let found = hits.iter().enumerate().position(|(i, hit)| {
            !used[i]
                && (f64::from(hit.t) - wanted.t).abs() <= by
                && (hit.normal.as_dvec3() - wanted.normal).length() <= tolerance.normal
        });
        let soft = wanted.soft || cosine.abs() < tolerance.band;
        match found {
            Some(i) => {
                used[i] = true;
                if !soft {
                    let off = (f64::from(hits[i].t) - wanted.t).abs() * length;
                    let rounding = slack(wanted.t) - tolerance.distance;
                    counts.worst_distance =
                        counts.worst_distance.max((off - rounding) * cosine.abs());
                    counts.worst_normal = counts
                        .worst_normal
                        .max((hits[i].normal.as_dvec3() - wanted.normal).length());
                }
            }
            None if soft || !inside => counts.soft += usize::from(soft),
            None => panic!(
                "ray {index}: no hit at {} (cosine {cosine}): {ray:?}\n{hits:#?}\n{expected:#?}",
                wanted.t
            ),
        }
    }
    for (i, hit) in hits.iter().enumerate() {
        let cosine = hit.normal.as_dvec3().dot(way).abs();
        let off = distance(origin + f64::from(hit.t) * direction);
        assert!(
            off <= slack(f64::from(hit.t)),
            "ray {index}: the hit at {} is {off} off the surface: {ray:?}",
            hit.t
        );
        let near_soft = || {
            expected.iter().any(|e| {
                (e.soft || e.normal.dot(way).abs() < tolerance.band)
                    && (f64::from(hit.t) - e.t).abs() <= 2.0 * slack_t(e.t, 0.0)
            })
        };
        assert!(
            used[i] || cosine < tolerance.band || near_soft(),
            "ray {index}: a hit that should not be, {hit:?} (cosine {cosine}): {ray:?}\n{expected:#?}"
        );
    }
}

/// What holds of all shapes: order, interval, bounds, unit normals, and that a break stops.
fn check_rules(shape: &dyn Shape, ray: &Ray, hits: &[ShapeHit]) {
    let bounds = shape.bounds();
    for pair in hits.windows(2) {
        assert!(pair[0].t <= pair[1].t, "out of order: {ray:?} {hits:?}");
    }
    for hit in hits {
        assert!(ray.t_min <= hit.t && hit.t <= ray.t_max, "out of the interval: {ray:?} {hit:?}");
        assert!(hit.uv.is_finite(), "{ray:?} {hit:?}");
        assert!((hit.normal.length() - 1.0).abs() < 1e-5, "no unit normal: {ray:?} {hit:?}");
        let point = ray.origin.as_dvec3() + f64::from(hit.t) * ray.direction.as_dvec3();
        let travelled = f64::from(hit.t.abs() * ray.direction.length());
        let pad = 1e-6 * (travelled + point.abs().max_element() + bounds.diagonal() as f64);
        let inside = (point - bounds.lower.as_dvec3()).cmpge(DVec3::splat(-pad)).all()
            && (point - bounds.upper.as_dvec3()).cmple(DVec3::splat(pad)).all();
        assert!(inside, "out of bounds: {point} {bounds:?} {ray:?} {hit:?}");
    }
    let mut calls = 0;
    shape.hits(ray, &mut |_| {
        calls += 1;
        ControlFlow::Break(())
    });
    assert_eq!(calls, hits.len().min(1), "a break stops: {ray:?}");
    assert_eq!(shape.nearest(ray), hits.first().copied(), "{ray:?}");
}

/// Rays that hit nothing by contract, and those with extreme numbers, which must not panic or hang.
pub(crate) fn check_strange_rays(shape: &dyn Shape) {
    let good = Ray::new(Vec3::splat(0.1), Vec3::new(0.3, -1.0, 0.2));
    let invalid = [
        Ray { origin: Vec3::new(f32::NAN, 0.0, 0.0), ..good },
        Ray { origin: Vec3::new(0.0, f32::INFINITY, 0.0), ..good },
        Ray { direction: Vec3::ZERO, ..good },
        Ray { direction: Vec3::new(0.0, f32::NAN, 1.0), ..good },
        Ray { direction: Vec3::new(0.0, f32::NEG_INFINITY, 1.0), ..good },
        Ray { t_min: f32::NAN, ..good },
        Ray { t_max: f32::NAN, ..good },
        Ray { t_min: 2.0, t_max: 1.0, ..good },
    ];
    for ray in invalid {
        assert_eq!(all_hits(shape, &ray), [], "{ray:?}");
    }
    let numbers = [0.0, -0.0, 1.0, -1.0, 1e-45, 1e-38, -1e-20, 1e10, -1e20, 3e38, -3e38];
    let mut rng = rayburst_math::hash::Rng::new(5);
    for _ in 0..20_000 {
        let mut pick = || numbers[rng.below(numbers.len() as u32) as usize];
        let ray = Ray::with_interval(
            Vec3::new(pick(), pick(), pick()),
            Vec3::new(pick(), pick(), pick()),
            [f32::NEG_INFINITY, pick(), 0.0][usize::from(pick() > 0.0)],
            [f32::INFINITY, pick()][usize::from(pick() > 0.0)],
        );
        let hits = all_hits(shape, &ray);
        assert!(hits.len() < 1000);
        for hit in hits {
            assert!(ray.t_min <= hit.t && hit.t <= ray.t_max && hit.t.is_finite(), "{ray:?}");
            assert!(!hit.normal.is_nan() && !hit.uv.is_nan(), "{ray:?} {hit:?}");
        }
    }
}
