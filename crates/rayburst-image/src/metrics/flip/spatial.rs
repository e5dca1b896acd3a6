//! The colour pipeline: what the eye resolves of each opponent channel, and how far apart two
//! colours then seem (paper section 4.1).

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use super::super::convolve::Plane;
use super::colour::{hyab, linear_to_hunt_lab, opponent_to_linear};

/// Weight and scale (squared degrees) of the contrast sensitivity's Gaussians, table 1.
const Y: (f32, f32) = (1.0, 0.0047);
const CX: (f32, f32) = (1.0, 0.0053);
const CZ: [(f32, f32); 2] = [(34.1, 0.04), (13.5, 0.025)];

/// The exponent of the colour distance, and where its range is bent: 0.4 of it becomes 0.95.
const POWER: f32 = 0.7;
const BEND_AT: f32 = 0.4;
const BEND_TO: f32 = 0.95;

/// The perceived colour difference of each pixel, 0 to 1, of two pictures in Y Cx Cz.
pub(super) fn colour_difference(
    reference: &[Plane<f32>; 3],
    test: &[Plane<f32>; 3],
    pixels_per_degree: f32,
) -> Vec<f32> {
    let [reference, test] = [reference, test].map(|p| perceived(p, pixels_per_degree));
    let [green, blue] = [Vec3::Y, Vec3::Z].map(linear_to_hunt_lab);
    let largest = hyab(green, blue).powf(POWER);
    let bend = BEND_AT * largest;
    let redistribute = |distance: f32| {
        if distance < bend {
            distance * (BEND_TO / bend)
        } else {
            BEND_TO + (distance - bend) / (largest - bend) * (1.0 - BEND_TO)
        }
    };
    reference.par_iter().zip(&test).map(|(a, b)| redistribute(hyab(*a, *b).powf(POWER))).collect()
}

/// Filters the planes and goes on to Hunt-adjusted L*a*b*.
fn perceived(planes: &[Plane<f32>; 3], pixels_per_degree: f32) -> Vec<Vec3> {
    let widest = CZ[0].1;
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
    let gaussian = |(weight, scale): (f32, f32), separated: bool| -> Vec<f32> {
        let height = weight * (PI / scale).sqrt();
        let height = if separated { height.sqrt() } else { height };
        let degrees = |x: i32| x as f32 / pixels_per_degree;
        (-radius..=radius)
            .map(|x| height * (-PI * PI * degrees(x) * degrees(x) / scale).exp())
            .collect()
    };
    let normalised = |mut kernel: Vec<f32>| {
        let sum: f32 = kernel.iter().sum();
        kernel.iter_mut().for_each(|k| *k /= sum);
        kernel
    };
    let [y, cx] = [Y, CX].map(|g| normalised(gaussian(g, false)));
    // Together the two Gaussians of blue-yellow sum to one over the plane.
    let mut cz = CZ.map(|g| gaussian(g, true));
    let sums = cz.each_ref().map(|k| k.iter().sum::<f32>());
    let norm = (sums[0] * sums[0] + sums[1] * sums[1]).sqrt();
    cz.iter_mut().flatten().for_each(|k| *k /= norm);

    let luma = planes[0].convolve(&y, &y);
    let red_green = planes[1].convolve(&cx, &cx);
    let wide = planes[2].convolve(&cz[0], &cz[0]);
    let narrow = planes[2].convolve(&cz[1], &cz[1]);
    (0..luma.values.len())
        .into_par_iter()
        .map(|i| {
            let cz = wide.values[i] + narrow.values[i];
            let linear = opponent_to_linear(Vec3::new(luma.values[i], red_green.values[i], cz));
            linear_to_hunt_lab(linear.clamp(Vec3::ZERO, Vec3::ONE))
        })
        .collect()
}
