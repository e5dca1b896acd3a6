//! Constructive solid geometry against membership of points, and volumes against formulas.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayburst_math::{Ray, hash::Rng};
use rayburst_procedural::{
    Cone, Csg, Cuboid, Cylinder, Interval, IntervalList, Line, Operation, Shape, Solid, Sphere,
    Torus, csg,
};

use crate::rays::{self, KINDS, range};
use crate::solids::reference::{SCALE, box_distance, frustum_distance, torus_distance};

type BoxedDistance = Box<dyn Fn(DVec3) -> f64>;

/// A random solid about as large as the unit ball, the same scaled, and its signed distance.
fn random_solid(rng: &mut Rng) -> (Box<dyn Solid>, Box<dyn Solid>, BoxedDistance) {
    let centre = rays::vector(rng, 0.8);
    let (a, b) = (rng.range(0.2, 1.0), rng.range(0.1, 0.6));
    match rng.below(5) {
        0 => {
            let make = |k: f32| Box::new(Sphere { centre: k * centre, radius: k * a });
            let distance = move |p: DVec3| p.distance(centre.as_dvec3()) - f64::from(a);
            (make(1.0), make(SCALE), Box::new(distance))
        }
        1 => {
            let (lower, upper) = (centre - Vec3::new(a, b, 0.5), centre + Vec3::new(a, b, 0.5));
            let make = |k: f32| Box::new(Cuboid { lower: k * lower, upper: k * upper });
            let (middle, half) = (
                0.5 * (lower.as_dvec3() + upper.as_dvec3()),
                0.5 * (upper.as_dvec3() - lower.as_dvec3()),
            );
            (make(1.0), make(SCALE), Box::new(move |p| box_distance(p - middle, half)))
        }
        2 => {
            let make = |k: f32| Box::new(Torus { centre: k * centre, major: k * a, minor: k * b });
            let (c, a, b) = (centre.as_dvec3(), f64::from(a), f64::from(b));
            (make(1.0), make(SCALE), Box::new(move |p| torus_distance(p - c, a, b)))
        }
        kind => {
            let to = centre + (range(rng, 0.3, 1.5) * rays::unit(rng)).as_vec3();
            let (solid, scaled): (Box<dyn Solid>, Box<dyn Solid>) = if kind == 3 {
                let make =
                    |k: f32| Box::new(Cylinder { from: k * centre, to: k * to, radius: k * b });
                (make(1.0), make(SCALE))
            } else {
                let make = |k: f32| {
                    Box::new(Cone {
                        from: k * centre,
                        from_radius: k * b,
                        to: k * to,
                        to_radius: 0.0,
                    })
                };
                (make(1.0), make(SCALE))
            };
            let (from, to) = (centre.as_dvec3(), to.as_dvec3());
            let (axis, half) = ((to - from).normalize(), 0.5 * to.distance(from));
            let (r, s) = (f64::from(b), if kind == 3 { f64::from(b) } else { 0.0 });
            let middle = 0.5 * (from + to);
            let distance = move |p| frustum_distance(p - middle, axis, half, r, s);
            (solid, scaled, Box::new(distance))
        }
    }
}

const OPERATIONS: [Operation; 3] =
    [Operation::Union, Operation::Intersection, Operation::Difference];

fn combined(operation: Operation, a: bool, b: bool) -> bool {
    match operation {
        Operation::Union => a | b,
        Operation::Intersection => a & b,
        Operation::Difference => a & !b,
    }
}

/// A solid of three, its scaled twin, and whether a point is in it by what it is in.
struct Made {
    solid: Box<dyn Solid>,
    scaled: Box<dyn Solid>,
    parts: [BoxedDistance; 3],
    operations: [Operation; 2],
    /// Whether the first operation's result is the second operand of the second.
    swapped: bool,
}

impl Made {
    fn new(rng: &mut Rng) -> Self {
        let [a, b, c] = [0; 3].map(|_| random_solid(rng));
        let operations = [0; 2].map(|_| OPERATIONS[rng.below(3) as usize]);
        let swapped = rng.below(2) == 0;
        let make = |a, b, c| -> Box<dyn Solid> {
            let first = Csg::new(operations[0], a, b);
            if swapped {
                Box::new(Csg::new(operations[1], c, Arc::new(first)))
            } else {
                Box::new(Csg::new(operations[1], first, c))
            }
        };
        Self {
            solid: make(a.0, b.0, c.0),
            scaled: make(a.1, b.1, c.1),
            parts: [a.2, b.2, c.2],
            operations,
            swapped,
        }
    }

