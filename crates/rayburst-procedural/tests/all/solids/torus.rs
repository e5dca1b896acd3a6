use std::f64::consts::TAU;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Ray, hash::Rng};
use rayburst_procedural::Torus;

use super::reference::{self, Case, SCALE, Seen};
use crate::rays::{self, power};

/// Tori whose tube is thick by a power of ten of the ring.
fn check(seed: u64, thickness: (f64, f64), count: usize) -> Seen {
    let mut rng = Rng::new(seed);
    let mut seen = Seen::default();
    for _ in 0..count {
        let major = power(&mut rng, -3.0, 3.0);
        let minor = major * power(&mut rng, thickness.0, thickness.1);
        let torus = Torus {
            centre: rays::vector(&mut rng, 20.0 * major),
            major: major as f32,
            minor: minor as f32,
        };
        let scaled = Torus {
            centre: SCALE * torus.centre,
            major: SCALE * torus.major,
            minor: SCALE * torus.minor,
        };
        let (major, minor) = (f64::from(torus.major), f64::from(torus.minor));
        let place = |_: Vec3, uv: Vec2| {
            let (u, v) = (f64::from(uv.x) * TAU, f64::from(uv.y) * TAU);
            let across = major + minor * v.cos();
            DVec3::new(across * u.cos(), minor * v.sin(), -across * u.sin())
        };
        let case = Case {
            solid: &torus,
            scaled: &scaled,
            distance: &|p| reference::torus_distance(p, major, minor),
            centre: torus.centre.as_dvec3(),
            radius: major + minor,
            feature: minor / (major + minor),
            place: &place,
        };
        reference::check(&mut rng, &case, 100, &mut seen);
    }
    seen
}

#[test]
fn rings_are_met_where_the_distance_says() {
    let seen = check(7, (-1.5, -0.02), 200);
    seen.check(1.0);
    assert!(seen.four > 5_000, "{seen:?}");
}

#[test]
fn thin_rings_are_met_where_the_distance_says() {
    let seen = check(8, (-4.0, -1.5), 170);
    seen.check(0.3);
}

#[test]
fn rings_without_a_hole_are_met_where_the_distance_says() {
    let seen = check(9, (0.0, 3.0), 170);
    seen.check(1.0);
    assert!(seen.four > 100, "{seen:?}");
}

#[test]
fn lines_of_symmetry_have_exact_hits() {
    let torus = Torus { centre: Vec3::ZERO, major: 2.0, minor: 0.5 };
    let along = |origin, direction| -> Vec<f32> {
        rays::all_hits(&torus, &Ray::new(origin, direction)).iter().map(|hit| hit.t).collect()
    };
    assert_eq!(along(Vec3::new(-4.0, 0.0, 0.0), Vec3::X), [1.5, 2.5, 5.5, 6.5]);
    assert_eq!(along(Vec3::new(0.0, 4.0, 0.0), Vec3::NEG_Y), []);
    assert_eq!(along(Vec3::new(2.0, 4.0, 0.0), Vec3::NEG_Y), [3.5, 4.5]);
}
