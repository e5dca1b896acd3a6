//! Radiance from infinity and directions sampled in proportion to it.
//!
//! Pharr, Jakob, Humphreys: "Physically Based Rendering", 4th ed., section 12.5. Maps are interpolated
//! bilinearly; the density is constant over a texel and proportional to the mean of the interpolated
//! luminance there times the sine of the polar angle, so that nothing bright has density zero.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use rayburst_math::{distribution::Distribution2d, warp};
use rayon::prelude::*;

use crate::{Environment, environment::EnvironmentMap};

/// Luminance of linear Rec. 709.
#[inline]
pub(super) fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Wider maps are sampled by the means of square blocks of texels.
const MAX_COLUMNS: u32 = 2048;

impl EnvironmentMap {
    /// Radiance from a unit direction, interpolated, cd/m².
    #[inline]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        self.radiance_at(self.uv_of(direction))
    }

    /// Radiance from the direction of a point of the picture, interpolated, cd/m².
    #[inline]
    pub(super) fn radiance_at(&self, uv: Vec2) -> Vec3 {
        let (width, height) = (self.size.0 as i32, self.size.1 as i32);
        let x = uv.x * width as f32 - 0.5;
        let y = uv.y * height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let (x0, y0) = (x0 as i32, y0 as i32);
        let column = |x: i32| {
            if x < 0 {
                x + width
            } else if x >= width {
                x - width
            } else {
                x
            }
        };
        let (left, right) = (column(x0), column(x0 + 1));
        let row = |y: i32| {
            let row = y.clamp(0, height - 1) * width;
            self.texels[(row + left) as usize].lerp(self.texels[(row + right) as usize], fx)
        };
        row(y0).lerp(row(y0 + 1), fy) * self.intensity
    }
}

impl Environment {
    /// Radiance from a unit direction, cd/m².
    #[inline]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match self {
            Self::None => Vec3::ZERO,
            Self::Constant(radiance) => *radiance,
            Self::Map(map) => map.radiance(direction),
        }
    }
}

/// Samples the directions of an environment.
#[derive(Clone, Debug)]
pub(super) enum EnvironmentSampler {
    None,
    Uniform,
    Map(Distribution2d),
}

impl EnvironmentSampler {
    /// The sampler and the integral of the luminance over all directions.
    pub(super) fn new(environment: &Environment) -> (Self, f32) {
        match environment {
            Environment::None => (Self::None, 0.0),
            Environment::Constant(radiance) => {
                let total = 4.0 * PI * luminance(*radiance);
                (if total > 0.0 { Self::Uniform } else { Self::None }, total)
            }
            Environment::Map(map) => {
                let (weights, columns) = weights(map);
                let distribution = Distribution2d::new(&weights, columns);
                let texel = 2.0 * PI * PI / weights.len() as f32;
                let total = distribution.total() * texel * map.intensity;
                if total > 0.0 { (Self::Map(distribution), total) } else { (Self::None, 0.0) }
            }
        }
    }

    /// A direction, its density per solid angle, and the radiance from there.
    pub(super) fn sample(&self, environment: &Environment, u: Vec2) -> Option<(Vec3, f32, Vec3)> {
        match (self, environment) {
            (Self::Uniform, _) => {
                let direction = warp::uniform_sphere(u);
                Some((direction, 0.25 / PI, environment.radiance(direction)))
            }
            (Self::Map(distribution), Environment::Map(map)) => {
                let (uv, pdf) = distribution.sample(u)?;
                let (direction, sine) = map.direction_and_sine_of(uv);
                let pdf = pdf / (2.0 * PI * PI * sine);
                (sine > 0.0).then(|| (direction, pdf, map.radiance_at(uv)))
            }
            _ => None,
        }
    }

    /// The radiance from a direction, and the density with which it is sampled.
    pub(super) fn found(&self, environment: &Environment, direction: Vec3) -> (Vec3, f32) {
        match (self, environment) {
            (Self::Map(distribution), Environment::Map(map)) => {
                let uv = map.uv_of(direction);
                (map.radiance_at(uv), density(distribution, uv))
            }
            _ => (environment.radiance(direction), self.pdf(environment, direction)),
        }
    }

    /// Density of [`EnvironmentSampler::sample`].
    pub(super) fn pdf(&self, environment: &Environment, direction: Vec3) -> f32 {
        match (self, environment) {
            (Self::Uniform, _) => 0.25 / PI,
            (Self::Map(distribution), Environment::Map(map)) => {
                density(distribution, map.uv_of(direction))
            }
            _ => 0.0,
        }
    }
}

/// Density per solid angle of a point of the map.
fn density(distribution: &Distribution2d, uv: Vec2) -> f32 {
    let sine = (uv.y * PI).sin();
    if sine > 0.0 { distribution.pdf(uv) / (2.0 * PI * PI * sine) } else { 0.0 }
}

