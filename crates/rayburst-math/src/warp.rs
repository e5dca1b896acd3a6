//! Maps from the unit square to the shapes that samplers need, with their densities.
//!
//! Densities are with respect to solid angle for directions and area for points, in local frames
//! whose z axis is the normal.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI, TAU};

use glam::{Vec2, Vec3};

/// A point of the unit disk, uniform; concentric map (Shirley, Chiu 1997).
#[inline]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, theta) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y))
    };
    r * Vec2::new(theta.cos(), theta.sin())
}

/// A direction of the upper hemisphere with density `cos θ / π`.
#[inline]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = concentric_disk(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`cosine_hemisphere`].
#[inline]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// A direction of the upper hemisphere, uniform.
#[inline]
pub fn uniform_hemisphere(u: Vec2) -> Vec3 {
    let z = u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// A direction of the sphere, uniform; density `1 / 4π`.
#[inline]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// A direction within `cos_max` of +z, uniform.
#[inline]
pub fn uniform_cone(u: Vec2, cos_max: f32) -> Vec3 {
    let z = 1.0 - u.x * (1.0 - cos_max);
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// Density of [`uniform_cone`].
#[inline]
pub fn uniform_cone_pdf(cos_max: f32) -> f32 {
    1.0 / (2.0 * PI * (1.0 - cos_max))
}

/// Barycentric coordinates `(u, v)` of the second and third vertex, uniform over a triangle
/// (Heitz: "A Low-Distortion Map Between Triangle and Square", 2019).
#[inline]
pub fn uniform_triangle(u: Vec2) -> Vec2 {
    if u.x < u.y {
        let b0 = 0.5 * u.x;
        Vec2::new(u.y - b0, 1.0 - (u.y - b0) - b0)
    } else {
        let b1 = 0.5 * u.y;
        Vec2::new(b1, 1.0 - (u.x - b1) - b1)
    }
}

/// The offset in [−radius, radius] of a tent of that radius.
#[inline]
pub fn tent(u: f32, radius: f32) -> f32 {
    if u < 0.5 {
        radius * ((2.0 * u).sqrt() - 1.0)
    } else {
        radius * (1.0 - (2.0 - 2.0 * u).max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::Rng;

    fn chi2(bins: &[u32], expected: impl Fn(usize) -> f64) -> (f64, f64) {
        let chi: f64 = bins
            .iter()
            .enumerate()
            .map(|(i, &n)| (f64::from(n) - expected(i)).powi(2) / expected(i))
            .sum();
        let dof = (bins.len() - 1) as f64;
        (chi, dof + 5.0 * (2.0 * dof).sqrt())
    }

    #[test]
    fn directions_follow_their_densities() {
        const N: usize = 400_000;
        type Warp = fn(Vec2) -> Vec3;
        type Cdf = fn(f64) -> f64;
        // Cumulative distribution of z for each warp; the azimuth is uniform.
        let cases: [(Warp, f64, Cdf); 4] = [
            (cosine_hemisphere, 0.0, |z| z * z),
            (uniform_hemisphere, 0.0, |z| z),
            (uniform_sphere, -1.0, |z| 0.5 * (z + 1.0)),
            (|u| uniform_cone(u, 0.7), 0.7, |z| (z - 0.7) / 0.3),
        ];
        for (case, (warp, low, cdf)) in cases.into_iter().enumerate() {
            let mut rng = Rng::new(case as u64);
            let mut bins = vec![0u32; 20 * 16];
            for _ in 0..N {
                let d = warp(rng.vec2());
                assert!((d.length() - 1.0).abs() < 1e-5);
                let iz = ((f64::from(d.z) - low) / (1.0 - low) * 20.0).clamp(0.0, 19.0) as usize;
                let ip = ((f64::from(d.y.atan2(d.x)) + std::f64::consts::PI)
                    / std::f64::consts::TAU
                    * 16.0)
                    .min(15.0) as usize;
                bins[iz * 16 + ip] += 1;
            }
            let (chi, limit) = chi2(&bins, |i| {
                let z = |k: usize| low + (1.0 - low) * k as f64 / 20.0;
                N as f64 / 16.0 * (cdf(z(i / 16 + 1)) - cdf(z(i / 16)))
            });
            assert!(chi < limit, "case {case}: {chi} ≥ {limit}");
        }
    }

    #[test]
    fn triangles_and_tents_are_sampled_evenly() {
        const N: usize = 400_000;
        let mut rng = Rng::new(9);
        let mut bins = [0u32; 16];
        let mut tents = [0u32; 20];
        for _ in 0..N {
            let b = uniform_triangle(rng.vec2());
            assert!(b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 + 1e-6);
            // Sixteen congruent triangles of a 4×4 subdivision.
            let (x, y) = (b.x * 4.0, b.y * 4.0);
            let (i, j) = ((x as usize).min(3), (y as usize).min(3));
            let upper = x.fract() + y.fract() > 1.0;
            let row = [0, 7, 12, 15][j];
            bins[(row + 2 * i + usize::from(upper)).min(15)] += 1;
            tents[((tent(rng.f32(), 1.0) + 1.0) * 10.0).min(19.0) as usize] += 1;
        }
        let (chi, limit) = chi2(&bins, |_| N as f64 / 16.0);
        assert!(chi < limit, "{chi} ≥ {limit}");
        let cdf =
            |x: f64| if x < 0.0 { 0.5 * (1.0 + x).powi(2) } else { 1.0 - 0.5 * (1.0 - x).powi(2) };
        let (chi, limit) = chi2(&tents, |i| {
            let x = i as f64 / 10.0 - 1.0;
            N as f64 * (cdf(x + 0.1) - cdf(x))
        });
        assert!(chi < limit, "{chi} ≥ {limit}");
    }
}
