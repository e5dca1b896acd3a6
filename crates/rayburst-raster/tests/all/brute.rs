//! Rasterising is the loop over triangles and pixels, ray casting the loop over pixels and triangles: both
//! loops, by brute force in `f64`, and the rasteriser find the same.

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayburst_math::{HitKind, hash::Rng};
use rayburst_raster::{Projection, Solid, View};
use rayburst_testkit::{TestMesh, meshes};

use crate::views::{clusters, draw, look, placed};

/// What a pixel shows: depth along the view and triangle.
type Seen = Option<(f64, u32)>;

/// A corner in homogeneous pixels.
fn project(view: &View, p: Vec3) -> DVec3 {
    let [r, u, v] = view.frame.map(|axis| axis.as_dvec3());
    let d = p.as_dvec3() - view.eye.as_dvec3();
    let (Projection::Perspective { half } | Projection::Orthographic { half }) = view.projection;
    let at = DVec2::new(d.dot(r), -d.dot(u)) / half.as_dvec2();
    let w = if matches!(view.projection, Projection::Perspective { .. }) { d.dot(v) } else { 1.0 };
    let size = DVec2::new(f64::from(view.size.0), f64::from(view.size.1));
    let first = 0.5 + view.jitter.as_dvec2();
    let x = (at.x + w) * 0.5 * size.x - first.x * w;
    DVec3::new(x, (at.y + w) * 0.5 * size.y - first.y * w, w)
}

/// For each triangle, for each pixel: edge functions with the top-left rule, then the depth test.
fn rasterise(view: &View, mesh: &TestMesh) -> Vec<Seen> {
    let (width, height) = view.size;
    let mut picture = vec![None; (width * height) as usize];
    for triangle in 0..mesh.indices.len() {
        let corners = mesh.corners(triangle);
        let [a, b, c] = corners.map(|p| project(view, p));
        let det = a.dot(b.cross(c));
        if det == 0.0 || !det.is_finite() {
            continue;
        }
        let edges = [b.cross(c), c.cross(a), a.cross(b)].map(|e| e * det.signum());
        let depths =
            corners.map(|p| (p.as_dvec3() - view.eye.as_dvec3()).dot(view.frame[2].as_dvec3()));
        for y in 0..height {
            for x in 0..width {
                let at = DVec3::new(f64::from(x), f64::from(y), 1.0);
                let e = edges.map(|edge| edge.dot(at));
                let inside = (0..3).all(|i| {
                    let left = edges[i].x > 0.0;
                    let top = edges[i].x == 0.0 && edges[i].y > 0.0;
                    e[i] > 0.0 || e[i] == 0.0 && (left || top)
                });
                if !inside {
                    continue;
                }
                let depth = match view.projection {
                    Projection::Perspective { .. } => det.abs() / (e[0] + e[1] + e[2]),
                    Projection::Orthographic { .. } => {
                        (e[0] * depths[0] + e[1] * depths[1] + e[2] * depths[2]) / det.abs()
                    }
                };
                let seen: &mut Seen = &mut picture[(y * width + x) as usize];
                if depth >= 0.0 && seen.is_none_or(|(nearest, _)| depth < nearest) {
                    *seen = Some((depth, triangle as u32));
                }
            }
        }
    }
    picture
}

/// The ray of a pixel: origin and a direction that is one unit deep.
fn ray(view: &View, x: u32, y: u32) -> (DVec3, DVec3) {
    let [r, u, v] = view.frame.map(|axis| axis.as_dvec3());
    let size = DVec2::new(f64::from(view.size.0), f64::from(view.size.1));
    let pixel = DVec2::new(f64::from(x), f64::from(y)) + 0.5 + view.jitter.as_dvec2();
    let ndc = 2.0 * pixel / size - 1.0;
    let (Projection::Perspective { half } | Projection::Orthographic { half }) = view.projection;
    let p = ndc * half.as_dvec2();
    let across = p.x * r - p.y * u;
    match view.projection {
        Projection::Perspective { .. } => (view.eye.as_dvec3(), across + v),
        Projection::Orthographic { .. } => (view.eye.as_dvec3() + across, v),
    }
}

/// For each pixel, for each triangle: where the ray meets it (Möller, Trumbore, 1997).
fn cast(view: &View, mesh: &TestMesh) -> Vec<Seen> {
    let (width, height) = view.size;
    let mut picture = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (origin, direction) = ray(view, x, y);
            let mut seen: Seen = None;
            for triangle in 0..mesh.indices.len() {
                let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
                let (e1, e2, s) = (b - a, c - a, origin - a);
                let (p, q) = (direction.cross(e2), s.cross(e1));
                let det = p.dot(e1);
                let (u, v, t) = (p.dot(s) / det, q.dot(direction) / det, q.dot(e2) / det);
                let inside = det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0;
                if inside && seen.is_none_or(|(nearest, _)| t < nearest) {
                    seen = Some((t, triangle as u32));
                }
            }
            picture.push(seen);
        }
    }
    picture
}

/// Whether an edge of the triangle passes a pixel's centre within 10⁻³ pixels.
fn is_at_edge(view: &View, mesh: &TestMesh, seen: Seen, x: u32, y: u32) -> bool {
    let Some((_, triangle)) = seen else { return false };
    let corners = mesh.corners(triangle as usize).map(|p| project(view, p));
    let at = DVec3::new(f64::from(x), f64::from(y), 1.0);
    (0..3).any(|i| {
        let edge = corners[i].cross(corners[(i + 1) % 3]);
        edge.dot(at).abs() <= 1e-3 * edge.truncate().length()
    })
}

