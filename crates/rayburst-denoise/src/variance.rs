//! Variance of numbers that come one after another.
//!
//! Sums of squares cancel where the mean is large; the running forms here do not: Eq. 26.7 to 26.9 of
//! Akenine-Möller et al.: "Real-Time Rendering", 4th edition, online chapter "Real-Time Ray Tracing" (2018),
//! after Welford: "Note on a Method for Calculating Corrected Sums of Squares and Products" (1962). Two runs
//! are merged as in Chan, Golub, LeVeque: "Updating Formulae and a Pairwise Algorithm for Computing Sample
//! Variances" (1979).

use rayburst_image::Plane;

use crate::{Result, reprojection::same_size};

/// Number, mean and summed squared deviations of the numbers so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RunningVariance {
    count: u64,
    mean: f64,
    deviations: f64,
}

impl RunningVariance {
    /// Without numbers.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes a number in; one that is not finite is passed over.
    #[inline]
    pub fn push(&mut self, value: f64) {
        if value.is_finite() {
            self.count += 1;
            let before = value - self.mean;
            self.mean += before / self.count as f64;
            self.deviations += before * (value - self.mean);
        }
    }

    /// Takes in all numbers of another.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let (a, b) = (self.count as f64, other.count as f64);
        let apart = other.mean - self.mean;
        self.count += other.count;
        self.mean += apart * (b / (a + b));
        self.deviations += other.deviations + apart * apart * (a * b / (a + b));
    }

    /// How many numbers.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Their mean; zero without any.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Their mean squared deviation (divided by n); zero without any.
    pub fn population(&self) -> f64 {
        self.deviations / self.count.max(1) as f64
    }

    /// The variance of what they are samples of (divided by n − 1); zero with less than two.
    pub fn sample(&self) -> f64 {
        self.deviations / self.count.saturating_sub(1).max(1) as f64
    }

    /// The variance of their mean (divided by n (n − 1)); zero with less than two.
    pub fn of_mean(&self) -> f64 {
        self.sample() / self.count.max(1) as f64
    }
}

/// Moves a mean and a variance (divided by n) by a new number of weight `alpha` (0 to 1); the same as
/// [`RunningVariance`] if `alpha` is one over the count. What is returned is the new mean and the new
/// variance, which is not negative.
#[inline(always)]
pub fn blend_variance(mean: f32, variance: f32, value: f32, alpha: f32) -> (f32, f32) {
    let apart = value - mean;
    let step = alpha * apart;
    // The mean is exact where all of the weight is the new number's, however large the old one is.
    let keeps = 1.0 - alpha;
    (keeps * mean + alpha * value, keeps * (variance + step * apart))
}

/// A running variance of every pixel.
#[derive(Clone, Debug)]
pub struct VariancePlane {
    runs: Plane<RunningVariance>,
}

impl VariancePlane {
    /// Without numbers. Fails where the picture would be empty or too large.
    pub fn new(width: u32, height: u32) -> Result<Self> {
        Ok(Self { runs: Plane::new(width, height)? })
    }

    /// Takes a number in at every pixel. Fails where sizes differ.
    pub fn push(&mut self, values: &Plane) -> Result<()> {
        same_size("the values", values.size(), self.runs.size())?;
        for y in 0..values.height() {
            for (run, value) in self.runs.row_mut(y).iter_mut().zip(values.row(y)) {
                run.push(f64::from(*value));
            }
        }
        Ok(())
    }

    /// Takes in all numbers of another. Fails where sizes differ.
    pub fn merge(&mut self, other: &Self) -> Result<()> {
        same_size("the other variance", other.runs.size(), self.runs.size())?;
        for (run, other) in self.runs.values_mut().iter_mut().zip(other.runs.values()) {
            run.merge(other);
        }
        Ok(())
    }

    /// What is known of a pixel. Panics outside the picture.
    pub fn get(&self, x: u32, y: u32) -> RunningVariance {
        self.runs.get(x, y)
    }
}
