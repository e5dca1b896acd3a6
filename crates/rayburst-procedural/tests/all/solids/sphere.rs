use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Ray, hash::Rng};
use rayburst_procedural::{Shape, Sphere};

use super::reference::{self, Case, SCALE, Seen};
use crate::rays::{self, power};

#[test]
fn spheres_are_met_where_the_distance_says() {
    let mut rng = Rng::new(1);
    let mut seen = Seen::default();
    for _ in 0..200 {
        let size = power(&mut rng, -3.0, 3.0);
        let sphere = Sphere { centre: rays::vector(&mut rng, 20.0 * size), radius: size as f32 };
        let scaled = Sphere { centre: SCALE * sphere.centre, radius: SCALE * sphere.radius };
        let radius = f64::from(sphere.radius);
        let place = |_: Vec3, uv: Vec2| {
            let (u, v) = (f64::from(uv.x) * TAU, f64::from(uv.y) * PI);
            radius * DVec3::new(v.sin() * u.cos(), v.cos(), -v.sin() * u.sin())
        };
        let case = Case {
            solid: &sphere,
            scaled: &scaled,
            distance: &|p| p.length() - radius,
            centre: sphere.centre.as_dvec3(),
            radius,
            feature: 1.0,
            place: &place,
        };
        reference::check(&mut rng, &case, 100, &mut seen);
    }
    seen.check(1.5);
}

/// In single precision with the usual formula this ray is half a radius off.
#[test]
fn a_small_sphere_far_away_keeps_its_shape() {
    let sphere = Sphere { centre: Vec3::ZERO, radius: 1.0 };
    let ray = Ray::new(Vec3::new(0.5, 0.0, 65_536.0), Vec3::NEG_Z);
    let hit = sphere.nearest(&ray).expect("a hit");
    let z = 0.75f64.sqrt();
    assert_eq!(hit.t, (65_536.0 - z) as f32);
    assert!(hit.normal.distance(Vec3::new(0.5, 0.0, z as f32)) < 1e-6);
}

#[test]
fn an_origin_on_the_surface_is_at_zero() {
    let sphere = Sphere { centre: Vec3::ZERO, radius: 1.0 };
    let ray = Ray { t_min: f32::NEG_INFINITY, ..Ray::new(Vec3::X, Vec3::new(-1.0, 1e-3, 0.0)) };
    assert_eq!(rays::all_hits(&sphere, &ray)[0].t, 0.0);
}
