//! Distance fields of a sphere, a torus and a box against their analytic intersections.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};
use rayburst_procedural::{DistanceField, DistanceFieldError, Shape};

use crate::check::{Expected, Tolerance, all_hits, check_strange_rays, compare};
use crate::polynomial;
use crate::random_rays::Rays;

const CENTRE: Vec3 = Vec3::new(0.5, -1.0, 2.0);

fn cube(half: Vec3) -> Aabb {
    Aabb { lower: CENTRE - half, upper: CENTRE + half }
}

/// The part of a line near the shapes, from the point nearest to their centre, which becomes zero:
/// `(origin, unit direction, t of the origin, t a unit of length)`.
fn near(o: DVec3, d: DVec3) -> (DVec3, DVec3, f64, f64) {
    let offset = o - CENTRE.as_dvec3();
    let shift = -offset.dot(d) / d.length_squared();
    (offset + shift * d, d.normalize(), shift, d.length().recip())
}

fn run(
    field: &dyn Shape,
    seed: u64,
    band: f64,
    line: &mut dyn FnMut(DVec3, DVec3) -> Vec<Expected>,
    distance: &dyn Fn(DVec3) -> f64,
) {
    const COUNT: usize = 120_000;
    let bounds = field.bounds();
    let mut rays = Rays::new(seed, bounds.lower, bounds.upper);
    let size = f64::from(bounds.diagonal());
    let tolerance = Tolerance { distance: 6e-7 * size, band, normal: 1e-3 };
    let counts = compare(field, &mut rays, COUNT, tolerance, line, distance);
    assert!(counts.hits > COUNT / 3 && counts.soft < COUNT / 10, "{counts:?}");
    check_strange_rays(field);
}

#[test]
fn a_sphere() {
    let field =
        DistanceField::new(|p: Vec3| (p - CENTRE).length() - 1.25, cube(Vec3::splat(1.25)), 1.0)
            .unwrap();
    let mut line = |o: DVec3, d: DVec3| {
        let (o, d, shift, scale) = near(o, d);
        let half = 1.25 * 1.25 - o.length_squared();
        let ends = if half < 0.0 { vec![] } else { vec![-half.sqrt(), half.sqrt()] };
        let expected =
            |s: f64| Expected { t: shift + s * scale, normal: (o + s * d) / 1.25, soft: false };
        ends.into_iter().map(expected).collect()
    };
    run(&field, 1, 3e-3, &mut line, &|p| ((p - CENTRE.as_dvec3()).length() - 1.25).abs());
}

/// Twice the distance to a torus, as a bound of 2 allows.
#[test]
fn a_torus_with_a_bound_of_two() {
    let field = |p: Vec3| {
        let p = p - CENTRE;
        2.0 * (Vec2::new(Vec2::new(p.x, p.z).length() - 1.0, p.y).length() - 0.3)
    };
    let field: Box<dyn Fn(Vec3) -> f32 + Send + Sync> = Box::new(field);
    let field = DistanceField::new(field, cube(Vec3::new(1.3, 0.3, 1.3)), 2.0).unwrap();
    // (|p|² + R² - r²)² = 4 R² (x² + z²)
    let mut line = |o: DVec3, d: DVec3| {
        let (o, d, shift, scale) = near(o, d);
        let square = [o.length_squared() + 1.0 - 0.09, 2.0 * o.dot(d), 1.0];
        let flat = [o.x * o.x + o.z * o.z, 2.0 * (o.x * d.x + o.z * d.z), d.x * d.x + d.z * d.z];
        let mut quartic = polynomial::product(&square, &square);
        for i in 0..3 {
            quartic[i] -= 4.0 * flat[i];
        }
        let expected = |s: f64| {
            let p = o + s * d;
            let ring = DVec3::new(p.x, 0.0, p.z).normalize();
            Expected { t: shift + s * scale, normal: (p - ring).normalize(), soft: false }
        };
        polynomial::roots(&quartic, -2.0, 2.0).into_iter().map(expected).collect()
    };
    run(&field, 2, 5e-3, &mut line, &|p| {
        let p = p - CENTRE.as_dvec3();
        (DVec2::new(DVec2::new(p.x, p.z).length() - 1.0, p.y).length() - 0.3).abs()
    });
}

