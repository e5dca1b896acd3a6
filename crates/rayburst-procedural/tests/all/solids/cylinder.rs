use glam::{Vec2, Vec3};
use rayburst_math::{Ray, hash::Rng};
use rayburst_procedural::{Cylinder, Shape};

use super::cone::place_on_frustum;
use super::reference::{self, Case, SCALE, Seen};
use crate::rays::{self, power, range};

#[test]
fn cylinders_are_met_where_the_distance_says() {
    let mut rng = Rng::new(3);
    let mut seen = Seen::default();
    for i in 0..200 {
        let size = power(&mut rng, -3.0, 3.0);
        let from = rays::vector(&mut rng, 20.0 * size);
        let mut axis = rays::vector(&mut rng, size);
        if i % 4 == 0 {
            axis = Vec3::new(0.0, size as f32, 0.0);
        }
        let radius = (size * range(&mut rng, 0.02, 1.0)) as f32;
        let cylinder = Cylinder { from, to: from + axis, radius };
        let scaled =
            Cylinder { from: SCALE * from, to: SCALE * cylinder.to, radius: SCALE * radius };
        let (from, to) = (from.as_dvec3(), cylinder.to.as_dvec3());
        let (axis, half) = ((to - from).normalize(), 0.5 * to.distance(from));
        let radius = f64::from(radius);
        let place =
            |normal: Vec3, uv: Vec2| place_on_frustum(normal, uv, axis, half, radius, radius);
        let case = Case {
            solid: &cylinder,
            scaled: &scaled,
            distance: &|p| reference::frustum_distance(p, axis, half, radius, radius),
            centre: 0.5 * (from + to),
            radius: half.hypot(radius),
            feature: 1.0,
            place: &place,
        };
        reference::check(&mut rng, &case, 100, &mut seen);
    }
    seen.check(1.0);
}

/// The direction of the axis, computed with rounding, is neither along nor quite across.
#[test]
fn rays_along_the_axis_go_from_end_to_end() {
    let mut rng = Rng::new(4);
    for _ in 0..10_000 {
        let (from, axis) = (rays::vector(&mut rng, 3.0), rays::vector(&mut rng, 2.0));
        let cylinder = Cylinder { from, to: from + axis, radius: 0.5 };
        let direction = cylinder.to - cylinder.from;
        let across = direction.normalize().any_orthonormal_vector();
        let offset = across * rng.range(0.0, 0.49);
        let ray = Ray::new(from + offset - 2.0 * direction, direction);
        let hits = rays::all_hits(&cylinder, &ray);
        assert_eq!(hits.len(), 2, "{cylinder:?} {ray:?}");
        let rounding = 2e-6 * (1.0 + 1.0 / direction.length());
        assert!((hits[0].t - 2.0).abs() < rounding && (hits[1].t - 3.0).abs() < rounding);
        assert!(hits[1].normal.dot(direction.normalize()) > 0.999_999);
        let outside = Ray::new(from + 0.51 * across, direction);
        assert_eq!(cylinder.nearest(&outside), None);
    }
}