    fn holds(&self, p: DVec3) -> bool {
        let [a, b, c] = [0, 1, 2].map(|i| self.parts[i](p) < 0.0);
        let first = combined(self.operations[0], a, b);
        if self.swapped {
            combined(self.operations[1], c, first)
        } else {
            combined(self.operations[1], first, c)
        }
    }

    /// Distance to the nearest surface of a part, if not of the result.
    fn nearest_surface(&self, p: DVec3) -> f64 {
        self.parts.iter().map(|part| part(p).abs()).fold(f64::INFINITY, f64::min)
    }
}

/// Intervals along a ray's line.
fn intervals(solid: &dyn Solid, ray: &Ray) -> Vec<Interval> {
    let mut list = IntervalList::new();
    solid.intervals(&Line::of(ray).expect("a valid ray"), &mut list);
    list.as_slice().to_vec()
}

#[test]
fn points_are_inside_as_their_memberships_say() {
    const RADIUS: f64 = 2.5;
    let mut rng = Rng::new(40);
    let (mut rays, mut inside_count, mut samples, mut left_out, mut crossings) = (0, 0, 0, 0, 0);
    for _ in 0..900 {
        let made = Made::new(&mut rng);
        for i in 0..120 {
            let kind = KINDS[i % KINDS.len()];
            let part = &*made.parts[rng.below(3) as usize];
            let ray = rays::ray(&mut rng, kind, DVec3::ZERO, RADIUS, part);
            rays += 1;
            let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
            let length = direction.length();
            let found = intervals(&*made.solid, &ray);
            assert!(found.is_sorted_by(|a, b| a.exit.t <= b.entry.t), "{found:?}");
            let rounding = 1e-14 * (origin.length() + RADIUS);

            // Points along the line, all of which lie in the ball around everything.
            let middle = -origin.dot(direction) / length;
            for _ in 0..40 {
                let s = middle + range(&mut rng, -RADIUS, RADIUS);
                let p = origin + s * direction / length;
                samples += 1;
                if made.nearest_surface(p) < 1e-9 + rounding {
                    left_out += 1;
                    continue;
                }
                let t = s / length;
                let inside = found.iter().any(|i| i.entry.t < t && t < i.exit.t);
                assert_eq!(inside, made.holds(p), "{p} {found:?} {ray:?} {:?}", made.operations);
                inside_count += usize::from(inside);
            }

            // Crossings lie on a surface, whose normal they have or, turned around, its opposite.
            for interval in &found {
                for (crossing, entry) in [(&interval.entry, true), (&interval.exit, false)] {
                    crossings += 1;
                    let p = origin + crossing.t * direction;
                    let normal = crossing.normal.as_dvec3();
                    let cosine = normal.dot(direction) / length;
                    let faces = if entry { cosine < 1e-6 } else { cosine > -1e-6 };
                    let slack = 1e-12 + 4.0 * rounding;
                    assert!(made.parts.iter().any(|part| {
                        let gradient = rays::gradient(part, p, 1e-7);
                        let edge = (gradient.length() - 1.0).abs() > 1e-6;
                        let fits = faces && normal.cross(gradient).length() < 1e-6;
                        part(p).abs() < slack && (edge || fits)
                    }));
                }
            }

            let hits = rays::all_hits(&*made.solid, &ray);
            let ends: Vec<f32> =
                found.iter().flat_map(|i| [i.entry.t as f32, i.exit.t as f32]).collect();
            assert_eq!(hits.iter().map(|hit| hit.t).collect::<Vec<_>>(), ends);
            rays::check_numbers(&hits);
            rays::check_bounds(&*made.solid, &ray, &hits);
            rays::check_intervals(&mut rng, &*made.solid, &ray, &hits);
            rays::check_scaled(&*made.solid, &*made.scaled, &ray, SCALE);
        }
    }
    assert!(rays >= 100_000 && inside_count * 60 > samples && crossings * 3 > rays);
    assert!(left_out * 100 < samples, "{left_out} of {samples}");
}

