//! The decisions of the path estimator: weights of the techniques, survival.

use rayburst_math::glam::Vec3;
use rayburst_scene::LightSample;

use crate::LightSampling;

/// From this depth on paths may end at random.
pub(crate) const ROULETTE_DEPTH: u32 = 4;

/// The weight of light that a path happened to meet: `pdf` is the density of its direction, infinite
/// if nothing else could have found it, `light_pdf` that of light sampling, 0 if that never finds it.
#[inline]
pub(crate) fn found_weight(
    sampling: LightSampling,
    pdf: f32,
    light_pdf: impl FnOnce() -> f32,
) -> f32 {
    if pdf == f32::INFINITY || sampling == LightSampling::BsdfOnly {
        return 1.0;
    }
    let light_pdf = light_pdf();
    match sampling {
        LightSampling::LightOnly => f32::from(u8::from(light_pdf <= 0.0)),
        _ => pdf / (pdf + light_pdf),
    }
}

/// The weight of light that light sampling found: `pdf` is the density with which the BSDF would have
/// chosen its direction.
#[inline]
pub(crate) fn sampled_weight(sampling: LightSampling, light: &LightSample, pdf: f32) -> f32 {
    match sampling {
        _ if light.delta => 1.0,
        LightSampling::Both => light.pdf / (light.pdf + pdf),
        LightSampling::LightOnly => 1.0,
        LightSampling::BsdfOnly => 0.0,
    }
}

/// The probability that a path of this throughput goes on.
#[inline]
pub(crate) fn survival(throughput: Vec3) -> f32 {
    throughput.max_element().clamp(0.05, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(pdf: f32, delta: bool) -> LightSample {
        LightSample { direction: Vec3::Y, distance: 1.0, radiance: Vec3::ONE, pdf, delta }
    }

    #[test]
    fn the_weights_of_a_direction_sum_to_one() {
        for sampling in [LightSampling::Both, LightSampling::LightOnly, LightSampling::BsdfOnly] {
            for (light_pdf, pdf) in [(0.3, 2.0), (1e-6, 5.0), (1e6, 0.1)] {
                let light = light(light_pdf, false);
                let sum = found_weight(sampling, pdf, || light_pdf)
                    + sampled_weight(sampling, &light, pdf);
                assert!((sum - 1.0).abs() < 1e-6, "{sampling:?}: {sum}");
            }
            // What light sampling never finds counts in full, and so does what only it finds.
            assert_eq!(found_weight(sampling, f32::INFINITY, || 1.0), 1.0);
            assert_eq!(found_weight(sampling, 0.5, || 0.0), 1.0);
            assert_eq!(sampled_weight(sampling, &light(1.0, true), 0.4), 1.0);
        }
    }
}
