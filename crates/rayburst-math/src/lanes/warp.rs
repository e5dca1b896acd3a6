//! Maps from the unit square, sixteen points at once: twins of [`crate::warp`].

use super::{F32x16, Vec2x16, Vec3x16};

/// Points of the unit disk, uniform; see [`crate::warp::concentric_disk`].
#[inline(always)]
pub fn concentric_disk(u: Vec2x16) -> Vec2x16 {
    let (x, y) = (2.0 * u.x - 1.0, 2.0 * u.y - 1.0);
    let wide = x.abs().is_greater(y.abs());
    let (r, other) = (wide.select(x, y), wide.select(y, x));
    let centre = r.is_equal(F32x16::ZERO);
    let eighths = centre.select(F32x16::ZERO, other / r);
    let turns = wide.select(0.125 * eighths, 0.25 - 0.125 * eighths);
    let (sine, cosine) = turns.sin_cos_turns();
    Vec2x16 { x: r * cosine, y: r * sine }
}

/// Directions of the upper hemisphere with density cos θ/π; see [`crate::warp::cosine_hemisphere`].
#[inline(always)]
pub fn cosine_hemisphere(u: Vec2x16) -> Vec3x16 {
    let d = concentric_disk(u);
    Vec3x16 { x: d.x, y: d.y, z: (1.0 - d.dot(d)).max(F32x16::ZERO).sqrt() }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::{hash::Rng, warp};

    #[test]
    fn points_are_those_of_single_maps() {
        let mut rng = Rng::new(5);
        for _ in 0..200 {
            let mut u = Vec2x16::ZERO;
            for lane in 0..16 {
                u.set_lane(lane, if lane == 7 { Vec2::splat(0.5) } else { rng.vec2() });
            }
            let (disk, hemisphere) = (concentric_disk(u), cosine_hemisphere(u));
            for lane in 0..16 {
                let one = warp::concentric_disk(u.lane(lane));
                assert!((disk.lane(lane) - one).length() < 1e-6);
                let one = warp::cosine_hemisphere(u.lane(lane));
                assert!((hemisphere.lane(lane) - one).length() < 1e-3, "{one}");
                assert!((hemisphere.lane(lane).length() - 1.0).abs() < 1e-6);
            }
        }
    }
}
