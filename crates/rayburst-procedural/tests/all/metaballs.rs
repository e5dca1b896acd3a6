//! Metaballs against dense sampling of their density in `f64`.

use glam::{DVec3, Vec3};
use rayburst_math::Ray;
use rayburst_math::hash::Rng;
use rayburst_procedural::{Metaball, Metaballs, MetaballsError, Shape};

use crate::check::{Expected, Tolerance, all_hits, check_strange_rays, compare};
use crate::numeric::sign_changes;
use crate::random_rays::Rays;

fn density(balls: &[Metaball], threshold: f32, p: DVec3) -> f64 {
    let one = |b: &Metaball| {
        let r2 = (p - b.centre.as_dvec3()).length_squared() / f64::from(b.radius).powi(2);
        if r2 < 1.0 { f64::from(b.weight) * (1.0 - r2).powi(3) } else { 0.0 }
    };
    balls.iter().map(one).sum::<f64>() - f64::from(threshold)
}

fn slope(balls: &[Metaball], p: DVec3) -> DVec3 {
    let e = 1e-5;
    let change = |axis| density(balls, 0.0, p + e * axis) - density(balls, 0.0, p - e * axis);
    DVec3::new(change(DVec3::X), change(DVec3::Y), change(DVec3::Z)) / (2.0 * e)
}

fn run(balls: &[Metaball], threshold: f32, seed: u64, count: usize) {
    let shape = Metaballs::new(balls.to_vec(), threshold).unwrap();
    let bounds = shape.bounds();
    let size = f64::from(bounds.diagonal());
    let centre = bounds.centre().as_dvec3();
    // The slope of (1 - r²)³ is at most 6 r (1 - r²)² < 1.72.
    let steepest: f64 = balls.iter().map(|b| 1.72 * f64::from(b.weight.abs() / b.radius)).sum();
    let mut line = |o: DVec3, d: DVec3| {
        let shift = (centre - o).dot(d) / d.length_squared();
        let (o, d, scale) = (o + shift * d, d.normalize(), d.length().recip());
        let mut found = Vec::new();
        let f = |s: f64| density(balls, threshold, o + s * d);
        sign_changes(&f, (-size, size), steepest, 1e-6 * size, &mut found);
        let expected = |s: f64| Expected {
            t: shift + s * scale,
            normal: -slope(balls, o + s * d).normalize(),
            soft: false,
        };
        found.into_iter().map(expected).collect()
    };
    let distance = |p: DVec3| {
        density(balls, threshold, p).abs() / slope(balls, p).length().max(0.05 * steepest)
    };
    let mut rays = Rays::new(seed, bounds.lower, bounds.upper);
    let tolerance = Tolerance { distance: 2e-7 * size, band: 1e-3, normal: 1e-5 };
    let counts = compare(&shape, &mut rays, count, tolerance, &mut line, &distance);
    assert!(counts.hits > count / 4 && counts.soft < count / 100, "{counts:?}");
    check_strange_rays(&shape);
}

fn random_balls(seed: u64, count: usize, negative: bool) -> Vec<Metaball> {
    let mut rng = Rng::new(seed);
    (0..count)
        .map(|i| Metaball {
            centre: Vec3::new(rng.range(-1.0, 1.0), rng.range(0.0, 2.0), rng.range(4.0, 5.0)),
            radius: rng.range(0.4, 1.2),
            weight: if negative && i % 3 == 2 { -rng.range(0.3, 1.5) } else { rng.range(0.5, 1.5) },
        })
        .collect()
}

#[test]
fn metaballs_agree_with_dense_sampling() {
    let pair = |x: f32| Metaball { centre: Vec3::new(x, 0.0, 0.0), radius: 1.0, weight: 1.0 };
    run(&[pair(-0.45), pair(0.45)], 0.3, 1, 40_000);
    // One inside the other, taken away: a hollow ball.
    run(&[pair(0.0), Metaball { radius: 0.5, weight: -2.0, ..pair(0.1) }], 0.1, 2, 30_000);
    run(&random_balls(3, 7, false), 0.6, 3, 30_000);
    run(&random_balls(4, 12, true), 0.4, 4, 30_000);
}

#[test]
fn more_balls_than_fit_into_the_fixed_array() {
    let balls: Vec<Metaball> = (0..100)
        .map(|i| Metaball {
            centre: Vec3::new(0.05 * i as f32, 0.1 * (i % 7) as f32, 0.0),
            radius: 2.0,
            weight: 0.05,
        })
        .collect();
    run(&balls, 0.8, 5, 4_000);
}

#[test]
fn the_density_is_zero_at_hits() {
    let balls = random_balls(8, 9, true);
    let shape = Metaballs::new(balls, 0.5).unwrap();
    let ray = Ray::new(Vec3::new(-5.0, 1.1, 4.4), Vec3::X);
    let hits = all_hits(&shape, &ray);
    assert!(!hits.is_empty() && hits.len().is_multiple_of(2));
    for hit in hits {
        assert!(shape.density(ray.at(hit.t)).abs() < 1e-5);
    }
}

#[test]
fn degenerate_balls() {
    let ball = Metaball { centre: Vec3::ZERO, radius: 1.0, weight: 1.0 };
    let make = |balls: &[Metaball], threshold| Metaballs::new(balls.to_vec(), threshold);
    assert_eq!(
        make(&[ball, Metaball { radius: 0.0, ..ball }], 0.5).err(),
        Some(MetaballsError::Ball(1))
    );
    assert_eq!(
        make(&[Metaball { weight: f32::NAN, ..ball }], 0.5).err(),
        Some(MetaballsError::Ball(0))
    );
    assert_eq!(make(&[ball], 0.0).err(), Some(MetaballsError::Threshold(0.0)));
    // Nothing at all, nothing positive, never enough, and just enough in one point.
    let ray = Ray::new(Vec3::new(0.0, 0.0, -3.0), Vec3::Z);
    for (balls, threshold) in [
        (vec![], 0.5),
        (vec![Metaball { weight: -1.0, ..ball }], 0.5),
        (vec![Metaball { weight: 0.1, ..ball }], 0.5),
        (vec![ball], 1.0),
        (vec![Metaball { radius: 1e-38, ..ball }], 0.5),
        (vec![Metaball { radius: 3e38, ..ball }], 0.5),
    ] {
        let shape = make(&balls, threshold).unwrap();
        assert!(all_hits(&shape, &ray).len() <= 2);
        check_strange_rays(&shape);
    }
    // Balls that end where the next one begins, or are the same one.
    let next = Metaball { centre: Vec3::new(0.0, 0.0, 2.0), ..ball };
    assert_eq!(all_hits(&make(&[ball, next], 0.5).unwrap(), &ray).len(), 4);
    assert_eq!(all_hits(&make(&[ball, ball], 0.5).unwrap(), &ray).len(), 2);
}

#[test]
fn ends_of_the_interval_are_in_it() {
    let ball = Metaball { centre: Vec3::ZERO, radius: 2.0, weight: 1.0 };
    let shape = Metaballs::new(vec![ball], 0.125).unwrap();
    let outwards = Ray::new(Vec3::new(1.0, 1.0, 0.0), Vec3::X);
    for (t_min, t_max) in [(0.0, 5.0), (0.0, 0.0), (-1.0, 0.0)] {
        let hits = all_hits(&shape, &Ray { t_min, t_max, ..outwards });
        assert_eq!(hits.len(), 1, "{t_min} {t_max}");
        assert_eq!(hits[0].t, 0.0);
    }
}
