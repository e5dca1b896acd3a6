//! Quads and disks against the plane equation in double precision.

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Frame, Ray, hash::Rng};
use rayburst_procedural::{Disk, Quad, Shape};

use crate::rays::{self, KINDS, power, range};
use crate::solids::reference::SCALE;

/// How near to an edge, in parts of the sheet, rays may go either way.
const BAND: f64 = 1e-9;
/// Largest error of `t` across the sheet, in parts of the distance of the origin and the size.
const DISTANCE_ERROR: f64 = 4e-15;

/// A sheet and what is known of it independently.
struct Case<'a> {
    sheet: &'a dyn Shape,
    scaled: &'a dyn Shape,
    centre: DVec3,
    radius: f64,
    normal: DVec3,
    /// How far a place in the plane, relative to the centre, is within the edges, in parts of the
    /// sheet; negative outside.
    within: &'a dyn Fn(DVec3) -> f64,
    /// The place of coordinates.
    place: &'a dyn Fn(Vec2) -> DVec3,
}

#[derive(Debug, Default)]
struct Seen {
    rays: usize,
    hits: usize,
    left_out: usize,
    error: f64,
}

fn check(rng: &mut Rng, case: &Case, rounds: usize, seen: &mut Seen) {
    // The distance of a thin plate, to aim at the sheet's plane and along it.
    let distance = |p: DVec3| p.dot(case.normal).abs() - 1e-3 * case.radius;
    for _ in 0..rounds {
        for kind in KINDS {
            let ray = rays::ray(rng, kind, case.centre, case.radius, &distance);
            check_ray(rng, case, &ray, seen);
        }
    }
}

fn check_ray(rng: &mut Rng, case: &Case, ray: &Ray, seen: &mut Seen) {
    seen.rays += 1;
    let from_centre = ray.origin.as_dvec3() - case.centre;
    let direction = ray.direction.as_dvec3();
    let cosine = case.normal.dot(direction.normalize());
    let t = -case.normal.dot(from_centre) / case.normal.dot(direction);
    let p = from_centre + t * direction;
    let within = (case.within)(p);
    let rounding = 1e-14 * (from_centre.length() + case.radius) / cosine.abs();
    let band = BAND + rounding / case.radius;
    let hits = rays::all_hits(case.sheet, ray);
    if within.abs() < band || cosine.abs() < 1e-12 {
        seen.left_out += 1;
    } else {
        assert_eq!(hits.len(), usize::from(within > 0.0), "{within} {ray:?}");
    }
    for hit in &hits {
        seen.hits += 1;
        let error = (f64::from(hit.t) - t).abs() - 2.0f64.powi(-24) * t.abs();
        let error = error * direction.length() * cosine.abs();
        let error = error / (from_centre.length() + case.radius);
        assert!(error < DISTANCE_ERROR, "{error}: {hit:?}, not {t} {ray:?}");
        seen.error = seen.error.max(error);
        assert!(hit.normal.as_dvec3().distance(case.normal) < 3e-7);
        let place = (case.place)(hit.uv);
        assert!(place.distance(p) < 1e-5 * case.radius + rounding, "{place}, not {p}: {hit:?}");
        assert_eq!(hit.is_front(ray), hit.normal.dot(ray.direction) < 0.0);
    }
    rays::check_numbers(&hits);
    rays::check_bounds(case.sheet, ray, &hits);
    rays::check_intervals(rng, case.sheet, ray, &hits);
    rays::check_scaled(case.sheet, case.scaled, ray, SCALE);
}

impl Seen {
    fn check(&self) {
        assert!(self.rays >= 100_000, "{self:?}");
        assert!(self.hits * 5 > self.rays, "{self:?}");
        assert!(self.left_out * 10 < self.rays, "{self:?}");
    }
}

