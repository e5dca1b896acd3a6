use std::f64::consts::TAU;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Frame, Ray, hash::Rng};
use rayburst_procedural::{Cone, Cylinder, Shape};

use super::reference::{self, Case, SCALE, Seen};
use crate::rays::{self, power, range};

/// The place of coordinates on a cylinder or cone, from the middle of its axis.
pub(super) fn place_on_frustum(
    normal: Vec3,
    uv: Vec2,
    axis: DVec3,
    half: f64,
    from: f64,
    to: f64,
) -> DVec3 {
    let frame = Frame::from_normal(axis.as_vec3());
    let (u, v) = (f64::from(uv.x) * TAU, f64::from(uv.y));
    let outwards = u.cos() * frame.tangent.as_dvec3() + u.sin() * frame.bitangent.as_dvec3();
    let cosine = normal.as_dvec3().dot(axis);
    if cosine < -0.999_999_9 {
        -half * axis + v * from * outwards
    } else if cosine > 0.999_999_9 {
        half * axis + v * to * outwards
    } else {
        (2.0 * v - 1.0) * half * axis + (from + (to - from) * v) * outwards
    }
}

#[test]
fn cones_are_met_where_the_distance_says() {
    let mut rng = Rng::new(5);
    let mut seen = Seen::default();
    for i in 0..240 {
        let size = power(&mut rng, -3.0, 3.0);
        let from = rays::vector(&mut rng, 20.0 * size);
        let mut axis = (size * range(&mut rng, 0.1, 1.0) * rays::unit(&mut rng)).as_vec3();
        if i % 5 == 0 {
            axis = Vec3::new(0.0, 0.0, size as f32);
        }
        let mut radii = [0, 1].map(|_| (size * range(&mut rng, 0.02, 1.0)) as f32);
        match i % 4 {
            0 => radii[0] = 0.0,
            1 => radii[1] = 0.0,
            // Nearly a cylinder.
            2 => radii[1] = radii[0].next_up(),
            _ => {}
        }
        let [from_radius, to_radius] = radii;
        let cone = Cone { from, from_radius, to: from + axis, to_radius };
        let scaled = Cone {
            from: SCALE * cone.from,
            from_radius: SCALE * from_radius,
            to: SCALE * cone.to,
            to_radius: SCALE * to_radius,
        };
        let (from, to) = (from.as_dvec3(), cone.to.as_dvec3());
        let (axis, half) = ((to - from).normalize(), 0.5 * to.distance(from));
        let (r, s) = (f64::from(from_radius), f64::from(to_radius));
        let place = |normal: Vec3, uv: Vec2| place_on_frustum(normal, uv, axis, half, r, s);
        let case = Case {
            solid: &cone,
            scaled: &scaled,
            distance: &|p| reference::frustum_distance(p, axis, half, r, s),
            centre: 0.5 * (from + to),
            radius: half.hypot(r.max(s)),
            feature: 1.0,
            place: &place,
        };
        reference::check(&mut rng, &case, 100, &mut seen);
    }
    seen.check(0.8);
}

/// A line parallel to the side meets it once only: the quadratic is linear.
#[test]
fn rays_parallel_to_the_side_end_on_the_base() {
    let cone = Cone::with_tip(Vec3::ZERO, 1.0, Vec3::Y);
    for (origin, direction) in [
        (Vec3::new(0.5, 1.0, 0.0), Vec3::new(-1.0, -1.0, 0.0)),
        (Vec3::new(0.25, 1.0, 0.125), Vec3::new(-0.6, -1.0, 0.8)),
    ] {
        let ray = Ray::new(origin, direction);
        let hits = rays::all_hits(&cone, &ray);
        assert_eq!(hits.len(), 2, "{hits:?}");
        let p = ray.at(hits[0].t);
        assert!((p.x.hypot(p.z) - (1.0 - p.y)).abs() < 1e-6, "{p}");
        assert_eq!(ray.at(hits[1].t).y, 0.0);
        assert_eq!(hits[1].normal, Vec3::NEG_Y);
    }
}

#[test]
fn rays_through_the_tip_meet_the_base() {
    let cone = Cone::with_tip(Vec3::ZERO, 1.0, Vec3::Y);
    let hits = rays::all_hits(&cone, &Ray::new(Vec3::new(0.0, 3.0, 0.0), Vec3::NEG_Y));
    assert_eq!(hits.iter().map(|hit| hit.t).collect::<Vec<_>>(), [2.0, 3.0]);
    assert_eq!(hits[0].normal, Vec3::Y);
    assert_eq!(hits[1].normal, Vec3::NEG_Y);
    // Through the other half of the double cone, which is none of it.
    let through = Ray::new(Vec3::new(-0.5, 2.0, 0.0), Vec3::new(0.5, -1.0, 0.0));
    assert_eq!(rays::all_hits(&cone, &through).len(), 2);
    let above = Ray::new(Vec3::new(-5.0, 1.5, 0.0), Vec3::X);
    assert_eq!(cone.nearest(&above), None);
}

#[test]
fn a_cone_with_equal_radii_is_a_cylinder() {
    let mut rng = Rng::new(6);
    let (from, to) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.5, 2.5, 2.0));
    let cone = Cone { from, from_radius: 0.75, to, to_radius: 0.75 };
    let cylinder = Cylinder { from, to, radius: 0.75 };
    assert_eq!(cone.bounds(), cylinder.bounds());
    for _ in 0..10_000 {
        let origin = rays::vector(&mut rng, 5.0);
        let ray = Ray::new(origin, 0.5 * (from + to) - origin + rays::vector(&mut rng, 1.0));
        assert_eq!(rays::all_hits(&cone, &ray), rays::all_hits(&cylinder, &ray));
    }
}
