//! Thick curves against dense sampling of the distance to the swept ball in `f64`.

use glam::{DVec3, Vec3};
use rayburst_math::Ray;
use rayburst_math::hash::Rng;
use rayburst_procedural::{Curve, CurveError, Shape};

use crate::check::{Expected, Tolerance, all_hits, check_strange_rays, compare};
use crate::numeric::sign_changes;
use crate::random_rays::Rays;

const SAMPLES: usize = 32;

struct Tube {
    points: [DVec3; 4],
    radii: [f64; 2],
    /// Balls at equal steps of the parameter.
    balls: Vec<(DVec3, f64)>,
    /// How much nearer than the nearest of those balls another one may be.
    between: f64,
}

impl Tube {
    fn new(points: [Vec3; 4], radii: [f32; 2]) -> Self {
        let (points, radii) = (points.map(|p| p.as_dvec3()), radii.map(f64::from));
        let mut tube = Self { points, radii, balls: Vec::new(), between: 0.0 };
        tube.balls = (0..=SAMPLES).map(|i| tube.ball(i as f64 / SAMPLES as f64)).collect();
        let fastest = points.windows(2).map(|p| 3.0 * p[0].distance(p[1])).fold(0.0, f64::max);
        tube.between = 0.5 * (fastest + (radii[1] - radii[0]).abs()) / SAMPLES as f64;
        tube
    }

    fn ball(&self, u: f64) -> (DVec3, f64) {
        let (p, v) = (&self.points, 1.0 - u);
        let centre =
            v * v * v * p[0] + 3.0 * v * v * u * p[1] + 3.0 * v * u * u * p[2] + u * u * u * p[3];
        (centre, v * self.radii[0] + u * self.radii[1])
    }

    /// The least distance from the balls, and the parameter of the nearest one. Far away a bound on the
    /// distance is enough.
    fn distance(&self, p: DVec3) -> (f64, f64) {
        let to_ball = |(centre, radius): (DVec3, f64)| p.distance(centre) - radius;
        let mut sampled = [0.0; SAMPLES + 1];
        for i in 0..=SAMPLES {
            sampled[i] = to_ball(self.balls[i]);
        }
        let least = sampled.iter().copied().fold(f64::INFINITY, f64::min);
        if least > 4.0 * self.between {
            return (least - self.between, 0.0);
        }
        let mut best = (f64::INFINITY, 0.0);
        for i in 0..=SAMPLES {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(SAMPLES));
            if sampled[i] > least + self.between
                || sampled[before] < sampled[i]
                || sampled[after] < sampled[i]
            {
                continue;
            }
            // Golden section.
            let (mut a, mut b) = (before as f64 / SAMPLES as f64, after as f64 / SAMPLES as f64);
            let f = |u: f64| to_ball(self.ball(u));
            let golden = 0.5 * (5f64.sqrt() - 1.0);
            let (mut c, mut d) = (b - golden * (b - a), a + golden * (b - a));
            let (mut fc, mut fd) = (f(c), f(d));
            while b - a > 1e-9 {
                if fc < fd {
                    (b, d, fd) = (d, c, fc);
                    c = b - golden * (b - a);
                    fc = f(c);
                } else {
                    (a, c, fc) = (c, d, fd);
                    d = a + golden * (b - a);
                    fd = f(d);
                }
            }
            for u in [before as f64 / SAMPLES as f64, 0.5 * (a + b), after as f64 / SAMPLES as f64]
            {
                if f(u) < best.0 {
                    best = (f(u), u);
                }
            }
        }
        best
    }
}

