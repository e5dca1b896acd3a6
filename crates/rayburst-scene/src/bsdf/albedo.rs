//! Directional albedos of the GGX reflection lobe, tabulated.
//!
//! With Schlick's Fresnel term the albedo of the lobe splits into two parts that do not depend on
//! the material: `F₀·a + F₉₀·b` (the split of Karis: "Real Shading in Unreal Engine 4", SIGGRAPH 2013
//! courses). `1 − a − b` is the light that single scattering loses; Kulla and Conty ("Revisiting
//! Physically Based Shading at Imageworks", SIGGRAPH 2017 courses) give it back as a reciprocal lobe.
//!
//! The table is integrated once, on first use, by a lattice rule over the sampler's unit square.
//! Averages are those of the interpolated table, so that lobes built from both conserve energy to
//! rounding. Axes: √(cos θ), which spreads out grazing angles, and roughness √α.

use std::{
    f32::consts::{PI, TAU},
    sync::LazyLock,
};

use glam::{Vec2, Vec3};
use rayburst_math::{
    distribution::Distribution1d,
    lanes::{F32x16, LANES},
};

use super::{fresnel::schlick_weight, ggx};

/// Entries of the tables along each axis.
pub(crate) const SIDE: usize = 64;
const COSINES: usize = SIDE;
const ROUGHNESSES: usize = SIDE;
/// Points of the lattice rule and its generator: Fibonacci numbers.
const LATTICE: (u32, u32) = (987, 610);

/// The two parts of an albedo: `f0·a + f90·b`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Albedo {
    /// Factor of the reflectance at normal incidence.
    pub a: f32,
    /// Factor of the reflectance at grazing angles.
    pub b: f32,
}

impl Albedo {
    /// What single scattering loses when nothing is absorbed.
    #[inline]
    pub fn lost(self) -> f32 {
        (1.0 - self.a - self.b).max(0.0)
    }

    #[inline]
    fn lerp(self, other: Self, t: f32) -> Self {
        Self { a: self.a + (other.a - self.a) * t, b: self.b + (other.b - self.b) * t }
    }

    /// Of a smooth surface: all light is reflected once.
    #[inline]
    fn smooth(cos: f32) -> Self {
        let b = schlick_weight(cos);
        Self { a: 1.0 - b, b }
    }
}

struct Table {
    /// Row-major: roughness, then cosine.
    directional: Vec<[Albedo; COSINES]>,
    /// Cosine-weighted averages over the hemisphere.
    average: [Albedo; ROUGHNESSES],
    /// By roughness, how lost light is distributed over the cells of √(cos θ).
    lost: Vec<Distribution1d>,
}

static TABLE: LazyLock<Table> = LazyLock::new(Table::new);

/// Albedo for light from `cos`; `alpha` 0 is perfectly smooth.
#[inline]
pub fn directional(cos: f32, alpha: f32) -> Albedo {
    if alpha == 0.0 {
        return Albedo::smooth(cos);
    }
    let (row, t) = cell(alpha.sqrt(), ROUGHNESSES);
    let (column, s) = cell(cos.max(0.0).sqrt(), COSINES);
    let rows = &TABLE.directional[row..row + 2];
    let at = |row: &[Albedo; COSINES]| row[column].lerp(row[column + 1], s);
    at(&rows[0]).lerp(at(&rows[1]), t)
}

/// Cosine-weighted average of [`directional`] over the hemisphere.
#[inline]
pub fn average(alpha: f32) -> Albedo {
    if alpha == 0.0 {
        return Albedo { a: 20.0 / 21.0, b: 1.0 / 21.0 };
    }
    let (row, t) = cell(alpha.sqrt(), ROUGHNESSES);
    TABLE.average[row].lerp(TABLE.average[row + 1], t)
}

