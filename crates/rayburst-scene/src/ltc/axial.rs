//! The part of the scattering that depends on the incident cosine only, in the form that edges of
//! polygons can be integrated in.
//!
//! The base under a coat and the light returned by multiple scattering are cos θ times the coat's
//! albedo at θ. For polynomials K(c) = Σ kₘ cᵐ without a linear term, h = −d/dc [(1 − c²) K] is
//! c · Σ kₘ ((m + 2) cᵐ − m cᵐ⁻²), see [`super::polygon`]; kₘ are fitted to the renderer's table of
//! albedos by least squares, once, on first use.

use std::sync::LazyLock;

use crate::bsdf::albedo;

/// The powers m of K. A linear term would give h(0) ≠ 0.
const POWERS: [usize; 7] = [0, 2, 3, 4, 5, 6, 7];
const TERMS: usize = POWERS.len();

/// Coefficients of the powers 0 to 7 of K.
pub(super) type Profile = [f32; 8];

/// K of h = cos θ.
pub(super) const COSINE: Profile = [0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

const ROUGHNESSES: usize = 64;
/// Cosines at which albedos are fitted.
const POINTS: usize = 128;

static PROFILES: LazyLock<Vec<[Profile; 2]>> = LazyLock::new(fit);

/// K of cos θ·a(cos θ) and of cos θ·b(cos θ) for the two parts of [`albedo::directional`].
pub(super) fn albedo_profiles(alpha: f32) -> [Profile; 2] {
    let x = alpha.max(0.0).sqrt().min(1.0) * (ROUGHNESSES - 1) as f32;
    let row = (x as usize).min(ROUGHNESSES - 2);
    let t = x - row as f32;
    let (low, high) = (&PROFILES[row], &PROFILES[row + 1]);
    let mut profiles = *low;
    for (profile, high) in profiles.iter_mut().flatten().zip(high.iter().flatten()) {
        *profile += (high - *profile) * t;
    }
    profiles
}

/// ((m + 2) cᵐ − m cᵐ⁻²) for all powers.
fn basis(c: f64) -> [f64; TERMS] {
    POWERS.map(|m| {
        let lower = if m >= 2 { m as f64 * c.powi(m as i32 - 2) } else { 0.0 };
        (m + 2) as f64 * c.powi(m as i32) - lower
    })
}

fn fit() -> Vec<[Profile; 2]> {
    let points: Vec<(f64, f64, [f64; TERMS])> = (0..POINTS)
        .map(|i| {
            let x = (i as f64 + 0.5) / POINTS as f64;
            let c = x * x;
            // dc = 2x dx; a little more weight where less light comes from.
            (c, x, basis(c))
        })
        .collect();
    let mut normal = [[0.0; TERMS]; TERMS];
    for (_, weight, b) in &points {
        for i in 0..TERMS {
            for j in 0..TERMS {
                normal[i][j] += weight * b[i] * b[j];
            }
        }
    }
    (0..ROUGHNESSES)
        .map(|row| {
            let roughness = row as f32 / (ROUGHNESSES - 1) as f32;
            let mut right = [[0.0; TERMS]; 2];
            for (c, weight, b) in &points {
                let e = albedo::directional(*c as f32, roughness * roughness);
                for (right, value) in right.iter_mut().zip([e.a, e.b]) {
                    for i in 0..TERMS {
                        right[i] += weight * b[i] * f64::from(value);
                    }
                }
            }
            right.map(|right| profile(solve(normal, right)))
        })
        .collect()
}

/// Coefficients at their powers.
fn profile(solution: [f64; TERMS]) -> Profile {
    let mut profile = [0.0; 8];
    for (power, k) in POWERS.into_iter().zip(solution) {
        profile[power] = k as f32;
    }
    profile
}

/// Gauss' elimination with pivots; the matrix is positive definite.
fn solve(mut a: [[f64; TERMS]; TERMS], mut b: [f64; TERMS]) -> [f64; TERMS] {
    for i in 0..TERMS {
        let pivot = (i..TERMS).max_by(|&p, &q| a[p][i].abs().total_cmp(&a[q][i].abs()));
        let pivot = pivot.unwrap_or(i);
        a.swap(i, pivot);
        b.swap(i, pivot);
        for row in i + 1..TERMS {
            let factor = a[row][i] / a[i][i];
            for column in i..TERMS {
                a[row][column] -= factor * a[i][column];
            }
            b[row] -= factor * b[i];
        }
    }
    for i in (0..TERMS).rev() {
        let known: f64 = (i + 1..TERMS).map(|j| a[i][j] * b[j]).sum();
        b[i] = (b[i] - known) / a[i][i];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The albedo that a profile stands for.
    fn value(profile: &Profile, c: f64) -> f64 {
        POWERS.iter().zip(basis(c)).map(|(&m, b)| f64::from(profile[m]) * b).sum()
    }

    #[test]
    fn profiles_are_close_to_the_albedos() {
        assert!((value(&COSINE, 0.3) - 1.0).abs() < 1e-6);
        let (mut worst, mut worst_low) = (0.0f64, 0.0f64);
        for roughness in [0.0f32, 0.1, 0.25, 0.33, 0.5, 0.7, 0.85, 1.0] {
            let alpha = roughness * roughness;
            let profiles = albedo_profiles(alpha);
            for i in 0..=200 {
                let c = f64::from(i) / 200.0;
                let e = albedo::directional(c as f32, alpha);
                let error = [e.a, e.b, e.lost()].into_iter().zip([
                    value(&profiles[0], c),
                    value(&profiles[1], c),
                    1.0 - value(&profiles[0], c) - value(&profiles[1], c),
                ]);
                for (exact, fitted) in error {
                    let error = (f64::from(exact) - fitted).abs();
                    if c >= 0.05 {
                        worst = worst.max(error);
                    } else {
                        worst_low = worst_low.max(error);
                    }
                }
            }
        }
        assert!(worst < 0.03, "{worst}");
        assert!(worst_low < 0.1, "{worst_low}");
    }
}