/// The volume of a solid in the unit cube by what parallel rays see of it, one in each of many cells.
fn volume(solid: &dyn Solid, seed: u64) -> f64 {
    const CELLS: u32 = 700;
    let mut rng = Rng::new(seed);
    let frame = rayburst_math::Frame::from_normal(rays::unit(&mut rng).as_vec3());
    let bounds = solid.bounds();
    let (centre, side) = (bounds.centre(), bounds.diagonal());
    let mut sum = 0.0;
    for x in 0..CELLS {
        for y in 0..CELLS {
            let place = |i: u32, part: f32| side * ((i as f32 + part) / CELLS as f32 - 0.5);
            let origin = centre
                + place(x, rng.f32()) * frame.tangent
                + place(y, rng.f32()) * frame.bitangent;
            let ray = Ray::new(origin, frame.normal);
            sum += intervals(solid, &ray).iter().map(|i| i.exit.t - i.entry.t).sum::<f64>();
        }
    }
    sum * (f64::from(side) / f64::from(CELLS)).powi(2)
}

fn check_volume(name: &str, solid: &dyn Solid, expected: f64) {
    for seed in 50..53 {
        let found = volume(solid, seed);
        let error = (found / expected - 1.0).abs();
        assert!(error < 2e-4, "{name}: {found}, not {expected}: off by {error:e}");
    }
}

#[test]
fn volumes_of_simple_solids_are_those_of_formulas() {
    let at = Vec3::new(1.0, -2.0, 0.5);
    check_volume("sphere", &Sphere { centre: at, radius: 1.5 }, 4.5 * PI);
    check_volume("cuboid", &Cuboid { lower: at, upper: at + Vec3::new(1.0, 2.0, 0.5) }, 1.0);
    let to = at + Vec3::new(2.0, 3.0, 6.0);
    check_volume("cylinder", &Cylinder { from: at, to, radius: 1.5 }, 15.75 * PI);
    let cone = Cone { from: at, from_radius: 1.0, to, to_radius: 2.0 };
    check_volume("cone", &cone, 7.0 * PI * 7.0 / 3.0);
    check_volume("torus", &Torus { centre: at, major: 2.0, minor: 0.5 }, PI * PI);
}

#[test]
fn volumes_of_made_solids_are_those_of_formulas() {
    let sphere = |x: f32| Sphere { centre: Vec3::new(x, 0.0, 0.0), radius: 1.0 };
    // Two unit spheres one apart share a lens.
    let (ball, lens) = (4.0 * PI / 3.0, 5.0 * PI / 12.0);
    check_volume("lens", &Csg::intersection(sphere(0.0), sphere(1.0)), lens);
    check_volume("pair", &Csg::union(sphere(0.0), sphere(1.0)), 2.0 * ball - lens);
    check_volume("bitten", &Csg::difference(sphere(0.0), sphere(1.0)), ball - lens);
    // A sphere with a hole along its axis: what is left depends on the hole's length only.
    let drill = Cylinder { from: Vec3::new(0.0, -2.0, 0.0), to: 2.0 * Vec3::Y, radius: 0.6 };
    let ring = 4.0 * PI / 3.0 * 0.8f64.powi(3);
    check_volume("ring", &Csg::difference(sphere(0.0), drill), ring);
    check_volume("plug", &Csg::intersection(sphere(0.0), drill), ball - ring);
    // Steinmetz: two cylinders, and three.
    let pipe = |axis: Vec3| Cylinder { from: -2.0 * axis, to: 2.0 * axis, radius: 1.0 };
    let two = Csg::intersection(pipe(Vec3::X), pipe(Vec3::Y));
    check_volume("two pipes", &two, 16.0 / 3.0);
    let three = Csg::intersection(two, pipe(Vec3::Z));
    check_volume("three pipes", &three, 8.0 * (2.0 - 2.0f64.sqrt()));
}

