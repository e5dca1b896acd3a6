//! Origins of spawned rays: off the surface by the error bound of the point, no global epsilon.
//!
//! After Pharr, Jakob, Humphreys: "Physically Based Rendering", 4th ed., section 6.8.

use glam::Vec3;

/// The bound `n·ε/(1 − n·ε)` on the relative error of `n` rounded operations.
#[inline]
pub const fn gamma(n: u32) -> f32 {
    let ne = n as f32 * (f32::EPSILON * 0.5);
    ne / (1.0 - ne)
}

/// Error bound, per coordinate, of the point `(1−u−v)·p0 + u·p1 + v·p2` interpolated in `f32`.
#[inline]
pub fn interpolation_error(p0: Vec3, p1: Vec3, p2: Vec3, u: f32, v: f32) -> Vec3 {
    gamma(7) * (((1.0 - u - v) * p0).abs() + (u * p1).abs() + (v * p2).abs())
}

/// How far from the plane of a triangle the test may still find it, so that rays that leave it start
/// farther away: the test's rounding is relative to the triangle's size, not to its coordinates, and
/// grows as it gets narrow. `area` is twice the triangle's. Found by experiment: half of the factor is
/// enough for triangles as wide as long; of 1 by 1000, one ray in 1000 still meets its own triangle.
#[inline]
pub fn intersection_error(edges: [Vec3; 2], area: f32) -> f32 {
    let size = edges[0].abs().max(edges[1].abs()).max((edges[1] - edges[0]).abs()).max_element();
    let narrowness = (size * size / area.max(f32::MIN_POSITIVE)).clamp(1.0, 1e4);
    gamma(4) * size * narrowness.sqrt()
}

/// The origin of a ray that leaves the surface point `p` towards `direction`.
///
/// `error` bounds the error of each coordinate of `p`; `normal` is the unit geometric normal of
/// either sign. The result lies on the side of the surface to which `direction` points, outside the
/// box of possible points, rounded away from the surface.
#[inline]
pub fn spawn_origin(p: Vec3, error: Vec3, normal: Vec3, direction: Vec3) -> Vec3 {
    let distance = normal.abs().dot(error);
    let side = if direction.dot(normal) < 0.0 { -normal } else { normal };
    let offset = distance * side;
    let moved = p + offset;
    let round = |value: f32, offset: f32| {
        if offset > 0.0 {
            value.next_up()
        } else if offset < 0.0 {
            value.next_down()
        } else {
            value
        }
    };
    Vec3::new(round(moved.x, offset.x), round(moved.y, offset.y), round(moved.z, offset.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_origin_moves_to_the_side_of_the_direction() {
        let p = Vec3::new(1.0, 2.0, 1000.0);
        let error = Vec3::splat(1e-4);
        let up = spawn_origin(p, error, Vec3::Z, Vec3::new(1.0, 0.0, 0.1));
        let down = spawn_origin(p, error, Vec3::Z, Vec3::new(1.0, 0.0, -0.1));
        assert!(up.z > p.z + 1e-4 && down.z < p.z - 1e-4);
        assert_eq!((up.x, up.y), (p.x, p.y));
    }
}
