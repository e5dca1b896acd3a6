//! Statistics for tests of samplers and estimators.
//!
//! Pearson's chi-square test with pooled small bins, a z-test of a mean, and histograms of directions
//! against densities. Significance is chosen so that a fixed-seed suite of thousands of tests does
//! not fail by chance, while wrong densities fail by many orders of magnitude.
//!
//! Press, Teukolsky, Vetterling, Flannery: "Numerical Recipes", 3rd ed., sections 6.2 and 14.3.

use std::f64::consts::TAU;

use glam::Vec3;
use rayburst_math::hash::Rng;

/// A p-value below this is a failure.
pub const SIGNIFICANCE: f64 = 1e-6;

/// Result of a chi-square test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquare {
    /// Σ (observed − expected)² / expected over the pooled bins.
    pub statistic: f64,
    /// Degrees of freedom.
    pub degrees: usize,
    /// Probability of a statistic this large if the expectation is right.
    pub p_value: f64,
}

impl ChiSquare {
    /// Whether the observation is compatible with the expectation.
    pub fn passes(&self) -> bool {
        self.p_value >= SIGNIFICANCE
    }
}

/// Compares counts with expected counts, which need not sum to the same number: a sampler that loses
/// samples must count them in a bin of their own. Bins that expect fewer than five are pooled, and
/// counts where nothing is expected fail the test.
pub fn chi_square(observed: &[u64], expected: &[f64]) -> ChiSquare {
    assert_eq!(observed.len(), expected.len(), "one expectation a bin");
    let (mut order, impossible): (Vec<usize>, Vec<usize>) =
        (0..expected.len()).partition(|&i| expected[i] > 0.0);
    // A few may be rounded over the edge of a bin.
    let strays: u64 = impossible.iter().map(|&i| observed[i]).sum();
    order.sort_by(|&a, &b| expected[a].total_cmp(&expected[b]));
    let (mut statistic, mut bins) = (0.0, 0usize);
    let (mut pool_observed, mut pool_expected) = (0.0, 0.0);
    for i in order {
        pool_observed += observed[i] as f64;
        pool_expected += expected[i];
        if pool_expected >= 5.0 {
            statistic += (pool_observed - pool_expected).powi(2) / pool_expected;
            bins += 1;
            (pool_observed, pool_expected) = (0.0, 0.0);
        }
    }
    if strays > 5 || pool_observed > 5.0 * (pool_expected + 1.0).sqrt() + pool_expected {
        statistic = f64::INFINITY;
    }
    let degrees = bins.saturating_sub(1).max(1);
    let p_value = if statistic.is_finite() {
        upper_gamma(0.5 * degrees as f64, 0.5 * statistic)
    } else {
        0.0
    };
    ChiSquare { statistic, degrees, p_value }
}

/// Running mean and variance (Welford 1962).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of values.
    pub count: u64,
    /// Their mean.
    pub mean: f64,
    squares: f64,
}

impl Moments {
    /// Of all values of an iterator.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut moments = Self::default();
        for value in values {
            moments.add(value);
        }
        moments
    }

    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let delta = value - self.mean;
        self.mean += delta / self.count as f64;
        self.squares += delta * (value - self.mean);
    }

    /// Unbiased variance.
    pub fn variance(&self) -> f64 {
        self.squares / self.count.saturating_sub(1).max(1) as f64
    }

    /// Standard error of the mean.
    pub fn standard_error(&self) -> f64 {
        (self.variance() / self.count.max(1) as f64).sqrt()
    }
}

/// How many standard errors the mean is away from `expected`; infinite if it differs without spread.
pub fn z_score(moments: &Moments, expected: f64) -> f64 {
    let difference = (moments.mean - expected).abs();
    let error = moments.standard_error();
    if difference == 0.0 { 0.0 } else { difference / error }
}

