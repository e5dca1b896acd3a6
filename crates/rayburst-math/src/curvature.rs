//! Mean curvature of surfaces from normals at a few points, for footprints.
//!
//! The normal's change over a small step on the surface is a linear map (the shape operator); the mean
//! curvature is half its trace. Positive where the surface bulges to the side of its normals.

use glam::{Vec2, Vec3};

use crate::Frame;

/// Gradients over a triangle's plane of the weights of its second and third corner, per world unit:
/// a step `s` in the plane changes them by `g[0]·s` and `g[1]·s`. `edges` lead from the first corner to
/// the others. Zero where the triangle has no area.
#[inline]
pub fn barycentric_gradients(edges: [Vec3; 2]) -> [Vec3; 2] {
    let normal = edges[0].cross(edges[1]);
    let scale = normal.length_squared().recip();
    let gradients = [edges[1].cross(normal) * scale, normal.cross(edges[0]) * scale];
    if gradients.iter().all(|g| g.is_finite()) { gradients } else { [Vec3::ZERO; 2] }
}

/// Mean curvature, per world unit, of the normals that a triangle interpolates. `edges` and
/// `normal_edges` lead from the first corner, and its unit normal, to the others.
#[inline]
pub fn of_triangle(edges: [Vec3; 2], normal_edges: [Vec3; 2]) -> f32 {
    let [second, third] = barycentric_gradients(edges);
    0.5 * (second.dot(normal_edges[0]) + third.dot(normal_edges[1]))
}

/// A point of a surface with its unit normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where, in world space.
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
}

/// Neighbours whose normals differ by more are of another surface (cosine).
const SAME_SURFACE: f32 = 0.7;
/// Neighbours that rise more above the tangent plane for their distance are too.
const STEEPEST: f32 = 0.7;

/// Mean curvature at a pixel of a G-buffer from the points that neighbouring pixels see, per world
/// unit; 0 where none of them is of the same surface.
///
/// Akenine-Möller et al., Ray Tracing Gems 2019, chapter 20, take the curvature at the first hit from
/// derivatives of normals and positions across the screen. Here the shape operator is fitted to all
/// neighbours by least squares, and what lies across an edge is left out.
pub fn of_pixels(centre: SurfacePoint, neighbours: &[SurfacePoint]) -> f32 {
    let frame = Frame::from_normal(centre.normal);
    let flat = |v: Vec3| Vec2::new(v.dot(frame.tangent), v.dot(frame.bitangent));
    // Sums of products of steps with steps, and of changes of the normal with steps.
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let (mut along_x, mut along_y) = (Vec2::ZERO, Vec2::ZERO);
    for neighbour in neighbours {
        let (step, change) =
            (neighbour.position - centre.position, neighbour.normal - centre.normal);
        let rise = step.dot(centre.normal).abs();
        let same = neighbour.normal.dot(centre.normal) > SAME_SURFACE
            && rise < STEEPEST * step.length()
            && step.is_finite();
        if same {
            let (step, change) = (flat(step), flat(change));
            xx += step.x * step.x;
            xy += step.x * step.y;
            yy += step.y * step.y;
            along_x += change * step.x;
            along_y += change * step.y;
        }
    }
    let (trace, determinant) = (xx + yy, xx * yy - xy * xy);
    let curvature = if determinant > 1e-4 * trace * trace {
        let bending = along_x.x * yy - along_y.x * xy + along_y.y * xx - along_x.y * xy;
        0.5 * bending / determinant
    } else {
        // All in one line: the curvature along it.
        (along_x.x + along_y.y) / trace
    };
    if curvature.is_finite() { curvature } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{hash::Rng, warp};

    #[test]
    fn gradients_undo_edges() {
        let mut rng = Rng::new(2);
        for _ in 0..1000 {
            let edges = [rng.vec3() - 0.5, rng.vec3() - 0.5];
            if edges[0].cross(edges[1]).length() < 0.02 {
                continue;
            }
            let g = barycentric_gradients(edges);
            for (i, gradient) in g.iter().enumerate() {
                for (j, edge) in edges.iter().enumerate() {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((gradient.dot(*edge) - expected).abs() < 1e-3);
                }
            }
        }
        assert_eq!(barycentric_gradients([Vec3::X, Vec3::X]), [Vec3::ZERO; 2]);
        assert_eq!(barycentric_gradients([Vec3::NAN, Vec3::X]), [Vec3::ZERO; 2]);
    }

    /// Points of a sphere of radius 2 and of a cylinder of radius 2 around y.
    fn sphere(direction: Vec3) -> SurfacePoint {
        let normal = direction.normalize();
        SurfacePoint { position: 2.0 * normal, normal }
    }

    fn cylinder(angle: f32, height: f32) -> SurfacePoint {
        let normal = Vec3::new(angle.cos(), 0.0, angle.sin());
        SurfacePoint { position: 2.0 * normal + Vec3::Y * height, normal }
    }

    #[test]
    fn spheres_and_cylinders_have_their_curvature() {
        let mut rng = Rng::new(6);
        for _ in 0..200 {
            let at = warp::uniform_sphere(rng.vec2());
            let near = |rng: &mut Rng| sphere(at + 0.05 * (rng.vec3() - 0.5));
            let points = [near(&mut rng), near(&mut rng), near(&mut rng), near(&mut rng)];
            let curvature = of_pixels(sphere(at), &points);
            assert!((curvature - 0.5).abs() < 0.02, "{curvature}");
            let line = of_pixels(sphere(at), &points[..1]);
            assert!((line - 0.5).abs() < 0.02, "{line}");
            let edges = [1, 2].map(|i| points[i].position - points[0].position);
            let bends = [1, 2].map(|i| points[i].normal - points[0].normal);
            if edges[0].cross(edges[1]).length() > 1e-4 {
                let curvature = of_triangle(edges, bends);
                assert!((curvature - 0.5).abs() < 0.05, "{curvature}");
            }

            let angle = 6.0 * rng.f32();
            let mut near = || cylinder(angle + 0.1 * (rng.f32() - 0.5), rng.f32() - 0.5);
            let points = [near(), near(), near(), near()];
            let curvature = of_pixels(cylinder(angle, 0.0), &points);
            assert!((curvature - 0.25).abs() < 0.02, "{curvature}");
        }
    }

    #[test]
    fn edges_and_broken_pixels_do_not_count() {
        let centre = SurfacePoint { position: Vec3::ZERO, normal: Vec3::Y };
        let beside = |position: Vec3, normal: Vec3| SurfacePoint { position, normal };
        let flat = beside(Vec3::X, Vec3::Y);
        let corner = beside(Vec3::new(0.1, 0.0, 0.0), Vec3::X);
        let behind = beside(Vec3::new(0.1, -3.0, 0.0), Vec3::Y);
        let nothing = beside(Vec3::INFINITY, Vec3::ZERO);
        let broken = beside(Vec3::NAN, Vec3::NAN);
        assert_eq!(of_pixels(centre, &[flat, corner, behind, nothing, broken]), 0.0);
        assert_eq!(of_pixels(centre, &[]), 0.0);
        assert_eq!(of_pixels(centre, &[centre]), 0.0);
    }
}