#[test]
fn surfaces_in_one_place_are_one() {
    let cube =
        |x: f32| Cuboid { lower: Vec3::new(x, 0.0, 0.0), upper: Vec3::new(x + 1.0, 1.0, 1.0) };
    let mut rng = Rng::new(41);
    for _ in 0..20_000 {
        let target = Vec3::new(1.0, rng.range(0.1, 0.9), rng.range(0.1, 0.9));
        let origin = Vec3::new(-rng.range(1.0, 100.0), rng.range(-2.0, 3.0), rng.range(-2.0, 3.0));
        let ray = Ray::new(origin, rng.range(0.1, 3.0) * (target - origin));
        // Neighbours have nothing between them, and nothing in common.
        let joined = intervals(&Csg::union(cube(0.0), cube(1.0)), &ray);
        assert_eq!(joined.len(), 1, "{joined:?}");
        assert_eq!(intervals(&Csg::intersection(cube(0.0), cube(1.0)), &ray), []);
        // A solid less itself is nothing; less a neighbour it is itself.
        assert_eq!(intervals(&Csg::difference(cube(0.0), cube(0.0)), &ray), []);
        let less = Csg::difference(cube(0.0), cube(1.0));
        assert_eq!(intervals(&less, &ray), intervals(&cube(0.0), &ray));
        // Ends of different shapes in the same plane: a plug flush with both faces.
        let plug =
            Cylinder { from: Vec3::new(0.0, 0.5, 0.5), to: Vec3::new(1.0, 0.5, 0.5), radius: 4.0 };
        let none = intervals(&Csg::difference(cube(0.0), plug), &ray);
        assert!(none.is_empty(), "{none:?} {ray:?}");
        let both = intervals(&Csg::intersection(cube(0.0), plug), &ray);
        assert_eq!(both.len(), 1);
    }
}

#[test]
fn normals_are_turned_where_a_solid_is_taken_away() {
    let outer = Sphere { centre: Vec3::ZERO, radius: 2.0 };
    let shell = Csg::difference(outer, Sphere { centre: Vec3::ZERO, radius: 1.0 });
    let hits = rays::all_hits(&shell, &Ray::new(Vec3::new(-5.0, 0.0, 0.0), Vec3::X));
    let seen: Vec<(f32, f32)> = hits.iter().map(|hit| (hit.t, hit.normal.x)).collect();
    assert_eq!(seen, [(3.0, -1.0), (4.0, 1.0), (6.0, -1.0), (7.0, 1.0)]);
    assert_eq!(shell.bounds(), outer.bounds());
    let apart = Csg::intersection(outer, Sphere { centre: 9.0 * Vec3::X, radius: 1.0 });
    assert!(apart.bounds().is_empty());
}

#[test]
fn many_solids_lose_no_interval() {
    let ball = |i: i32| Sphere { centre: Vec3::new(i as f32, 0.0, 0.0), radius: 0.25 };
    let ray = Ray::new(Vec3::new(-2.0, 0.1, 0.0), Vec3::X);
    for count in [1, 2, 7, 8, 9, 16, 17, 100, 1000] {
        let balls = || (0..count).map(|i| Box::new(ball(i)) as Box<dyn Solid>).collect();
        let row = csg::union_of(balls()).expect("some");
        assert_eq!(rays::all_hits(&row, &ray).len(), 2 * count as usize);
        // Nested one in the other, and with all but a few taken away again.
        if count <= 100 {
            let bar = Cuboid { lower: Vec3::splat(-1.0), upper: Vec3::new(1e4, 1.0, 1.0) };
            let holes = Csg::difference(bar, row);
            assert_eq!(rays::all_hits(&holes, &ray).len(), 2 * count as usize + 2);
            let nested = (0..count).fold(Box::new(bar) as Box<dyn Solid>, |solid, i| {
                Box::new(Csg::difference(solid, ball(i)))
            });
            assert_eq!(rays::all_hits(&nested, &ray), rays::all_hits(&holes, &ray));
        }
    }
    assert!(csg::union_of(Vec::new()).is_none());
    let overlapping: Vec<Box<dyn Solid>> = (0..5)
        .map(|i| Box::new(Sphere { centre: 0.1 * i as f32 * Vec3::X, radius: 1.0 }) as _)
        .collect();
    let core = csg::intersection_of(overlapping).expect("some");
    let hits = rays::all_hits(&core, &Ray::new(-5.0 * Vec3::X, Vec3::X));
    assert_eq!(hits.len(), 2);
    assert!((hits[0].t - 4.4).abs() < 1e-6 && (hits[1].t - 6.0).abs() < 1e-6, "{hits:?}");
}