/// Weights of a grid over the map, and its columns.
fn weights(map: &EnvironmentMap) -> (Vec<f32>, usize) {
    let (width, height) = (map.size.0 as usize, map.size.1 as usize);
    let block = map.size.0.div_ceil(MAX_COLUMNS) as usize;
    let (columns, rows) = (width.div_ceil(block), height.div_ceil(block));
    // Luminance by rows, smoothed as interpolation spreads a texel: 1/8, 6/8, 1/8.
    let value = |x: usize, y: usize| luminance(map.texels[y * width + x].max(Vec3::ZERO));
    let across = |x: usize, y: usize| {
        let (left, right) = ((x + width - 1) % width, (x + 1) % width);
        0.125 * (value(left, y) + value(right, y)) + 0.75 * value(x, y)
    };
    let smooth = |x: usize, y: usize| {
        let (up, down) = (y.saturating_sub(1), (y + 1).min(height - 1));
        0.125 * (across(x, up) + across(x, down)) + 0.75 * across(x, y)
    };
    let weights = (0..columns * rows)
        .into_par_iter()
        .map(|i| {
            let (column, row) = (i % columns, i / columns);
            // The grid divides the map evenly, so a cell may end within a texel: take all it touches.
            let xs = column * width / columns..((column + 1) * width).div_ceil(columns);
            let ys = row * height / rows..((row + 1) * height).div_ceil(rows);
            let count = (xs.len() * ys.len()) as f32;
            let sum: f32 = ys.flat_map(|y| xs.clone().map(move |x| smooth(x, y))).sum();
            sum / count * (PI * (row as f32 + 0.5) / rows as f32).sin()
        })
        .collect();
    (weights, columns)
}

#[cfg(test)]
mod tests {
    use rayburst_math::hash::Rng;
    use rayburst_testkit::statistics::{Moments, test_directions, z_score};

    use super::*;

    fn map(rotation: f32) -> EnvironmentMap {
        let (w, h) = (32, 16);
        let mut rng = Rng::new(8);
        let texels = (0..w * h)
            .map(|i| if i % 5 == 0 { rng.vec3() * 4.0 } else { Vec3::splat(0.1) * rng.f32() })
            .collect();
        EnvironmentMap { texels, size: (w, h), rotation, intensity: 2.5 }
    }

    #[test]
    fn directions_follow_their_density() {
        for environment in [
            Environment::Constant(Vec3::ONE),
            Environment::Map(map(0.0)),
            Environment::Map(map(2.0)),
        ] {
            let (sampler, _) = EnvironmentSampler::new(&environment);
            let test = test_directions(
                200_000,
                9,
                |rng| sampler.sample(&environment, rng.vec2()).map(|s| s.0),
                |d| sampler.pdf(&environment, d),
            );
            assert!(test.passes(), "{test:?}");
        }
    }

    #[test]
    fn sampled_and_uniform_integrals_agree() {
        let environment = Environment::Map(map(1.0));
        let (sampler, total) = EnvironmentSampler::new(&environment);
        let mut rng = Rng::new(10);
        let mut other_texel = 0;
        let sampled = Moments::of((0..100_000).filter_map(|_| {
            let (d, pdf, radiance) = sampler.sample(&environment, rng.vec2())?;
            // Rounding may carry a direction over the edge of a texel.
            other_texel += u32::from((pdf / sampler.pdf(&environment, d) - 1.0).abs() > 0.01);
            let seen = environment.radiance(d);
            other_texel += u32::from((radiance - seen).length() > 1e-3 * radiance.length());
            assert_eq!(sampler.found(&environment, d), (seen, sampler.pdf(&environment, d)));
            Some(f64::from(luminance(environment.radiance(d)) / pdf))
        }));
        assert!(other_texel < 50, "{other_texel}");
        let uniform = Moments::of((0..100_000).map(|_| {
            let d = warp::uniform_sphere(rng.vec2());
            f64::from(luminance(environment.radiance(d)) * 4.0 * PI)
        }));
        let error = sampled.standard_error().hypot(uniform.standard_error());
        assert!((sampled.mean - uniform.mean).abs() < 5.0 * error);
        assert!(sampled.standard_error() < 0.8 * uniform.standard_error());
        assert!(z_score(&sampled, f64::from(total)) < 8.0, "{total} {sampled:?}");
    }

    #[test]
    fn black_environments_are_not_sampled() {
        let mut black = map(0.0);
        black.texels = vec![Vec3::ZERO; 512].into();
        for environment in
            [Environment::None, Environment::Constant(Vec3::ZERO), Environment::Map(black)]
        {
            let (sampler, total) = EnvironmentSampler::new(&environment);
            assert_eq!(total, 0.0);
            assert!(sampler.sample(&environment, Vec2::splat(0.5)).is_none());
            assert_eq!(sampler.pdf(&environment, Vec3::Y), 0.0);
        }
    }
}