/// Tests a sampler of directions against its density per solid angle over the sphere.
///
/// `sample` gives a direction, or `None` for a lost sample; `pdf` the density. Directions are binned
/// over z and azimuth, densities integrated over each bin, and what densities lack to one must be
/// what is lost. Lobes must be wide enough for the bins: a few degrees.
pub fn test_directions(
    samples: u32,
    seed: u64,
    mut sample: impl FnMut(&mut Rng) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f32,
) -> ChiSquare {
    const ROWS: usize = 24;
    const COLUMNS: usize = 32;
    // Points a bin in z and in azimuth.
    const SUB: (usize, usize) = (48, 32);
    let mut rng = Rng::new(seed);
    let mut observed = vec![0u64; ROWS * COLUMNS + 1];
    for _ in 0..samples {
        let bin = match sample(&mut rng) {
            None => ROWS * COLUMNS,
            Some(d) => {
                let row = (0.5 * (f64::from(d.z) + 1.0) * ROWS as f64) as usize;
                let turn = f64::from(d.y).atan2(f64::from(d.x)) / TAU + 0.5;
                row.min(ROWS - 1) * COLUMNS + ((turn * COLUMNS as f64) as usize).min(COLUMNS - 1)
            }
        };
        observed[bin] += 1;
    }
    let mut expected = vec![0.0; ROWS * COLUMNS + 1];
    let cell = 2.0 * TAU / (ROWS * COLUMNS * SUB.0 * SUB.1) as f64;
    for row in 0..ROWS * SUB.0 {
        let z = 2.0 * (row as f64 + 0.5) / (ROWS * SUB.0) as f64 - 1.0;
        let r = (1.0 - z * z).sqrt();
        for column in 0..COLUMNS * SUB.1 {
            let phi = ((column as f64 + 0.5) / (COLUMNS * SUB.1) as f64 - 0.5) * TAU;
            let d = Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32);
            expected[row / SUB.0 * COLUMNS + column / SUB.1] +=
                f64::from(pdf(d)) * cell * f64::from(samples);
        }
    }
    let total: f64 = expected.iter().sum();
    expected[ROWS * COLUMNS] = (f64::from(samples) - total).max(0.0);
    if total > f64::from(samples) * 1.01 {
        // The density integrates to more than one: no sampler can have it.
        return ChiSquare { statistic: f64::INFINITY, degrees: 1, p_value: 0.0 };
    }
    chi_square(&observed, &expected)
}

/// ln Γ(x), x > 0 (Lanczos 1964).
fn ln_gamma(x: f64) -> f64 {
    const C: [f64; 6] = [
        76.180_091_729_471_46,
        -86.505_320_329_416_77,
        24.014_098_240_830_91,
        -1.231_739_572_450_155,
        0.120_865_097_386_617_9e-2,
        -0.539_523_938_495_3e-5,
    ];
    let t = x + 5.5;
    let series: f64 = C.iter().enumerate().map(|(i, c)| c / (x + 1.0 + i as f64)).sum();
    (x + 0.5) * t.ln() - t + (2.506_628_274_631_000_5 * (1.000_000_000_190_015 + series) / x).ln()
}

/// The regularised upper incomplete gamma function Q(a, x).
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-14 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        1.0 - sum * scale
    } else {
        // Continued fraction by Lentz's method.
        let mut b = x + 1.0 - a;
        let mut c = 1e300;
        let mut d = 1.0 / b;
        let mut h = d;
        for i in 1..10_000 {
            let an = -f64::from(i) * (f64::from(i) - a);
            b += 2.0;
            d = 1.0 / (an * d + b);
            c = b + an / c;
            let delta = d * c;
            h *= delta;
            if (delta - 1.0).abs() < 1e-14 {
                break;
            }
        }
        scale * h
    }
}

#[cfg(test)]
mod tests {
    use rayburst_math::warp;

    use super::*;

    #[test]
    fn p_values_match_tables() {
        // Upper 5 % and 0.1 % points of the chi-square distribution.
        for (degrees, x, p) in
            [(1, 3.841, 0.05), (10, 18.307, 0.05), (100, 124.342, 0.05), (30, 59.703, 0.001)]
        {
            let q = upper_gamma(0.5 * f64::from(degrees), 0.5 * x);
            assert!((q / p - 1.0).abs() < 0.002, "{degrees} {x}: {q}");
        }
    }

    #[test]
    fn right_densities_pass_and_wrong_ones_fail() {
        let cosine = |rng: &mut Rng| Some(warp::cosine_hemisphere(rng.vec2()));
        let right = test_directions(200_000, 1, cosine, |d| warp::cosine_hemisphere_pdf(d.z));
        assert!(right.passes(), "{right:?}");
        let wrong = test_directions(200_000, 1, cosine, |d| {
            if d.z > 0.0 { std::f32::consts::FRAC_1_PI * 0.5 } else { 0.0 }
        });
        assert!(!wrong.passes(), "{wrong:?}");
        let excessive =
            test_directions(200_000, 1, cosine, |d| 1.05 * warp::cosine_hemisphere_pdf(d.z));
        assert!(!excessive.passes());
        let stray =
            test_directions(1000, 1, |rng| Some(-warp::uniform_hemisphere(rng.vec2())), |_| 0.0);
        assert!(!stray.passes());
    }

    #[test]
    fn moments_of_known_numbers() {
        let m = Moments::of([1.0, 2.0, 3.0, 4.0]);
        assert_eq!(m.mean, 2.5);
        assert!((m.variance() - 5.0 / 3.0).abs() < 1e-12);
        assert!((z_score(&m, 2.5 + 2.0 * m.standard_error()) - 2.0).abs() < 1e-9);
    }
}