fn run(points: [Vec3; 4], radii: [f32; 2], seed: u64, count: usize) {
    let shape = Curve::new(points, radii).unwrap();
    let tube = Tube::new(points, radii);
    let bounds = shape.bounds();
    let size = f64::from(bounds.diagonal());
    let centre = bounds.centre().as_dvec3();
    let mut line = |o: DVec3, d: DVec3| {
        let shift = (centre - o).dot(d) / d.length_squared();
        let (o, d, scale) = (o + shift * d, d.normalize(), d.length().recip());
        let mut found = Vec::new();
        // No slope of a distance is more than 1.
        sign_changes(&|s| tube.distance(o + s * d).0, (-size, size), 1.0, 1e-5 * size, &mut found);
        let expected = |s: f64| {
            let p = o + s * d;
            let u = tube.distance(p).1;
            Expected { t: shift + s * scale, normal: (p - tube.ball(u).0).normalize(), soft: false }
        };
        found.into_iter().map(expected).collect()
    };
    let mut rays = Rays::new(seed, bounds.lower, bounds.upper);
    // Chords shorter than the reference's 10⁻⁵ belong to cosines under that over the diameter.
    let thin = f64::from(radii[0].min(radii[1])).max(1e-2 * size);
    let band = 1e-3f64.max(1e-5 * size / thin);
    let tolerance = Tolerance { distance: 2e-7 * size, band, normal: 2e-4 };
    let counts =
        compare(&shape, &mut rays, count, tolerance, &mut line, &|p| tube.distance(p).0.abs());
    assert!(counts.hits > count / 12 && counts.soft < count / 100, "{counts:?}");
    check_strange_rays(&shape);
}

#[test]
fn curves_agree_with_dense_sampling() {
    let v = Vec3::new;
    // A bow that gets thinner, a loop that meets itself, an S, a cusp, and a straight cone.
    let bow = [v(-1.0, 0.0, 0.0), v(-0.5, 1.0, 0.3), v(0.5, 1.0, -0.5), v(1.0, 0.0, 0.2)];
    run(bow, [0.3, 0.1], 1, 25_000);
    let coil = [v(-1.0, 0.0, 0.0), v(2.0, 1.5, 0.1), v(-2.0, 1.5, -0.1), v(1.0, 0.0, 0.0)];
    run(coil, [0.12, 0.2], 2, 25_000);
    let bent = [v(0.0, 0.0, 3.0), v(1.0, 0.0, 3.0), v(-1.0, 2.0, 4.0), v(0.0, 2.0, 4.0)];
    run(bent, [0.05, 0.05], 3, 20_000);
    let cusp = [v(0.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0), v(1.0, 0.0, 0.0)];
    run(cusp, [0.1, 0.05], 4, 20_000);
    let line = [v(1.0, 1.0, 1.0), v(2.0, 1.0, 1.0), v(3.0, 1.0, 1.0), v(4.0, 1.0, 1.0)];
    run(line, [0.5, 0.0], 5, 20_000);
}

#[test]
fn thin_and_random_curves() {
    for seed in 0..10 {
        let mut rng = Rng::new(100 + seed);
        let points = std::array::from_fn(|_| 2.0 * rng.vec3() - 1.0);
        let radii = [rng.range(0.02, 0.3), rng.range(0.0, 0.3)];
        run(points, radii, 10 + seed, 2_000);
    }
}

/// Hairs down to 1/100000 of their length: rays to their middle hit them, at their radius.
#[test]
fn hairs_are_hit() {
    let mut rng = Rng::new(77);
    for radius in [1e-2, 1e-3, 1e-4, 1e-5] {
        for _ in 0..20_000 {
            let points = std::array::from_fn(|_| rng.vec3() - 0.5);
            let hair = Curve::new(points, [radius, radius]).unwrap();
            let tube = Tube::new(points, [radius, radius]);
            let to = tube.ball(f64::from(rng.range(0.01, 0.99))).0.as_vec3();
            let away = rng.vec3() - 0.5;
            let ray = Ray::new(to + 2.0 * away, -away);
            let hit = hair.nearest(&ray).unwrap_or_else(|| panic!("{radius} {points:?} {ray:?}"));
            let at = ray.origin.as_dvec3() + f64::from(hit.t) * ray.direction.as_dvec3();
            let centre = tube.ball(f64::from(hit.uv.x)).0;
            let off = (at.distance(centre) - f64::from(radius)).abs();
            assert!(off < 4e-7, "{radius} {off} {points:?} {ray:?} {hit:?}");
        }
    }
}

