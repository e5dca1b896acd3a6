//! Shapes and rays that are none hit nothing and break nothing.

use glam::Vec3;
use rayburst_math::{Ray, hash::Rng};
use rayburst_procedural::{
    Cone, Csg, Cuboid, Cylinder, Disk, IntervalList, Line, Quad, Shape, Solid, Sphere, Torus,
};

use crate::rays;

const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

/// Shapes of each kind with a length and a coordinate to spoil.
fn shapes(length: f32, place: f32) -> Vec<Box<dyn Shape>> {
    let at = Vec3::new(0.0, place, 0.0);
    let to = Vec3::new(0.5, 1.0, 0.25);
    vec![
        Box::new(Sphere { centre: at, radius: length }),
        Box::new(Cuboid { lower: at, upper: at + Vec3::new(1.0, length, 1.0) }),
        Box::new(Cylinder { from: at, to, radius: length }),
        Box::new(Cylinder { from: to, to: at, radius: length }),
        Box::new(Cone { from: at, from_radius: length, to, to_radius: length }),
        Box::new(Cone { from: to, from_radius: 1.0, to: at, to_radius: length - 0.1 }),
        Box::new(Torus { centre: at, major: length, minor: 0.25 }),
        Box::new(Torus { centre: at, major: 1.0, minor: length }),
        Box::new(Quad { corner: at, edge_u: length * Vec3::X, edge_v: Vec3::Y }),
        Box::new(Quad {
            corner: at,
            edge_u: Vec3::X,
            edge_v: Vec3::new(0.3, length, 0.0) - 0.3 * Vec3::X,
        }),
        Box::new(Disk::new(at, Vec3::Z, length)),
        Box::new(Disk { centre: at, normal: Vec3::Y, radius: 0.5 * length, inner_radius: 0.1 }),
        Box::new(Disk { centre: at, normal: length * Vec3::Y, radius: 1.0, inner_radius: 0.0 }),
        Box::new(Csg::intersection(
            Sphere { centre: at, radius: length },
            Cuboid { lower: at - 2.0, upper: at + 2.0 },
        )),
        Box::new(Csg::difference(
            Torus { centre: at, major: 1.0, minor: length },
            Sphere { centre: Vec3::X, radius: 0.1 },
        )),
    ]
}

fn some_rays() -> Vec<Ray> {
    let mut rng = Rng::new(30);
    let mut all = Vec::new();
    for _ in 0..200 {
        let origin = rays::vector(&mut rng, 4.0);
        all.push(Ray {
            t_min: f32::NEG_INFINITY,
            ..Ray::new(origin, rays::vector(&mut rng, 1.0) - origin)
        });
    }
    for direction in [Vec3::X, Vec3::NEG_Y, Vec3::Z, f32::MAX * Vec3::Y, 1e-45 * Vec3::X] {
        for origin in [Vec3::ZERO, 0.25 * Vec3::ONE, Vec3::splat(-3e38)] {
            all.push(Ray { t_min: f32::NEG_INFINITY, ..Ray::new(origin, direction) });
        }
    }
    all
}

#[test]
fn good_shapes_are_hit() {
    for (i, shape) in shapes(0.5, 0.0).iter().enumerate() {
        let hits: usize = some_rays().iter().map(|ray| rays::all_hits(shape, ray).len()).sum();
        assert!(hits > 5, "shape {i}");
        assert!(!shape.bounds().is_empty());
    }
}

#[test]
fn degenerate_shapes_are_empty() {
    let lengths = [0.0, -0.0].into_iter().chain(BAD).map(|length| (length, 0.0));
    let places = BAD.map(|place| (0.5, place));
    for (length, place) in lengths.chain(places) {
        for (i, shape) in shapes(length, place).iter().enumerate() {
            for ray in some_rays() {
                let hits = rays::all_hits(shape, &ray);
                assert_eq!(hits, [], "shape {i} of {length} at {place}: {ray:?}");
            }
            assert!(shape.bounds().is_empty(), "shape {i} of {length} at {place}");
        }
    }
    // Negative lengths are none, except those of a quad's edge and a disk's normal.
    for (i, shape) in shapes(-0.5, 0.0).iter().enumerate() {
        let hits: usize = some_rays().iter().map(|ray| rays::all_hits(shape, ray).len()).sum();
        assert_eq!(hits > 0, [8, 9, 12].contains(&i), "shape {i}");
    }
}

