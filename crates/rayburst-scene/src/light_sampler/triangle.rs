//! Sampling a triangle from a point: by solid angle where it looks large, by area where it does not.
//!
//! Arvo: "Stratified Sampling of Spherical Triangles", SIGGRAPH 1995. Solid angle: Van Oosterom,
//! Strackee: "The Solid Angle of a Plane Triangle", IEEE Transactions on Biomedical Engineering 1983.

use glam::{Vec2, Vec3};
use rayburst_math::warp;

/// Solid angles between which triangles are sampled by solid angle. Smaller ones gain nothing and
/// lose digits; larger ones are all but in the plane of the point.
const SPHERICAL: std::ops::Range<f32> = 2e-3..6.0;

/// The solid angle of a triangle with corners in the unit directions `d`.
fn solid_angle(d: [Vec3; 3]) -> f32 {
    let [a, b, c] = d;
    let volume = a.dot(b.cross(c)).abs();
    2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Directions to the corners and the solid angle, if the triangle is to be sampled by it.
fn spherical(points: [Vec3; 3], from: Vec3) -> Option<([Vec3; 3], f32)> {
    let d = points.map(|p| (p - from).normalize_or_zero());
    let omega = solid_angle(d);
    SPHERICAL.contains(&omega).then_some((d, omega))
}

/// Barycentric coordinates (u, v) of a point of the triangle.
pub(crate) fn sample(points: [Vec3; 3], from: Vec3, u: Vec2) -> Vec2 {
    spherical(points, from)
        .and_then(|(d, omega)| project(points, from, direction(d, omega, u)?))
        .unwrap_or_else(|| warp::uniform_triangle(u))
}

/// Density of [`sample`] per solid angle of seeing `to`, a point of the triangle, from `from`;
/// `area_vector` is the triangle's area times its unit normal. 0 from within its plane.
pub(crate) fn pdf(points: [Vec3; 3], area_vector: Vec3, from: Vec3, to: Vec3) -> f32 {
    if let Some((_, omega)) = spherical(points, from) {
        return 1.0 / omega;
    }
    let d = to - from;
    let projected = area_vector.dot(d).abs();
    let distance2 = d.length_squared();
    if projected > 0.0 { distance2 * distance2.sqrt() / projected } else { 0.0 }
}

/// The angle at `a` between the great circles to `b` and `c`: sine and cosine.
fn corner(a: Vec3, b: Vec3, c: Vec3) -> Option<(f32, f32)> {
    let (n, m) = (a.cross(b).try_normalize()?, a.cross(c).try_normalize()?);
    Some((n.cross(m).length(), n.dot(m)))
}

/// A direction within the spherical triangle, uniform in solid angle.
fn direction([a, b, c]: [Vec3; 3], omega: f32, u: Vec2) -> Option<Vec3> {
    let (sin_alpha, cos_alpha) = corner(a, b, c)?;
    // The sub-triangle of area u.x·Ω that shares the edge a–b ends in a point on a–c.
    let (sin_area, cos_area) = (u.x * omega).sin_cos();
    let s = sin_area * cos_alpha - cos_area * sin_alpha;
    let t = cos_area * cos_alpha + sin_area * sin_alpha;
    let p = t - cos_alpha;
    let q = s + sin_alpha * a.dot(b);
    let cos_edge = ((q * t - p * s) * cos_alpha - q) / ((q * s + p * t) * sin_alpha);
    if !cos_edge.is_finite() {
        return None;
    }
    let cos_edge = cos_edge.clamp(-1.0, 1.0);
    let towards_c = (c - a * a.dot(c)).try_normalize()?;
    let end = cos_edge * a + (1.0 - cos_edge * cos_edge).sqrt() * towards_c;
    // A point between b and that end, even in area.
    let z = 1.0 - u.y * (1.0 - end.dot(b));
    let towards_end = (end - b * b.dot(end)).normalize_or_zero();
    Some(z * b + (1.0 - z * z).max(0.0).sqrt() * towards_end)
}

/// Where a direction meets the triangle, moved inside if rounding led out of it.
fn project(points: [Vec3; 3], from: Vec3, direction: Vec3) -> Option<Vec2> {
    let (e1, e2) = (points[1] - points[0], points[2] - points[0]);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = from - points[0];
    let u = (s.dot(p) / determinant).clamp(0.0, 1.0);
    let v = (direction.dot(s.cross(e1)) / determinant).clamp(0.0, 1.0);
    let sum = u + v;
    let uv = if sum > 1.0 { Vec2::new(u, v) / sum } else { Vec2::new(u, v) };
    uv.is_finite().then_some(uv)
}

#[cfg(test)]
mod tests {
    use rayburst_math::hash::Rng;
    use rayburst_testkit::statistics::test_directions;

    use super::*;

    #[test]
    fn the_solid_angle_of_an_octant_is_half_pi() {
        let d = [Vec3::X, Vec3::Y, Vec3::Z];
        assert!((solid_angle(d) - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    }

    #[test]
    fn near_triangles_are_sampled_evenly_by_solid_angle() {
        let points =
            [Vec3::new(-1.0, 0.4, -0.5), Vec3::new(1.5, 0.3, -0.7), Vec3::new(0.2, 0.5, 1.6)];
        let (e1, e2) = (points[1] - points[0], points[2] - points[0]);
        let (_, omega) = spherical(points, Vec3::ZERO).unwrap();
        let test = test_directions(
            150_000,
            5,
            |rng| {
                let b = sample(points, Vec3::ZERO, rng.vec2());
                Some((points[0] + b.x * e1 + b.y * e2).normalize())
            },
            |d| if hit(points, d).is_some() { 1.0 / omega } else { 0.0 },
        );
        assert!(test.passes(), "{test:?}");
    }

    fn hit(points: [Vec3; 3], d: Vec3) -> Option<f32> {
        let (e1, e2) = (points[1] - points[0], points[2] - points[0]);
        let n = e1.cross(e2);
        let t = points[0].dot(n) / d.dot(n);
        let q = d * t - points[0];
        let u = q.cross(e2).dot(n) / n.length_squared();
        let v = e1.cross(q).dot(n) / n.length_squared();
        (t > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(t)
    }

    #[test]
    fn the_reciprocal_density_averages_to_the_solid_angle() {
        // E[1/pdf] over samples is the solid angle, however the triangle is sampled.
        let mut rng = Rng::new(6);
        for scale in [0.02f32, 0.3, 3.0, 40.0] {
            for height in [0.05f32, 1.0, 20.0] {
                let points = [Vec3::X, Vec3::new(-0.8, 0.0, 0.6), Vec3::new(0.1, 0.2, -0.9)]
                    .map(|p| p * scale + Vec3::Y * height);
                let area_vector = 0.5 * (points[1] - points[0]).cross(points[2] - points[0]);
                let expected = f64::from(solid_angle(points.map(|p| p.normalize())));
                let mut moments = rayburst_testkit::statistics::Moments::default();
                for _ in 0..20_000 {
                    let b = sample(points, Vec3::ZERO, rng.vec2());
                    let p =
                        points[0] + b.x * (points[1] - points[0]) + b.y * (points[2] - points[0]);
                    assert!(b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 + 1e-6);
                    moments.add(1.0 / f64::from(pdf(points, area_vector, Vec3::ZERO, p)));
                }
                let tolerance = 5.0 * moments.standard_error() + 2e-3 * expected;
                assert!(
                    (moments.mean - expected).abs() < tolerance,
                    "{scale} {height}: {} {expected}",
                    moments.mean
                );
            }
        }
    }
}