#[test]
fn quads_are_met_where_the_plane_says() {
    let mut rng = Rng::new(20);
    let mut seen = Seen::default();
    for i in 0..200 {
        let size = power(&mut rng, -3.0, 3.0);
        let corner = rays::vector(&mut rng, 20.0 * size);
        let edge_u = rays::vector(&mut rng, size);
        let mut edge_v = rays::vector(&mut rng, size);
        if i % 2 == 0 {
            edge_v = range(&mut rng, 0.1, 2.0) as f32 * edge_u.any_orthogonal_vector();
        }
        let quad = Quad { corner, edge_u, edge_v };
        let scaled =
            Quad { corner: SCALE * corner, edge_u: SCALE * edge_u, edge_v: SCALE * edge_v };
        let (u, v) = (edge_u.as_dvec3(), edge_v.as_dvec3());
        let normal = u.cross(v).normalize();
        // Heights over the edges.
        let (over_u, over_v) = (normal.cross(u).normalize(), v.cross(normal).normalize());
        let (height_u, height_v) = (0.5 * v.dot(over_u), 0.5 * u.dot(over_v));
        let radius = 0.5 * (u + v).length().max((u - v).length());
        let within = |p: DVec3| {
            let (a, b) = (height_u - p.dot(over_u).abs(), height_v - p.dot(over_v).abs());
            a.min(b) / radius
        };
        let place = |uv: Vec2| (f64::from(uv.x) - 0.5) * u + (f64::from(uv.y) - 0.5) * v;
        let case = Case {
            sheet: &quad,
            scaled: &scaled,
            centre: corner.as_dvec3() + 0.5 * (u + v),
            radius,
            normal,
            within: &within,
            place: &place,
        };
        check(&mut rng, &case, 100, &mut seen);
    }
    seen.check();
}

#[test]
fn disks_are_met_where_the_plane_says() {
    let mut rng = Rng::new(21);
    let mut seen = Seen::default();
    for i in 0..200 {
        let size = power(&mut rng, -3.0, 3.0);
        let (centre, normal) = (rays::vector(&mut rng, 20.0 * size), rays::vector(&mut rng, 1.0));
        let normal = if i % 4 == 0 { 3.0 * Vec3::Y } else { normal };
        let radius = size as f32;
        let inner_radius = if i % 2 == 0 { 0.0 } else { radius * rng.range(0.01, 0.99) };
        let disk = Disk { centre, normal, radius, inner_radius };
        let scaled = Disk {
            centre: SCALE * centre,
            normal,
            radius: SCALE * radius,
            inner_radius: SCALE * inner_radius,
        };
        let unit = normal.as_dvec3().normalize();
        let (inner, outer) = (f64::from(inner_radius), f64::from(radius));
        let within = |p: DVec3| {
            let hole = if inner > 0.0 { p.length() - inner } else { f64::INFINITY };
            (outer - p.length()).min(hole) / outer
        };
        let frame = Frame::from_normal(unit.as_vec3());
        let place = |uv: Vec2| {
            let (sin, cos) = (f64::from(uv.x) * std::f64::consts::TAU).sin_cos();
            (inner + f64::from(uv.y) * (outer - inner))
                * (cos * frame.tangent.as_dvec3() + sin * frame.bitangent.as_dvec3())
        };
        let case = Case {
            sheet: &disk,
            scaled: &scaled,
            centre: centre.as_dvec3(),
            radius: outer,
            normal: unit,
            within: &within,
            place: &place,
        };
        check(&mut rng, &case, 100, &mut seen);
    }
    seen.check();
}

#[test]
fn edges_belong_to_sheets_and_planes_are_missed() {
    let quad = Quad { corner: Vec3::ZERO, edge_u: Vec3::X, edge_v: Vec3::Y };
    let disk = Disk { centre: Vec3::ZERO, normal: Vec3::Z, radius: 1.0, inner_radius: 0.5 };
    let down = |x, y| Ray::new(Vec3::new(x, y, 2.0), Vec3::NEG_Z);
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.25, 1.0)] {
        assert_eq!(quad.nearest(&down(x, y)).map(|hit| hit.t), Some(2.0));
    }
    assert_eq!(quad.nearest(&down(1.0f32.next_up(), 0.5)), None);
    for (x, hit) in [(0.5f32, true), (1.0, true), (0.5f32.next_down(), false), (0.0, false)] {
        assert_eq!(disk.nearest(&down(x, 0.0)).is_some(), hit);
    }
    assert!(Disk::new(Vec3::ZERO, Vec3::Z, 1.0).nearest(&down(0.0, 0.0)).is_some());
    let along = Ray::new(Vec3::new(-3.0, 0.75, 0.0), Vec3::X);
    assert_eq!((quad.nearest(&along), disk.nearest(&along)), (None, None));
    // The front is where the edges turn anticlockwise, and where the normal points.
    let front = [&quad as &dyn Shape, &disk].map(|s| s.nearest(&down(0.6, 0.6)));
    assert!(front.iter().flatten().all(|hit| hit.is_front(&down(0.6, 0.6))));
    assert!(front.iter().all(Option::is_some));
}