#[test]
fn a_box() {
    let half = Vec3::new(1.0, 0.5, 0.75);
    let field = move |p: Vec3| {
        let q = (p - CENTRE).abs() - half;
        q.max(Vec3::ZERO).length() + q.max_element().min(0.0)
    };
    let field = DistanceField::new(field, cube(half), 1.0).unwrap();
    let half = half.as_dvec3();
    let edge = 2e-3 * f64::from(field.bounds().diagonal());
    let mut line = |o: DVec3, d: DVec3| {
        let (o, d, shift, scale) = near(o, d);
        let mut found = Vec::new();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let s = (side * half[axis] - o[axis]) / d[axis];
                let mut rest = (o + s * d).abs() - half;
                rest[axis] = f64::NEG_INFINITY;
                if s.is_finite() && rest.max_element() <= 1e-5 {
                    let mut normal = DVec3::ZERO;
                    normal[axis] = side;
                    // Differences across an edge have the normals of both faces in them.
                    let soft = rest.max_element() > -edge;
                    found.push(Expected { t: shift + s * scale, normal, soft });
                }
            }
        }
        found
    };
    // Rays that graze a face go on to meet another one at its edge: many are soft.
    run(&field, 3, 3e-3, &mut line, &|p| {
        let q = (p - CENTRE.as_dvec3()).abs() - half;
        (q.max(DVec3::ZERO).length() + q.max_element().min(0.0)).abs()
    });
}

#[test]
fn rays_cost_no_more_values_than_promised() {
    let calls = AtomicUsize::new(0);
    let plane = |p: Vec3| {
        calls.fetch_add(1, Ordering::Relaxed);
        p.y
    };
    let field = DistanceField::new(plane, cube(Vec3::splat(3.0)), 1.0).unwrap();
    for (height, steps) in [(0.0, 16_384), (1e-7, 16_384), (1e-3, 16_384), (1.0, 64)] {
        calls.store(0, Ordering::Relaxed);
        let ray = Ray::new(Vec3::new(-9.0, height, 2.0), Vec3::X);
        assert!(all_hits(&field, &ray).len() <= 1);
        assert!(calls.load(Ordering::Relaxed) <= steps + 64, "{height}: {calls:?}");
    }
    let strange: [fn(Vec3) -> f32; 5] = [
        |_| f32::NAN,
        |_| f32::INFINITY,
        |_| 0.0,
        |p| if p.x > 0.0 { f32::NEG_INFINITY } else { f32::INFINITY },
        |p| (p.x * 1e30).sin() * 1e-30,
    ];
    for f in strange {
        let field = DistanceField::new(f, cube(Vec3::splat(3.0)), 1.0).unwrap();
        let field = field.with_smallest_step(1e-2).unwrap();
        all_hits(&field, &Ray::new(Vec3::splat(-5.0), Vec3::new(1.0, 0.8, 1.1)));
        check_strange_rays(&field);
    }
}

#[test]
fn thin_walls_and_ends_are_found() {
    // A wall of 1/10000 of the diagonal, a little more than the smallest step.
    let bounds = cube(Vec3::ONE);
    let wall = 1e-4 * bounds.diagonal();
    let make = || {
        let f = move |p: Vec3| (p.x - CENTRE.x).abs() - 0.5 * wall;
        DistanceField::new(f, bounds, 1.0).unwrap()
    };
    let ray = Ray::new(CENTRE - 3.0 * Vec3::X, Vec3::X);
    assert_eq!(all_hits(&make().with_smallest_step(1e-5).unwrap(), &ray).len(), 2);
    assert_eq!(all_hits(&make(), &ray).len(), 2);
    // A value of exactly zero at the end is a hit, from both sides.
    for (t_min, t_max) in [(0.0, 3.0), (3.0, 9.0), (3.0, 3.0)] {
        let f = |p: Vec3| p.x - CENTRE.x;
        let field = DistanceField::new(f, bounds, 1.0).unwrap();
        let ray = Ray { t_min, t_max, ..ray };
        assert_eq!(all_hits(&field, &ray).len(), 1, "{ray:?}");
    }
}

#[test]
fn what_makes_no_field_is_named() {
    let f = |p: Vec3| p.x;
    assert_eq!(DistanceField::new(f, Aabb::EMPTY, 1.0).err(), Some(DistanceFieldError::Bounds));
    assert_eq!(
        DistanceField::new(f, cube(Vec3::ONE), 0.0).err(),
        Some(DistanceFieldError::Lipschitz(0.0))
    );
    assert!(DistanceField::new(f, cube(Vec3::ONE), f32::NAN).is_err());
    assert!(DistanceField::new(f, cube(Vec3::splat(f32::INFINITY)), 1.0).is_err());
    let field = DistanceField::new(f, cube(Vec3::ONE), 1.0).unwrap();
    assert_eq!(field.with_smallest_step(0.0).err(), Some(DistanceFieldError::Step(0.0)));
}