/// Rays along the axis, across it, and in planes of symmetry, where zeros are double.
#[test]
fn symmetric_rays_hit_straight_tubes() {
    let points = [0.0, 1.0, 2.0, 3.0].map(|x| Vec3::new(x, 0.0, 0.0));
    let tube = Curve::new(points, [0.5, 0.5]).unwrap();
    let distances = |origin: Vec3, direction: Vec3| -> Vec<f32> {
        all_hits(&tube, &Ray::new(origin, direction)).iter().map(|hit| hit.t).collect()
    };
    let near = |found: Vec<f32>, expected: [f32; 2]| {
        assert_eq!(found.len(), 2, "{found:?}");
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-6, "{found:?} {expected:?}");
        }
    };
    near(distances(Vec3::new(-2.0, 0.0, 0.0), Vec3::X), [1.5, 5.5]);
    for x in [0.0, 0.7, 1.5, 3.0] {
        near(distances(Vec3::new(x, -2.0, 0.0), Vec3::Y), [1.5, 2.5]);
        near(distances(Vec3::new(x, 0.3, -2.0), Vec3::Z), [1.6, 2.4]);
        // Almost across, away from the round ends.
        for tilt in [1e-3, 1e-5, 1e-7, 1e-9] {
            let x = x.clamp(0.1, 2.9);
            near(distances(Vec3::new(x, -2.0, 0.0), Vec3::new(tilt, 1.0, 0.0)), [1.5, 2.5]);
        }
    }
    near(distances(Vec3::new(3.4, -2.0, 0.0), Vec3::Y), [1.7, 2.3]);
    // A ring-like bow in a plane across the ray.
    let bow = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let bow = Curve::new(bow, [0.25, 0.25]).unwrap();
    let hits = all_hits(&bow, &Ray::new(Vec3::new(0.5, 0.75, -2.0), Vec3::Z));
    assert_eq!(hits.len(), 2);
    assert!((hits[0].t - 1.75).abs() < 1e-6 && (hits[1].t - 2.25).abs() < 1e-6, "{hits:?}");
    assert!((hits[0].uv.x - 0.5).abs() < 1e-3, "{hits:?}");
}

#[test]
fn uv_go_along_and_around() {
    let points = [0.0, 1.0, 2.0, 3.0].map(|x| Vec3::new(x, 0.0, 0.0));
    let tube = Curve::new(points, [0.5, 0.5]).unwrap();
    let mut turns = Vec::new();
    for k in 0..16 {
        let angle = std::f32::consts::TAU * k as f32 / 16.0;
        let out = Vec3::new(0.0, angle.cos(), angle.sin());
        let along = 0.1 + 0.05 * k as f32;
        let ray = Ray::new(Vec3::new(3.0 * along, 0.0, 0.0) + 2.0 * out, -out);
        let hit = tube.nearest(&ray).unwrap();
        assert!((hit.uv.x - along).abs() < 1e-5, "{hit:?}");
        turns.push(hit.uv.y);
    }
    for pair in turns.windows(2) {
        let turned = (pair[1] - pair[0]).rem_euclid(1.0);
        assert!((turned - 1.0 / 16.0).abs() < 1e-5, "{turns:?}");
    }
}

#[test]
fn degenerate_curves() {
    let ray = Ray::new(Vec3::new(-3.0, 0.1, 0.0), Vec3::X);
    // A ball.
    let ball = Curve::new([Vec3::ZERO; 4], [0.5, 0.5]).unwrap();
    let hits = all_hits(&ball, &ray);
    assert_eq!(hits.len(), 2);
    assert!((hits[0].t - (3.0 - 0.24f32.sqrt())).abs() < 1e-6, "{hits:?}");
    // A ball that grows in its place, and one in which all others are.
    let growing = Curve::new([Vec3::ZERO; 4], [0.0, 0.5]).unwrap();
    assert_eq!(all_hits(&growing, &ray).len(), 2);
    let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    for (points, radii) in [
        (points, [0.0, 0.0]),
        (points, [9.0, 0.0]),
        (points, [1e-30, 1e-30]),
        (points.map(|p| p * 1e38), [1e37, 1e38]),
        (points.map(|p| p * 1e-38), [1e-38, 1e-39]),
        ([Vec3::ONE; 4], [0.0, 0.0]),
    ] {
        let curve = Curve::new(points, radii).unwrap();
        all_hits(&curve, &ray);
        check_strange_rays(&curve);
    }
    assert_eq!(Curve::new(points, [0.1, -0.1]).err(), Some(CurveError::Radius(-0.1)));
    assert_eq!(Curve::new(points, [f32::NAN, 0.1]).err(), Some(CurveError::NotFinite));
    assert_eq!(Curve::new([Vec3::INFINITY; 4], [0.1; 2]).err(), Some(CurveError::NotFinite));
}
