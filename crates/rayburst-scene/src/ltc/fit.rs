//! Fits of linearly transformed cosines to the GGX lobe: how `table.bin` is made.
//!
//! The fit of Heitz et al. (see [`super`]) with another measure of error: half of ∫|p − q| dω over the
//! hemisphere for the two lobes as densities p and q, each of integral 1. It is the largest error that
//! any light of constant radiance can make, as a share of the lobe's albedo (their total variation
//! distance), and needs samples of one of the two lobes only.
//!
//! Each roughness is fitted by itself, cosine after cosine, every fit beginning where its neighbour's
//! ended: entries next to each other are of the same kind and may be interpolated.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::{
    simplex::minimise,
    table::{COSINES, Entry, Part, ROUGHNESSES, UNITS},
};
use crate::bsdf::{fresnel::schlick_weight, ggx};

/// Points of the lattice rule and its generator: Fibonacci numbers.
const LATTICE: (u32, u32) = (987, 610);
/// Cosines at which the ends of the axis are fitted: exactly grazing lobes are a limit, and at normal
/// incidence two of the numbers do not matter.
const COSINE_LIMITS: (f64, f64) = (1e-4, 0.996);
/// The α that stands for perfectly smooth, a limit, too.
const LEAST_ALPHA: f64 = 4e-4;
/// The column where a row's fit begins; it goes on to both sides.
const FIRST: [usize; 2] = [COSINES - 1, 40];

/// A direction of the lobe in the frame of its mirror direction.
struct Sample {
    direction: DVec3,
    density: f64,
    /// Of all the lobe's light.
    share: f64,
}

/// The lobe to be fitted.
struct Target {
    samples: Vec<Sample>,
    alpha: f64,
    sin: f64,
    cos: f64,
    slope: f64,
}

impl Target {
    fn new(part: Part, column: usize, row: usize) -> Self {
        let x = column as f64 / (COSINES - 1) as f64;
        let roughness = row as f64 / (ROUGHNESSES - 1) as f64;
        Self::of(part, x * x, roughness * roughness)
    }

    fn of(part: Part, cos: f64, alpha: f64) -> Self {
        let cos = cos.clamp(COSINE_LIMITS.0, COSINE_LIMITS.1);
        let alpha = alpha.max(LEAST_ALPHA);
        let sin = (1.0 - cos * cos).sqrt();
        let slope = (alpha * alpha + (1.0 - alpha * alpha) * cos * cos).sqrt();
        let (o, a) = (Vec3::new(sin as f32, 0.0, cos as f32), alpha as f32);
        let (n, generator) = LATTICE;
        let mut samples = Vec::with_capacity(n as usize);
        let mut total = 0.0;
        for i in 0..n {
            // Half a turn is enough, by symmetry.
            let turn = 0.5 * ((i * generator % n) as f32 + 0.5) / n as f32;
            let h = ggx::sample(o, a, Vec2::new(turn, (i as f32 + 0.5) / n as f32));
            let cos_h = o.dot(h);
            let i = 2.0 * cos_h * h - o;
            if i.z <= 0.0 {
                continue;
            }
            let fresnel = match part {
                Part::Normal => 1.0 - schlick_weight(cos_h),
                Part::Grazing => schlick_weight(cos_h),
            };
            let share = f64::from(fresnel * ggx::shadowing(o.z, i.z, a));
            let density = share * f64::from(ggx::reflection_pdf(o.z, h, a));
            let i = i.as_dvec3();
            let direction = DVec3::new(cos * i.x + sin * i.z, i.y, cos * i.z - sin * i.x);
            total += share;
            samples.push(Sample { direction, density, share });
        }
        for sample in &mut samples {
            sample.density *= f64::from(n) / total;
            sample.share /= total;
        }
        Self { samples, alpha, sin, cos, slope }
    }

    /// Total variation distance to the lobe of an entry.
    fn error(&self, &[a, b, s, t, k]: &Entry<f64>) -> f64 {
        let (a, b) = (a / self.alpha, b / (self.alpha * self.slope));
        let (s, t) = (s * self.sin / self.slope, t * self.sin / self.alpha);
        let determinant = b * (a * k - s * t);
        if !(b > 0.0 && determinant > 0.0) {
            return 2.0;
        }
        let (nx, nz) = (k * self.sin - t * self.cos, a * self.cos - s * self.sin);
        let above = 0.5 * (1.0 + nz / nx.hypot(nz));
        let scale = determinant / (std::f64::consts::PI * above.max(1e-9));
        let lacking = |sample: &Sample| {
            let d = sample.direction;
            let v = DVec3::new(a * d.x + s * d.z, b * d.y, t * d.x + k * d.z);
            let density = scale * v.z.max(0.0) / v.length_squared().powi(2);
            sample.share * (1.0 - density / sample.density).max(0.0)
        };
        self.samples.iter().map(lacking).sum()
    }

    fn fit(&self, mut p: [f64; 4], steps: &[f64]) -> [f64; 4] {
        for &step in steps {
            (p, _) = minimise(|&[a, b, s, t]| self.error(&[a, b, s, t, 1.0]), p, step);
        }
        p
    }
}

/// Scaled so that the third row of the matrix has about unit length: finite for lobes whose axis is
/// at right angles to the mirror direction.
fn entry([a, b, s, t]: [f64; 4]) -> Entry<f64> {
    let k = 1.0 / t.hypot(1.0);
    [a * k, b * k, s * k, t * k, k]
}

/// One roughness of the table, as it is in the file.
pub fn fit_row(part: Part, row: usize) -> Vec<u8> {
    let target = |column| Target::new(part, column, row);
    let first = FIRST[part as usize];
    let start = target(first).fit([0.5, 0.5, 0.0, 0.0], &[0.2, 0.1, 0.03]);
    let mut entries = [[0.0; 5]; COSINES];
    entries[first] = entry(start);
    for columns in [(0..first).rev().collect::<Vec<_>>(), (first + 1..COSINES).collect()] {
        let mut p = start;
        for column in columns {
            p = target(column).fit(p, &[0.1, 0.02]);
            entries[column] = entry(p);
        }
    }
    let quantise = |v: f64| (v * UNITS).round().clamp(-32767.0, 32767.0) as i16;
    entries.iter().flatten().flat_map(|&v| quantise(v).to_le_bytes()).collect()
}

/// The whole file.
pub fn fit_all() -> Vec<u8> {
    let rows: Vec<(Part, usize)> =
        Part::ALL.into_iter().flat_map(|p| (0..ROUGHNESSES).map(move |r| (p, r))).collect();
    let fitted: Vec<Vec<u8>> = rows.into_par_iter().map(|(p, r)| fit_row(p, r)).collect();
    fitted.concat()
}
