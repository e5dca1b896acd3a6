//! Pixel reconstruction filters by importance sampling.
//!
//! Ernst, Stamminger, Greiner: "Filter Importance Sampling", RT 2006: a sample's place is drawn
//! with the filter's density around the pixel's centre, its weight is 1, and it belongs to that
//! pixel alone. All filters are separable and non-negative.

use glam::Vec2;

/// A reconstruction filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum FilterKind {
    /// Constant.
    Box,
    /// A triangle.
    Tent,
    /// A Gaussian with a deviation of a third of the radius, lowered to 0 at the radius.
    Gaussian,
    /// The four-term Blackman-Harris window (Harris 1978).
    #[default]
    BlackmanHarris,
}

impl FilterKind {
    /// Every filter by name.
    pub const ALL: [(&'static str, Self); 4] = [
        ("box", Self::Box),
        ("tent", Self::Tent),
        ("gaussian", Self::Gaussian),
        ("blackman-harris", Self::BlackmanHarris),
    ];

    /// The filter of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(n, _)| *n == name).map(|(_, kind)| *kind)
    }

    /// The filter's name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }

    /// The usual radius in pixels.
    pub fn default_radius(self) -> f32 {
        match self {
            Self::Box => 0.5,
            Self::Tent => 1.0,
            Self::Gaussian | Self::BlackmanHarris => 1.5,
        }
    }

    /// The profile at `x` from -1 to 1, not normalised; 0 outside.
    pub fn profile(self, x: f32) -> f32 {
        if x.abs() > 1.0 {
            return 0.0;
        }
        match self {
            Self::Box => 1.0,
            Self::Tent => 1.0 - x.abs(),
            Self::Gaussian => (-4.5 * x * x).exp() - (-4.5f32).exp(),
            Self::BlackmanHarris => {
                let phase = std::f32::consts::PI * (x + 1.0);
                0.358_75 - 0.488_29 * phase.cos() + 0.141_28 * (2.0 * phase).cos()
                    - 0.011_68 * (3.0 * phase).cos()
            }
        }
    }
}

/// Steps of the tabulated distribution.
const STEPS: usize = 512;

/// A filter of some radius, ready to sample.
#[derive(Clone, Debug)]
pub struct PixelFilter {
    kind: FilterKind,
    radius: f32,
    /// The distribution function at -1 + 2 i / STEPS.
    cdf: Vec<f32>,
}

impl PixelFilter {
    /// A filter with its usual radius.
    pub fn new(kind: FilterKind) -> Self {
        Self::with_radius(kind, kind.default_radius())
    }

    /// A filter with a radius in pixels.
    pub fn with_radius(kind: FilterKind, radius: f32) -> Self {
        let mut cdf = vec![0.0f64; STEPS + 1];
        for i in 0..STEPS {
            let middle = (2 * i + 1) as f32 / STEPS as f32 - 1.0;
            cdf[i + 1] = cdf[i] + f64::from(kind.profile(middle));
        }
        let total = cdf[STEPS];
        Self { kind, radius, cdf: cdf.iter().map(|c| (c / total) as f32).collect() }
    }

    /// Which filter it is.
    pub fn kind(&self) -> FilterKind {
        self.kind
    }

    /// Its radius in pixels.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// The offset in pixels from the pixel's centre for a point of the unit square.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Vec2 {
        Vec2::new(self.sample1(u.x), self.sample1(u.y)) * self.radius
    }

    #[inline]
    fn sample1(&self, u: f32) -> f32 {
        match self.kind {
            FilterKind::Box => 2.0 * u - 1.0,
            FilterKind::Tent if u < 0.5 => (2.0 * u).sqrt() - 1.0,
            FilterKind::Tent => 1.0 - (2.0 - 2.0 * u).sqrt(),
            FilterKind::Gaussian | FilterKind::BlackmanHarris => {
                let i = self.cdf[1..STEPS].partition_point(|&c| c <= u);
                let (low, high) = (self.cdf[i], self.cdf[i + 1]);
                let within = if high > low { (u - low) / (high - low) } else { 0.5 };
                (i as f32 + within) * (2.0 / STEPS as f32) - 1.0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayburst_math::hash::Rng;

    #[test]
    fn samples_follow_the_density() {
        for (name, kind) in FilterKind::ALL {
            let filter = PixelFilter::with_radius(kind, 1.25);
            const BINS: usize = 40;
            const SAMPLES: usize = 400_000;
            let mut rng = Rng::new(11);
            let mut counts = [[0u32; BINS]; 2];
            for _ in 0..SAMPLES {
                let offset = filter.sample(rng.vec2()) / 1.25;
                for axis in 0..2 {
                    let bin = ((offset[axis] + 1.0) * 0.5 * BINS as f32) as usize;
                    counts[axis][bin.min(BINS - 1)] += 1;
                }
            }
            // The density of each bin by fine quadrature.
            let fine = |i: usize| kind.profile((i as f32 + 0.5) / 2000.0 - 1.0);
            let total: f32 = (0..4000).map(fine).sum();
            for counts in counts {
                let (mut chi2, mut freedom) = (0.0, -1.0);
                for (bin, &count) in counts.iter().enumerate() {
                    let share: f32 = (bin * 100..bin * 100 + 100).map(fine).sum::<f32>() / total;
                    let expected = f64::from(share) * SAMPLES as f64;
                    if expected > 5.0 {
                        chi2 += (f64::from(count) - expected).powi(2) / expected;
                        freedom += 1.0;
                    }
                }
                // Five standard deviations of the chi-square distribution.
                assert!(
                    chi2 < freedom + 5.0 * (2.0f64 * freedom).sqrt(),
                    "{name}: {chi2} {freedom}"
                );
            }
        }
    }

    #[test]
    fn samples_stay_within_the_radius_and_are_symmetric() {
        for (name, kind) in FilterKind::ALL {
            let filter = PixelFilter::new(kind);
            for i in 0..=1000 {
                let u = (i as f32 / 1000.0).min(1.0 - f32::EPSILON / 2.0);
                let a = filter.sample(Vec2::new(u, 1.0 - u));
                assert!(a.abs().max_element() <= kind.default_radius(), "{name} {a}");
                assert!((a.x + a.y).abs() < 5e-3, "{name} {a}");
            }
            assert_eq!(FilterKind::from_name(name), Some(kind));
            assert_eq!(kind.name(), name);
        }
    }

    #[test]
    fn profiles_end_at_zero() {
        for kind in [FilterKind::Tent, FilterKind::Gaussian, FilterKind::BlackmanHarris] {
            assert!(kind.profile(1.0).abs() < 1e-4 && kind.profile(0.0) > 0.9, "{kind:?}");
        }
    }
}
