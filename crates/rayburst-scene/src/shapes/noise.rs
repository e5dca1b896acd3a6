//! Gradient noise in the plane.
//!
//! Perlin: "Improving Noise", SIGGRAPH 2002 (quintic fade), with gradients hashed from the lattice
//! point instead of a permutation table, so that there is no period.

use glam::Vec2;
use rayburst_math::hash;

/// Noise in about [−1, 1] with features of size 1; zero at lattice points.
pub fn gradient(p: Vec2, seed: u32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let (x, y) = (cell.x as i32 as u32, cell.y as i32 as u32);
    // Separable part of the hash once a row.
    let rows = [hash::combine(y, seed), hash::combine(y.wrapping_add(1), seed)];
    let corner = |dx: u32, dy: u32| {
        let bits = hash::pcg(x.wrapping_add(dx) ^ rows[dy as usize]);
        // A gradient in the square: no sine, and the direction hardly shows under an fBm.
        let g =
            Vec2::new((bits & 0xFFFF) as f32, (bits >> 16) as f32) * (2.0 / 65535.0) - Vec2::ONE;
        g.dot(f - Vec2::new(dx as f32, dy as f32))
    };
    let fade = f * f * f * (f * (f * 6.0 - Vec2::splat(15.0)) + Vec2::splat(10.0));
    let lower = corner(0, 0) + (corner(1, 0) - corner(0, 0)) * fade.x;
    let upper = corner(0, 1) + (corner(1, 1) - corner(0, 1)) * fade.x;
    (lower + (upper - lower) * fade.y) * 1.4
}

/// Sum of octaves, each twice as fine and half as high.
pub fn fbm(p: Vec2, octaves: u32, seed: u32) -> f32 {
    let mut sum = 0.0;
    let mut weight = 0.5;
    let mut p = p;
    for octave in 0..octaves {
        sum += weight * gradient(p, seed + octave);
        // A turn between octaves hides the lattice: rotation by the angle of (3, 4, 5), times two.
        p = Vec2::new(1.6 * p.x - 1.2 * p.y, 1.2 * p.x + 1.6 * p.y);
        weight *= 0.5;
    }
    sum
}

/// Sum of octaves of ridges, each fine one strong only where the coarser ones are high (Musgrave's
/// ridged multifractal; Ebert et al.: "Texturing and Modeling", 2003, chapter 16). In [0, 1].
pub fn ridged(p: Vec2, octaves: u32, seed: u32) -> f32 {
    let mut sum = 0.0;
    let mut weight = 0.5;
    let mut signal_above = 1.0f32;
    let mut p = p;
    for octave in 0..octaves {
        let ridge = 1.0 - gradient(p, seed + octave).abs().min(1.0);
        let signal = ridge * ridge * signal_above;
        sum += weight * signal;
        signal_above = (signal * 1.6).clamp(0.0, 1.0);
        p = Vec2::new(1.6 * p.x - 1.2 * p.y, 1.2 * p.x + 1.6 * p.y);
        weight *= 0.5;
    }
    sum.min(1.0)
}
