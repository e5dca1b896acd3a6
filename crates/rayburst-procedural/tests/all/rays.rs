//! Random rays around a shape.

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use rayburst_math::{Ray, hash::Rng};
use rayburst_procedural::{Shape, ShapeHit};

/// A signed distance, negative inside, to a shape around the origin.
pub(crate) type Distance<'a> = &'a dyn Fn(DVec3) -> f64;

/// A uniform number in an interval.
pub(crate) fn range(rng: &mut Rng, lo: f64, hi: f64) -> f64 {
    lo + (hi - lo) * (rng.u32() as f64 + 0.5) / 2.0f64.powi(32)
}

/// A power of ten with an exponent in an interval.
pub(crate) fn power(rng: &mut Rng, lo: f64, hi: f64) -> f64 {
    10.0f64.powf(range(rng, lo, hi))
}

/// A point in the unit ball.
pub(crate) fn in_ball(rng: &mut Rng) -> DVec3 {
    loop {
        let p = DVec3::new(range(rng, -1.0, 1.0), range(rng, -1.0, 1.0), range(rng, -1.0, 1.0));
        if p.length_squared() <= 1.0 && p.length_squared() > 1e-6 {
            return p;
        }
    }
}

/// A unit vector.
pub(crate) fn unit(rng: &mut Rng) -> DVec3 {
    in_ball(rng).normalize()
}

/// The gradient of a distance by central differences.
pub(crate) fn gradient(distance: Distance, p: DVec3, step: f64) -> DVec3 {
    let along =
        |axis: DVec3| (distance(p + step * axis) - distance(p - step * axis)) / (2.0 * step);
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

/// How a ray lies to its shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// From outside, aimed into the ball around the shape.
    Outside,
    /// From a point in the ball.
    Within,
    /// From up to a million radii away.
    Far,
    /// Nearly or exactly touching the surface.
    Grazing,
    /// Along an axis or a coordinate plane.
    Aligned,
    /// From a point on the surface, up to rounding.
    OnSurface,
}

pub(crate) const KINDS: [Kind; 6] =
    [Kind::Outside, Kind::Within, Kind::Far, Kind::Grazing, Kind::Aligned, Kind::OnSurface];

fn on_surface(rng: &mut Rng, radius: f64, distance: Distance) -> DVec3 {
    let mut p = radius * in_ball(rng);
    for _ in 0..4 {
        p -= distance(p) * gradient(distance, p, 1e-6 * radius);
    }
    p
}

/// A ray over its whole line, for a shape in the ball around `centre`.
pub(crate) fn ray(
    rng: &mut Rng,
    kind: Kind,
    centre: DVec3,
    radius: f64,
    distance: Distance,
) -> Ray {
    let (from, direction) = match kind {
        Kind::Outside | Kind::Far => {
            let away = if kind == Kind::Far { power(rng, 1.0, 6.0) } else { range(rng, 1.0, 5.0) };
            let (from, to) = (away * radius * unit(rng), radius * in_ball(rng));
            (from, (to - from).normalize())
        }
        Kind::Within => (radius * in_ball(rng), unit(rng)),
        Kind::Grazing => {
            let p = on_surface(rng, radius, distance);
            let normal = gradient(distance, p, 1e-6 * radius);
            let tilt = if rng.below(4) == 0 { 0.0 } else { power(rng, -6.0, -1.0) };
            let tangent = normal.cross(unit(rng)).normalize_or(DVec3::X);
            let direction = (tangent + tilt * unit(rng)).normalize();
            (p - range(rng, -2.0, 3.0) * radius * direction, direction)
        }
        Kind::Aligned => {
            let mut direction = unit(rng);
            let axis = rng.below(3) as usize;
            direction[axis] = 0.0;
            if rng.below(2) == 0 {
                direction[(axis + 1) % 3] = 0.0;
            }
            let from = radius * in_ball(rng);
            let direction = direction.normalize();
            (from - range(rng, -1.0, 3.0) * radius * direction, direction)
        }
        Kind::OnSurface => (on_surface(rng, radius, distance), unit(rng)),
    };
    let length = power(rng, -6.0, 6.0);
    Ray::with_interval(
        (centre + from).as_vec3(),
        (length * direction).as_vec3(),
        f32::NEG_INFINITY,
        f32::INFINITY,
    )
}

