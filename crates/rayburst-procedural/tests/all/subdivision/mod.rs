//! Subdivision surfaces against tessellations by plain subdivision, and against what is known of them.

mod plain;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::Ray;
use rayburst_math::hash::Rng;
use rayburst_procedural::{CageError, Shape, Subdivision};

use crate::check::{Tolerance, all_hits, check_strange_rays, compare};
use crate::random_rays::Rays;
use plain::{Polygons, Tessellation};

fn surface(cage: &Polygons, depth: u32) -> Subdivision {
    let (points, sizes, indices) = cage.parts();
    Subdivision::new(&points, &sizes, &indices, depth).unwrap()
}

fn cube() -> Polygons {
    let points: Vec<Vec3> = (0..8)
        .map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0)
        .collect();
    let faces: [&[usize]; 6] =
        [&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]];
    Polygons::new(&points, &faces)
}

/// A prism on a polygon of `n` corners, one end with a pyramid of triangles.
fn house(n: usize) -> Polygons {
    let mut points = Vec::new();
    for y in [-1.0, 0.5] {
        for k in 0..n {
            let angle = std::f32::consts::TAU * k as f32 / n as f32;
            let r = if k % 2 == 0 { 1.3 } else { 0.9 };
            points.push(Vec3::new(r * angle.cos(), y, r * angle.sin()));
        }
    }
    points.push(Vec3::new(0.2, 1.6, -0.1));
    let mut faces: Vec<Vec<usize>> = vec![(0..n).collect()];
    for k in 0..n {
        let next = (k + 1) % n;
        faces.push(vec![next, k, n + k, n + next]);
        faces.push(vec![n + next, n + k, 2 * n]);
    }
    let faces: Vec<&[usize]> = faces.iter().map(|f| &f[..]).collect();
    Polygons::new(&points, &faces)
}

/// An open net with heights at random, without the faces for which `hole` holds.
fn net(nx: usize, nz: usize, seed: u64, hole: impl Fn(usize, usize) -> bool) -> Polygons {
    let mut rng = Rng::new(seed);
    let mut points = Vec::new();
    for z in 0..=nz {
        for x in 0..=nx {
            points.push(Vec3::new(x as f32, rng.range(-0.7, 0.7), z as f32));
        }
    }
    let mut faces = Vec::new();
    for z in 0..nz {
        for x in 0..nx {
            let i = z * (nx + 1) + x;
            if !hole(x, z) {
                faces.push(vec![i, i + nx + 1, i + nx + 2, i + 1]);
            }
        }
    }
    let faces: Vec<&[usize]> = faces.iter().map(|f| &f[..]).collect();
    Polygons::new(&points, &faces)
}

fn check(cage: &Polygons, steps: usize, count: usize, seed: u64) {
    let shape = surface(cage, Subdivision::DEPTH);
    let tessellation = Tessellation::new(cage, steps);
    let bounds = shape.bounds();
    let size = f64::from(bounds.diagonal());
    let deviation = tessellation.deviation;
    assert!(deviation < 6e-4 * size, "{deviation}");
    let mut rays = Rays::new(seed, bounds.lower, bounds.upper);
    // Deep below the surface by `deviation` a silhouette of curvature 3 is a cosine of √(6 deviation).
    let band = 2.0 * (6.0 * deviation).sqrt();
    let tolerance = Tolerance { distance: deviation, band, normal: 0.1 };
    let counts =
        compare(&shape, &mut rays, count, tolerance, &mut |o, d| tessellation.line(o, d), &|p| {
            tessellation.distance(p)
        });
    assert!(counts.hits > count / 5 && counts.soft < count / 20, "{counts:?}");
    check_strange_rays(&shape);
}

#[test]
fn closed_surfaces_agree_with_plain_subdivision() {
    check(&cube(), 6, 40_000, 1);
    check(&house(5), 6, 30_000, 2);
    check(&house(7), 6, 30_000, 3);
}

#[test]
fn open_surfaces_agree_with_plain_subdivision() {
    check(&net(4, 3, 4, |_, _| false), 6, 30_000, 4);
    // Inner corners: vertices of three faces on a border.
    check(&net(5, 5, 5, |x, z| (x, z) == (2, 2) || (x > 2 && z > 3)), 6, 30_000, 5);
    check(
        &Polygons::new(&[Vec3::ZERO, Vec3::X, Vec3::new(0.4, 0.3, 1.0)], &[&[0, 1, 2]]),
        6,
        10_000,
        6,
    );
}