#[test]
fn invalid_rays_hit_nothing() {
    for shape in shapes(0.5, 0.0) {
        for good in some_rays() {
            let bad = [
                Ray { origin: Vec3::new(f32::NAN, 0.0, 0.0), ..good },
                Ray { origin: Vec3::new(0.0, f32::INFINITY, 0.0), ..good },
                Ray { direction: Vec3::ZERO, ..good },
                Ray { direction: Vec3::new(0.0, 0.0, f32::NAN), ..good },
                Ray { direction: Vec3::new(f32::INFINITY, 0.0, 0.0), ..good },
                Ray { t_min: f32::NAN, ..good },
                Ray { t_max: f32::NAN, ..good },
                Ray { t_min: 1.0, t_max: -1.0, ..good },
            ];
            assert!(bad.iter().all(|ray| shape.nearest(ray).is_none()));
        }
    }
}

/// The largest and smallest numbers must not break anything, and where numbers suffice hits are hits.
#[test]
fn extreme_sizes_do_no_harm() {
    let mut rng = Rng::new(31);
    for size in [f32::MAX, 1e38, 1e30, 1e-30, 1e-38, 1e-45] {
        for shape in shapes(size, 0.0).into_iter().chain(shapes(size, size)) {
            for _ in 0..200 {
                let origin = (rays::in_ball(&mut rng) * f64::from(size)).as_vec3();
                let direction = (rays::unit(&mut rng) * f64::from(size)).as_vec3();
                let ray = Ray { t_min: f32::NEG_INFINITY, ..Ray::new(origin, direction) };
                let hits = rays::all_hits(&shape, &ray);
                assert!(hits.is_sorted_by(|a, b| a.t <= b.t));
                assert!(hits.iter().all(|hit| hit.t.is_finite() && hit.normal.is_normalized()));
            }
        }
        let sphere = Sphere { centre: Vec3::ZERO, radius: size };
        let hit = sphere.nearest(&Ray::new(Vec3::new(-size, 0.0, 0.0), size * Vec3::X));
        assert_eq!(hit.map(|hit| hit.t), Some(0.0));
        let torus = Torus { centre: Vec3::ZERO, major: 1.0, minor: size.min(1e30) };
        assert!(torus.nearest(&Ray::new(Vec3::new(1.0, 0.0, 0.0), Vec3::Y)).is_some());
    }
}

#[test]
fn lists_are_emptied_by_misses() {
    let hit = Line::of(&Ray::new(Vec3::new(0.25, -3.0, 0.25), Vec3::Y)).expect("a valid ray");
    let miss = Line::of(&Ray::new(Vec3::new(9.0, 9.0, 9.0), Vec3::Y)).expect("a valid ray");
    let sphere = Sphere { centre: Vec3::ZERO, radius: 1.0 };
    let cuboid = Cuboid { lower: Vec3::NEG_ONE, upper: Vec3::ONE };
    let torus = Torus { centre: Vec3::ZERO, major: 0.4, minor: 0.3 };
    let cylinder = Cylinder { from: Vec3::ZERO, to: Vec3::Y, radius: 1.0 };
    let cone = Cone::with_tip(Vec3::ZERO, 1.0, Vec3::Y);
    let csg = Csg::union(sphere, cuboid);
    let solids: [&dyn Solid; 6] = [&sphere, &cuboid, &torus, &cylinder, &cone, &csg];
    let mut list = IntervalList::new();
    for solid in solids {
        for _ in 0..2 {
            solid.intervals(&hit, &mut list);
            assert_eq!(list.as_slice().len(), 1);
        }
        solid.intervals(&miss, &mut list);
        assert!(list.as_slice().is_empty());
    }
}