#[test]
fn both_loops_and_the_rasteriser_agree() {
    let size = (97, 71);
    let mut rng = Rng::new(4);
    let mut shown = 0;
    let mut meshes = vec![meshes::cube(), meshes::sphere(24, 13), meshes::random_soup(150, 0.5, 3)];
    meshes.push(meshes::spiky_sphere(20, 10, 5));
    for mesh in &meshes {
        let bounds = mesh.bounds();
        for i in 0..6 {
            // From outside, then from within: triangles reach behind the eye.
            let reach = if i < 3 { 1.5 } else { 0.2 };
            let towards = (rng.vec3() - 0.5).normalize() * bounds.diagonal();
            let eye = bounds.centre() + reach * towards;
            let parallel = i % 3 == 1;
            let half = if parallel { 0.4 * bounds.diagonal() } else { 0.6 };
            let mut view = look(eye, bounds.centre(), half, parallel, size);
            view.jitter = rng.vec2() - Vec2::splat(0.5);
            let (raster, rays) = (rasterise(&view, mesh), cast(&view, mesh));
            let clusters = clusters(mesh);
            let drawn = [placed(&clusters, true)];
            let found = draw(&view, &drawn, &Solid);
            let mut differ = [0; 2];
            for y in 0..size.1 {
                for x in 0..size.0 {
                    let pixel = (y * size.0 + x) as usize;
                    let id = found.triangles.get(x, y);
                    let depth = found.depth.get(x, y);
                    assert_eq!(depth == f32::INFINITY, id == u32::MAX);
                    let point = found.point(&view, &drawn, x, y);
                    assert_eq!(point.is_none(), id == u32::MAX);
                    shown += usize::from(point.is_some());
                    for (number, seen) in [raster[pixel], rays[pixel]].into_iter().enumerate() {
                        let own = point.map(|point| (f64::from(point.depth), id));
                        if seen.map(|s| s.1) == own.map(|s| s.1) {
                            let (Some((nearest, _)), Some(point)) = (seen, point) else { continue };
                            let error = (f64::from(depth) - nearest).abs();
                            assert!(
                                error <= 2e-4 * nearest + 1e-5,
                                "{} {depth} {nearest}",
                                mesh.name
                            );
                            let (_, direction) = ray(&view, x, y);
                            let t = nearest * direction.length();
                            assert!((f64::from(point.hit.t) - t).abs() <= 2e-4 * t + 1e-5);
                            continue;
                        }
                        differ[number] += 1;
                        let close = |a: f64, b: f64| (a - b).abs() <= 1e-5 * a.abs() + 1e-6;
                        let same_depth = seen.zip(own).is_some_and(|(a, b)| close(a.0, b.0));
                        assert!(
                            same_depth
                                || is_at_edge(&view, mesh, seen, x, y)
                                || is_at_edge(&view, mesh, own, x, y),
                            "{} ({x}, {y}): {seen:?} {own:?}",
                            mesh.name
                        );
                    }
                }
            }
            let most = (size.0 * size.1) / 500;
            assert!(differ.iter().all(|&count| count <= most), "{} {differ:?}", mesh.name);
        }
    }
    assert!(shown > 50_000, "{shown}");
}

#[test]
fn points_are_where_rays_meet_triangles_on_the_side_that_is_seen() {
    let mesh = meshes::sphere(16, 9);
    let clusters = clusters(&mesh);
    let mirror = glam::Affine3A::from_scale(Vec3::new(-1.5, 1.0, 0.7));
    let bounds = mesh.bounds();
    for transform in [glam::Affine3A::IDENTITY, mirror] {
        let mut drawn = placed(&clusters, true);
        drawn.transform = transform;
        for inside in [false, true] {
            let centre = transform.transform_point3(bounds.centre());
            let eye = centre + if inside { 0.05 } else { 1.5 } * bounds.diagonal() * Vec3::Z;
            let view = look(eye, centre, 0.4, false, (64, 48));
            let found = draw(&view, &[drawn], &Solid);
            let point = found.point(&view, &[drawn], 31, 23).expect("the middle shows it");
            let corners = clusters.triangle(point.hit.primitive).expect("active");
            let [a, b, c] = corners.map(|p| transform.transform_point3(p));
            let (origin, direction) = ray(&view, 31, 23);
            let met = origin + direction.normalize() * f64::from(point.hit.t);
            let (u, v) = (point.hit.u, point.hit.v);
            let there = (1.0 - u - v) * a + u * b + v * c;
            assert!((there.as_dvec3() - met).length() < 1e-5);
            // Winding in the mesh's own space: mirroring does not change it.
            let [a, b, c] = corners;
            let back = transform.inverse().transform_vector3(direction.as_vec3());
            let front = (b - a).cross(c - a).dot(back) < 0.0;
            let kind = if front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK };
            assert_eq!(point.hit.kind, kind);
            assert_eq!((point.hit.instance, point.hit.geometry), (3, 5));
        }
        assert!(found_out_of_range(&clusters, transform));
    }
}

/// Pixels outside of the picture show nothing.
fn found_out_of_range(clusters: &rayburst_raster::Clusters, transform: glam::Affine3A) -> bool {
    let mut drawn = placed(clusters, true);
    drawn.transform = transform;
    let view = look(Vec3::Z * 9.0, Vec3::ZERO, 0.4, false, (8, 8));
    draw(&view, &[drawn], &Solid).point(&view, &[drawn], 8, 0).is_none()
}