/// Plain subdivision knows the limit points of the vertices that it makes to the last digit: rays to
/// them must end there.
#[test]
fn limit_points_are_exact() {
    let holes = |x: usize, z: usize| (x, z) == (2, 2) || (x > 2 && z > 3);
    for cage in [cube(), house(3), house(5), house(9), net(5, 5, 5, holes)] {
        let shape = surface(&cage, Subdivision::DEPTH);
        let mut mesh = cage.clone();
        for _ in 0..5 {
            mesh = mesh.subdivided();
        }
        let limits = mesh.limits();
        let (mut count, mut worst) = (0, 0.0f32);
        for face in &mesh.faces {
            let [a, b, c] = [0, 1, 3].map(|k| limits[face[k]]);
            let normal = (b - a).cross(c - a).normalize();
            let ray = Ray::with_interval(a.as_vec3(), normal.as_vec3(), -1.0, 1.0);
            let nearest = |least: f32, hit: &rayburst_procedural::ShapeHit| least.min(hit.t.abs());
            // On a border a ray may pass by.
            let off = all_hits(&shape, &ray).iter().fold(f32::INFINITY, nearest);
            if off < 0.1 {
                worst = worst.max(off);
                count += 1;
            }
        }
        assert!(worst < 2e-6 && count > mesh.faces.len() * 9 / 10, "{worst} {count}");
    }
}

/// A net over regular places is a bicubic B-spline over the same places.
#[test]
fn regular_nets_are_b_splines() {
    let (nx, nz) = (6, 4);
    let cage = net(nx, nz, 7, |_, _| false);
    let shape = surface(&cage, 1);
    assert_eq!(shape.patch_count(), nx * nz);
    let height = |x: i64, z: i64| {
        // Beyond the border goes on what is before it.
        let line = |x: i64, z: usize| {
            let at = |x: usize| cage.points[z * (nx + 1) + x].y;
            match x {
                -1 => 2.0 * at(0) - at(1),
                x if x == nx as i64 + 1 => 2.0 * at(nx) - at(nx - 1),
                x => at(x as usize),
            }
        };
        match z {
            -1 => 2.0 * line(x, 0) - line(x, 1),
            z if z == nz as i64 + 1 => 2.0 * line(x, nz) - line(x, nz - 1),
            z => line(x, z as usize),
        }
    };
    let weights = |t: f64| {
        [
            (1.0 - t).powi(3) / 6.0,
            (3.0 * t.powi(3) - 6.0 * t * t + 4.0) / 6.0,
            (-3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0) / 6.0,
            t.powi(3) / 6.0,
        ]
    };
    let spline = |x: f64, z: f64| {
        let (i, k) = (x.floor(), z.floor());
        let (u, v) = (weights(x - i), weights(z - k));
        let mut sum = 0.0;
        for b in 0..4 {
            for a in 0..4 {
                sum += u[a] * v[b] * height(i as i64 + a as i64 - 1, k as i64 + b as i64 - 1);
            }
        }
        sum
    };
    let mut rng = Rng::new(8);
    for _ in 0..20_000 {
        let (x, z) = (rng.range(1e-3, nx as f32 - 1e-3), rng.range(1e-3, nz as f32 - 1e-3));
        let ray = Ray::new(Vec3::new(x, 2.0, z), Vec3::NEG_Y);
        let hits = all_hits(&shape, &ray);
        assert_eq!(hits.len(), 1);
        let y = f64::from(2.0 - hits[0].t);
        let (x, z) = (f64::from(x), f64::from(z));
        assert!((y - spline(x, z)).abs() < 1e-6, "{x} {z}: {y} {}", spline(x, z));
        let e = 1e-4;
        let slope = |d: DVec3| {
            (spline(x + e * d.x, z + e * d.z) - spline(x - e * d.x, z - e * d.z)) / (2.0 * e)
        };
        // Differences near whole numbers take in a neighbour, which goes on as smoothly.
        let near = |x: f64| x < e || x + e > 6.0;
        if !near(x) && z > e && z + e < 4.0 {
            let normal = DVec3::new(-slope(DVec3::X), 1.0, -slope(DVec3::Z)).normalize();
            assert!((hits[0].normal.as_dvec3() - normal).length() < 1e-5);
        }
        // The first vertex of a face, then along z, then along x.
        let uv = Vec2::new(z.fract() as f32, x.fract() as f32);
        assert!((hits[0].uv - uv).abs().max_element() < 1e-5, "{:?} {uv}", hits[0].uv);
    }
}