/// The entries that sixteen lookups of [`directional`] are interpolated from: two rows of two columns, `a` and
/// `b` of each. Rows and columns are at most `SIDE − 2`.
#[inline(never)]
pub(crate) fn gather_directional(
    rows: &[i32; LANES],
    columns: &[i32; LANES],
    corners: &mut [F32x16; 8],
) {
    let table = &TABLE.directional;
    for lane in 0..LANES {
        let (row, column) = (rows[lane] as usize, columns[lane] as usize);
        for (i, row) in table[row..row + 2].iter().enumerate() {
            for (j, albedo) in row[column..column + 2].iter().enumerate() {
                corners[4 * i + 2 * j].0[lane] = albedo.a;
                corners[4 * i + 2 * j + 1].0[lane] = albedo.b;
            }
        }
    }
}

/// The entries that sixteen lookups of [`average`] are interpolated from: `a` and `b` of two. Rows are at most
/// `SIDE − 2`.
#[inline(never)]
pub(crate) fn gather_average(rows: &[i32; LANES], ends: &mut [F32x16; 4]) {
    let table = &TABLE.average;
    for lane in 0..LANES {
        let row = rows[lane] as usize;
        for (i, albedo) in table[row..row + 2].iter().enumerate() {
            ends[2 * i].0[lane] = albedo.a;
            ends[2 * i + 1].0[lane] = albedo.b;
        }
    }
}

/// A direction roughly in proportion to the light that is lost there, `lost()·cos θ`.
#[inline]
pub fn sample_lost(alpha: f32, u: Vec2) -> Vec3 {
    let (row, t) = cell(alpha.sqrt(), ROUGHNESSES);
    // One number chooses the row, then the cell, then the place in it.
    let (row, u_cell) = if u.x < t { (row + 1, u.x / t) } else { (row, (u.x - t) / (1.0 - t)) };
    let Some((i, _, rest)) = TABLE.lost[row].sample(u_cell.min(1.0 - f32::EPSILON)) else {
        return Vec3::Z;
    };
    let x = (i as f32 + rest) / (COSINES - 1) as f32;
    let cos = (x * x).min(1.0);
    let r = (1.0 - cos * cos).sqrt();
    let (sin_phi, cos_phi) = (TAU * u.y).sin_cos();
    Vec3::new(r * cos_phi, r * sin_phi, cos)
}

/// Density of [`sample_lost`] per solid angle.
#[inline]
pub fn lost_pdf(cos: f32, alpha: f32) -> f32 {
    let (row, t) = cell(alpha.sqrt(), ROUGHNESSES);
    let x = cos.max(1e-12).sqrt();
    let (i, _) = cell(x, COSINES);
    let lost = &TABLE.lost[row..row + 2];
    let p = lost[0].probability(i) * (1.0 - t) + lost[1].probability(i) * t;
    // dω = 2π d cos θ = 4π x dx
    p * (COSINES - 1) as f32 / (2.0 * TAU * x)
}

/// The cell of an axis over [0, 1] and the place in it.
#[inline]
fn cell(x: f32, n: usize) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (x as usize).min(n - 2);
    (i, x - i as f32)
}

impl Table {
    /// On the calling thread alone: a pool's worker that waits here could be given another piece of
    /// work that needs the table.
    fn new() -> Self {
        let lattice = lattice();
        let directional: Vec<[Albedo; COSINES]> = (0..ROUGHNESSES)
            .map(|j| {
                let roughness = j as f32 / (ROUGHNESSES - 1) as f32;
                std::array::from_fn(|i| {
                    let x = i as f32 / (COSINES - 1) as f32;
                    integrate(x * x, roughness * roughness, &lattice)
                })
            })
            .collect();
        let average = std::array::from_fn(|j| average_of(&directional[j]));
        let lost = directional.iter().map(lost_distribution).collect();
        Self { directional, average, lost }
    }
}

/// Points of the sampler's unit square, the first coordinate as a unit vector. Half a turn is enough,
/// by symmetry.
fn lattice() -> Vec<(Vec2, f32)> {
    let (n, generator) = LATTICE;
    (0..n)
        .map(|i| {
            let angle = PI * ((i * generator % n) as f32 + 0.5) / n as f32;
            (Vec2::from_angle(angle), (i as f32 + 0.5) / n as f32)
        })
        .collect()
}

