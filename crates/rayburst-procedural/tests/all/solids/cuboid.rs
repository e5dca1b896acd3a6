use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Ray, hash::Rng};
use rayburst_procedural::{Cuboid, Shape};

use super::reference::{self, Case, SCALE, Seen};
use crate::rays::{self, power, range};

#[test]
fn cuboids_are_met_where_the_distance_says() {
    let mut rng = Rng::new(2);
    let mut seen = Seen::default();
    for _ in 0..200 {
        let size = power(&mut rng, -3.0, 3.0);
        let lower = rays::vector(&mut rng, 20.0 * size);
        let extent = DVec3::from_array(std::array::from_fn(|_| size * range(&mut rng, 0.02, 1.0)));
        let cuboid = Cuboid { lower, upper: lower + extent.as_vec3() };
        let scaled = Cuboid { lower: SCALE * cuboid.lower, upper: SCALE * cuboid.upper };
        let (lower, upper) = (cuboid.lower.as_dvec3(), cuboid.upper.as_dvec3());
        let (centre, half) = (0.5 * (lower + upper), 0.5 * (upper - lower));
        let place = |normal: Vec3, uv: Vec2| {
            let (u, v) = (2.0 * f64::from(uv.x) - 1.0, 2.0 * f64::from(uv.y) - 1.0);
            let face = normal.as_dvec3().element_sum();
            half * match normal.abs().to_array() {
                [1.0, 0.0, 0.0] => DVec3::new(face, u, v),
                [0.0, 1.0, 0.0] => DVec3::new(v, face, u),
                [0.0, 0.0, 1.0] => DVec3::new(u, v, face),
                _ => panic!("no normal of a cuboid: {normal}"),
            }
        };
        let case = Case {
            solid: &cuboid,
            scaled: &scaled,
            distance: &|p| reference::box_distance(p, half),
            centre,
            radius: half.length(),
            feature: 1.0,
            place: &place,
        };
        reference::check(&mut rng, &case, 100, &mut seen);
    }
    seen.check(1.0);
}

#[test]
fn rays_along_faces_and_edges_are_inside() {
    let cuboid = Cuboid { lower: Vec3::ZERO, upper: Vec3::ONE };
    for origin in [Vec3::new(-1.0, 0.0, 0.5), Vec3::new(-1.0, 1.0, 0.0)] {
        let hits = rays::all_hits(&cuboid, &Ray::new(origin, Vec3::X));
        assert_eq!(hits.iter().map(|hit| hit.t).collect::<Vec<_>>(), [1.0, 2.0]);
        assert_eq!(hits[0].normal, Vec3::NEG_X);
        assert_eq!(hits[1].normal, Vec3::X);
    }
    assert_eq!(cuboid.nearest(&Ray::new(Vec3::new(-1.0, 1.0f32.next_up(), 0.5), Vec3::X)), None);
}