#[test]
fn limit_points_and_normals_at_extraordinary_vertices() {
    // (n² v + 4 Σ e + Σ f) / (n (n + 5)) with n = 3 at a cube's corner.
    let shape = surface(&cube(), Subdivision::DEPTH);
    let corner = Vec3::ONE;
    let edges = Vec3::ONE; // Three neighbours with one coordinate of -1 each.
    let faces = -Vec3::ONE; // Three opposite corners with two.
    let limit = (9.0 * corner + 4.0 * edges + faces) / 24.0;
    let ray = Ray::new(Vec3::splat(3.0), Vec3::NEG_ONE);
    let hit = shape.nearest(&ray).unwrap();
    assert!((ray.at(hit.t) - limit).length() < 1e-6, "{} {limit}", ray.at(hit.t));
    assert!((hit.normal - Vec3::ONE.normalize()).length() < 1e-5);
    // Next to it, where normals are blended, they are near that.
    let ray = Ray::new(Vec3::splat(3.0) + Vec3::new(1e-3, -1e-3, 0.0), Vec3::NEG_ONE);
    assert!((shape.nearest(&ray).unwrap().normal - Vec3::ONE.normalize()).length() < 1e-2);
    // The middle of a face: (16 v + 4 Σ e + Σ f) / 36 after one step.
    let hit = shape.nearest(&Ray::new(Vec3::new(0.0, 5.0, 0.0), Vec3::NEG_Y)).unwrap();
    let expected = 5.0 - (16.0 * 1.0 + 4.0 * 4.0 * 0.75 + 4.0 * 5.0 / 9.0) / 36.0;
    assert!((hit.t - expected).abs() < 1e-6, "{} {expected}", hit.t);
}

/// Limit points and normals are the same however deep the patches around them are.
#[test]
fn limits_do_not_depend_on_the_depth() {
    for n in [3, 5, 6, 7] {
        // Of triangles even wrong weights would give the right plane.
        let mut cage = house(n).subdivided();
        let mut rng = Rng::new(n as u64);
        cage.points.iter_mut().for_each(|p| *p += 0.2 * (rng.vec3() - 0.5).as_dvec3());
        let cage = Polygons {
            points: cage.points.iter().map(|p| p.as_vec3().as_dvec3()).collect(),
            ..cage
        };
        let mut mesh = cage.clone();
        for _ in 0..3 {
            mesh = mesh.subdivided();
        }
        let apex = mesh.limits()[2 * n].as_vec3();
        let ray = Ray::with_interval(apex, Vec3::new(0.1, -1.0, 0.05), -0.5, 0.5);
        let [coarse, fine] = [1, 12].map(|depth| surface(&cage, depth).nearest(&ray).unwrap());
        assert!(coarse.t.abs() < 1e-6 && fine.t.abs() < 1e-6, "{coarse:?} {fine:?}");
        assert!((coarse.normal - fine.normal).length() < 1e-4, "{coarse:?} {fine:?}");
    }
}

#[test]
fn uv_of_subdivided_faces_are_those_of_the_cage() {
    let shape = surface(&cube(), Subdivision::DEPTH);
    let at = |x: f32, z: f32| {
        let ray = Ray::new(Vec3::new(x, 3.0, z), Vec3::NEG_Y);
        shape.nearest(&ray).unwrap().uv
    };
    let mut rng = Rng::new(11);
    for _ in 0..2_000 {
        // The face begins at (-1, 1, -1) and goes along z.
        let (x, z) = (rng.range(-0.4, 0.4), rng.range(-0.4, 0.4));
        let uv = at(x, z);
        assert!((at(x, -z) - Vec2::new(1.0 - uv.x, uv.y)).length() < 1e-4, "{x} {z} {uv}");
        assert!((at(-x, z) - Vec2::new(uv.x, 1.0 - uv.y)).length() < 1e-4, "{x} {z} {uv}");
        assert!((at(z, x) - Vec2::new(uv.y, uv.x)).length() < 1e-4, "{x} {z} {uv}");
        let (along, across) = (at(x, z + 0.05) - uv, at(x + 0.05, z) - uv);
        assert!(along.x > 0.02 && along.x < 0.1 && along.y.abs() < 0.05, "{x} {z} {along}");
        assert!(across.y > 0.02 && across.y < 0.1, "{x} {z} {across}");
    }
}