fn integrate(cos: f32, alpha: f32, lattice: &[(Vec2, f32)]) -> Albedo {
    if alpha == 0.0 {
        return Albedo::smooth(cos);
    }
    // Exactly grazing light is the limit of nearly grazing light.
    let cos = cos.max(1e-4);
    let o = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let (mut a, mut b) = (0.0f64, 0.0f64);
    for &(azimuth, u) in lattice {
        let h = ggx::sample_turned(o, alpha, azimuth, u);
        let cos_h = o.dot(h);
        let cos_i = 2.0 * cos_h * h.z - o.z;
        if cos_i > 0.0 {
            let left = f64::from(ggx::shadowing(cos, cos_i, alpha));
            let grazing = f64::from(schlick_weight(cos_h));
            a += left * (1.0 - grazing);
            b += left * grazing;
        }
    }
    let samples = lattice.len() as f64;
    Albedo { a: (a / samples) as f32, b: (b / samples) as f32 }
}

/// ∫ 2 cos θ E(cos θ) d cos θ of a row as it is interpolated, linear in x = √(cos θ): with
/// cos θ = x², 4 ∫ x³ E(x) dx, by Simpson's rule, which is nearly exact for these quartics.
fn average_of(row: &[Albedo; COSINES]) -> Albedo {
    let h = 1.0 / (COSINES - 1) as f64;
    let cube = |x: f64| x * x * x;
    let integral = |part: fn(&Albedo) -> f32| {
        let sum: f64 = row
            .windows(2)
            .enumerate()
            .map(|(i, w)| {
                let (e0, e1) = (f64::from(part(&w[0])), f64::from(part(&w[1])));
                let x = i as f64 * h;
                let middle = 4.0 * cube(x + 0.5 * h) * 0.5 * (e0 + e1);
                h / 6.0 * (cube(x) * e0 + middle + cube(x + h) * e1)
            })
            .sum();
        (4.0 * sum) as f32
    };
    Albedo { a: integral(|e| e.a), b: integral(|e| e.b) }
}

/// Light lost in the cells of a row, `lost()·cos θ dω ∝ lost(x) x³ dx`. Every cell gets a little, so
/// that the density is nowhere zero.
fn lost_distribution(row: &[Albedo; COSINES]) -> Distribution1d {
    let weights: Vec<f32> = row
        .windows(2)
        .enumerate()
        .map(|(i, w)| {
            let x = (i as f32 + 0.5) / (COSINES - 1) as f32;
            (0.5 * (w[0].lost() + w[1].lost()) + 1e-6) * x * x * x
        })
        .collect();
    Distribution1d::new(&weights)
}

#[cfg(test)]
mod tests {
    use rayburst_math::hash::Rng;

    use super::*;

    #[test]
    fn the_table_agrees_with_monte_carlo_between_its_nodes() {
        let mut rng = Rng::new(11);
        for _ in 0..60 {
            let cos = rng.range(0.02, 1.0);
            let roughness = rng.range(0.05, 1.0);
            let alpha = roughness * roughness;
            let o = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            const N: u32 = 40_000;
            let (mut a, mut b) = (0.0f64, 0.0f64);
            for _ in 0..N {
                let h = ggx::sample(o, alpha, rng.vec2());
                let cos_i = 2.0 * o.dot(h) * h.z - o.z;
                if cos_i > 0.0 {
                    let left = f64::from(ggx::shadowing(cos, cos_i, alpha));
                    let grazing = f64::from(schlick_weight(o.dot(h)));
                    a += left * (1.0 - grazing);
                    b += left * grazing;
                }
            }
            let (a, b) = (a / f64::from(N), b / f64::from(N));
            let table = directional(cos, alpha);
            // Standard errors are at most 0.5/√N = 0.0025 each; four of them, plus interpolation.
            assert!((f64::from(table.a) - a).abs() < 0.011, "{cos} {alpha}: {} {a}", table.a);
            assert!((f64::from(table.b) - b).abs() < 0.011, "{cos} {alpha}: {} {b}", table.b);
        }
    }

    #[test]
    fn smooth_surfaces_lose_nothing() {
        for cos in [0.0, 0.3, 1.0] {
            assert!(directional(cos, 0.0).lost() < 1e-6);
        }
        assert!(directional(1.0, 1e-3).lost() < 1e-3);
        assert!(directional(0.5, 1.0).lost() > 0.1);
    }
}