/// All hits of a ray.
pub(crate) fn all_hits(shape: &dyn Shape, ray: &Ray) -> Vec<ShapeHit> {
    let mut hits = Vec::new();
    shape.hits(ray, &mut |hit| {
        hits.push(hit);
        ControlFlow::Continue(())
    });
    hits
}

/// Checks what intervals, breaking and [`Shape::nearest`] make of the hits of a whole line.
pub(crate) fn check_intervals(rng: &mut Rng, shape: &dyn Shape, ray: &Ray, hits: &[ShapeHit]) {
    assert!(hits.is_sorted_by(|a, b| a.t <= b.t), "{hits:?}");
    // Random ends, or exactly those of hits, which are included.
    let mut end = || match (rng.below(3), hits.len()) {
        (0, 1..) => hits[rng.below(hits.len() as u32) as usize].t,
        (1, _) => {
            let spread = hits.iter().map(|hit| hit.t.abs()).fold(1.0, f32::max);
            rng.range(-1.5 * spread, 1.5 * spread)
        }
        _ => 0.0,
    };
    let (a, b) = (end(), end());
    let open = rng.below(4);
    let t_min = if open == 0 { f32::NEG_INFINITY } else { a.min(b) };
    let t_max = if open == 1 { f32::INFINITY } else { a.max(b) };
    let part = Ray { t_min, t_max, ..*ray };
    let expected: Vec<ShapeHit> =
        hits.iter().filter(|hit| t_min <= hit.t && hit.t <= t_max).copied().collect();
    assert_eq!(all_hits(shape, &part), expected, "{part:?}");
    assert_eq!(shape.nearest(&part), expected.first().copied(), "{part:?}");
    let stop = rng.below(3) as usize;
    let mut reported = 0;
    shape.hits(&part, &mut |hit| {
        assert_eq!(hit, expected[reported]);
        reported += 1;
        if reported > stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(reported, expected.len().min(stop + 1), "hits after a break");
}

/// Checks that hits lie in the box, up to the rounding of `t`.
pub(crate) fn check_bounds(shape: &dyn Shape, ray: &Ray, hits: &[ShapeHit]) {
    let bounds = shape.bounds();
    for hit in hits {
        let p = ray.origin.as_dvec3() + f64::from(hit.t) * ray.direction.as_dvec3();
        let slack = 1.01 * 2.0f64.powi(-24) * f64::from(hit.t.abs());
        let slack = slack * ray.direction.as_dvec3().abs()
            + 1e-12 * (ray.origin.as_dvec3().length() + f64::from(bounds.diagonal()));
        assert!(
            (bounds.lower.as_dvec3() - slack).cmple(p).all()
                && p.cmple(bounds.upper.as_dvec3() + slack).all(),
            "{p} outside of {bounds:?}: {hit:?} {ray:?}"
        );
    }
}

/// Checks that a normal has length one and that coordinates are in [0, 1].
pub(crate) fn check_numbers(hits: &[ShapeHit]) {
    for hit in hits {
        assert!((hit.normal.length() - 1.0).abs() < 3e-7, "{hit:?}");
        assert!(hit.uv.cmpge(glam::Vec2::ZERO).all() && hit.uv.cmple(glam::Vec2::ONE).all());
        assert!(hit.t.is_finite());
    }
}

/// Checks that shape and ray scaled by a power of two have the same hits, bit by bit.
pub(crate) fn check_scaled(shape: &dyn Shape, scaled: &dyn Shape, ray: &Ray, scale: f32) {
    let larger = Ray { origin: scale * ray.origin, direction: scale * ray.direction, ..*ray };
    assert_eq!(all_hits(scaled, &larger), all_hits(shape, ray), "{scale} {ray:?}");
}

/// A random vector in single precision.
pub(crate) fn vector(rng: &mut Rng, size: f64) -> Vec3 {
    (size * in_ball(rng)).as_vec3()
}