#[test]
fn nothing_gets_through_closed_surfaces() {
    for (seed, cage) in [cube(), house(3), house(5), house(8)].into_iter().enumerate() {
        let shape = surface(&cage, 5);
        let mut rng = Rng::new(seed as u64);
        for _ in 0..25_000 {
            // From inside, many of them along planes of symmetry, where patches meet.
            let mut grid = |n: f32| (2.0 * rng.vec3() - 1.0) * n;
            let (origin, way) = (grid(0.1), grid(1.0));
            let snap = rng.below(3) > 0;
            let way = if snap { (way * 4.0).round() } else { way };
            let origin = if snap { Vec3::ZERO } else { origin };
            if way == Vec3::ZERO {
                continue;
            }
            let ray = Ray::new(origin, way);
            let hits = all_hits(&shape, &ray);
            assert!(hits.len() % 2 == 1, "{ray:?} {hits:?}");
            for (i, hit) in hits.iter().enumerate() {
                assert_eq!(hit.is_front(&ray), i % 2 == 1, "{ray:?} {hits:?}");
            }
        }
    }
}

#[test]
fn hits_beyond_the_buffer_are_found() {
    // 90 sheets, one over another.
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for k in 0..90 {
        for [x, z] in [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]] {
            faces.push(points.len());
            points.push(Vec3::new(x, 0.01 * k as f32, z));
        }
    }
    let faces: Vec<&[usize]> = faces.chunks(4).collect();
    let shape = surface(&Polygons::new(&points, &faces), 1);
    for way in [Vec3::Y, Vec3::NEG_Y] {
        let ray = Ray::new(Vec3::new(0.3, 0.4, 0.6) - 2.0 * way, way);
        let hits = all_hits(&shape, &ray);
        assert_eq!(hits.len(), 90);
        assert!(hits.windows(2).all(|w| w[0].t < w[1].t));
        assert_eq!(shape.nearest(&ray), Some(hits[0]));
    }
}

#[test]
fn broken_cages_are_named() {
    let points = [Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y, Vec3::Z, Vec3::NEG_X];
    let make = |sizes: &[u32], indices: &[u32]| Subdivision::new(&points, sizes, indices, 3).err();
    assert_eq!(make(&[], &[]), Some(CageError::Empty));
    assert_eq!(make(&[4], &[0, 1, 2]), Some(CageError::Count { expected: 4, found: 3 }));
    assert_eq!(make(&[2], &[0, 1]), Some(CageError::TooSmall(0)));
    assert_eq!(make(&[3], &[0, 1, 9]), Some(CageError::Vertex { face: 0, vertex: 9 }));
    assert_eq!(make(&[4], &[0, 1, 2, 1]), Some(CageError::Repeated { face: 0, vertex: 1 }));
    // Two that wind in opposite senses, then three on an edge.
    assert_eq!(make(&[3, 3], &[0, 1, 2, 0, 1, 3]), Some(CageError::Edge { from: 0, to: 1 }));
    let three = [0, 1, 2, 1, 0, 3, 0, 1, 4];
    assert_eq!(make(&[3, 3, 3], &three), Some(CageError::Edge { from: 0, to: 1 }));
    assert_eq!(make(&[3, 3], &[0, 1, 2, 0, 3, 4]), Some(CageError::Fan(0)));
    let bad = [Vec3::ZERO, Vec3::X, Vec3::new(0.0, f32::NAN, 0.0)];
    assert_eq!(Subdivision::new(&bad, &[3], &[0, 1, 2], 3).err(), Some(CageError::NotFinite(2)));
    // A pillow, all in one point, in one line, huge, and with a vertex of no face.
    for points in [
        points,
        [Vec3::ONE; 6],
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(Vec3::splat),
        points.map(|p| p * 3e38),
        points.map(|p| p * 1e-38),
    ] {
        let shape = Subdivision::new(&points, &[4, 4], &[0, 1, 2, 3, 3, 2, 1, 0], 4).unwrap();
        check_strange_rays(&shape);
    }
}
