//! HDR-ꟻLIP: the largest LDR-ꟻLIP over all exposures at which the picture may be looked at.
//!
//! Andersson, Nilsson, Shirley, Akenine-Möller: "Visualizing Errors in Rendered High Dynamic Range
//! Images", Eurographics 2021 (short papers). The exposures run from the one that brings the
//! reference's brightest pixel to 0.85 after tone mapping to the one that does so for its median;
//! the tone map is Narkowicz's fit of ACES, as in the authors' tool.
//! Where the median is black, which leaves that range open, the median of the others counts here.

use glam::Vec3;

use super::flip;
use crate::RgbImage;
use crate::colour::{clamp_bad, luminance};

/// Narkowicz's curve `(x (a x + b)) / (x (c x + d) + e)`, with its factor of 0.6 for ACES'
/// exposure written out.
const CURVE: [f32; 5] = [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14];

/// The display value that the brightest pixel and the median are brought to.
const TARGET: f32 = 0.85;

/// The largest value that the curve's squares can take.
const LARGEST: f32 = 1e15;

/// The exposures of a comparison, in stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureRange {
    /// The darkest.
    pub start: f32,
    /// The brightest.
    pub stop: f32,
    /// How many, the ends included.
    pub count: u32,
}

impl ExposureRange {
    /// The range that suits a reference picture.
    pub fn of(reference: &RgbImage) -> Self {
        let mut luminances: Vec<f32> =
            reference.pixels.iter().map(|&p| luminance(clean(p))).collect();
        luminances.sort_unstable_by(f32::total_cmp);
        let lit = luminances.partition_point(|&l| l <= 0.0);
        let Some(&brightest) = luminances[lit..].last() else {
            return Self { start: 0.0, stop: 0.0, count: 2 };
        };
        let median = match luminances[luminances.len() / 2] {
            median if median > 0.0 => median,
            _ => luminances[lit + (luminances.len() - lit) / 2],
        };
        // The positive root of curve(x) = TARGET.
        let [a, b, c, d, e] = CURVE;
        let (a, b, c) = (a - TARGET * c, b - TARGET * d, -TARGET * e);
        let half = -0.5 * b / a;
        let mapped_to_target = half + (half * half - c / a).sqrt();
        let start = (mapped_to_target / brightest).log2();
        let stop = (mapped_to_target / median).log2();
        Self { start, stop, count: (stop - start).ceil().max(2.0) as u32 }
    }

    /// Each exposure in stops.
    pub fn exposures(self) -> impl Iterator<Item = f32> {
        let step = (self.stop - self.start) / (self.count - 1).max(1) as f32;
        (0..self.count).map(move |i| self.start + i as f32 * step)
    }
}

/// HDR-ꟻLIP of each pixel. The pictures are linear and have one size; negative values count as 0.
pub fn hdr_flip(
    reference: &RgbImage,
    test: &RgbImage,
    pixels_per_degree: f32,
    range: ExposureRange,
) -> Vec<f32> {
    let mut largest = vec![0.0f32; reference.pixels.len()];
    for stops in range.exposures() {
        let scale = stops.exp2();
        let [reference, test] = [reference, test].map(|p| p.clone().map(|c| show(c, scale)));
        for (most, here) in largest.iter_mut().zip(flip(&reference, &test, pixels_per_degree)) {
            *most = most.max(here);
        }
    }
    largest
}

fn clean(colour: Vec3) -> Vec3 {
    Vec3::from_array(colour.to_array().map(|v| clamp_bad(v, LARGEST)))
}

fn show(colour: Vec3, scale: f32) -> Vec3 {
    let [a, b, c, d, e] = CURVE;
    let x = clean(clean(colour) * scale);
    (x * (a * x + b)) / (x * (c * x + d) + e)
}
