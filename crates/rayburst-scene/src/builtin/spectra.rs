//! From measured spectra to linear Rec. 709.
//!
//! Colour matching functions: Wyman, Sloan, Shirley: "Simple Analytic Approximations to the CIE XYZ
//! Color Matching Functions", JCGT 2013, the multi-lobe fit (eq. 4). XYZ to Rec. 709: IEC
//! 61966-2-1. Wavelengths in nm.

use glam::{DVec3, Vec3};

/// Step of the integral, nm.
const STEP: f64 = 1.0;

/// A spectrum sampled at equal steps, linear in between.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spectrum {
    /// Wavelength of the first sample.
    pub(super) first: f64,
    /// Distance between samples.
    pub(super) step: f64,
    /// The samples.
    pub(super) values: &'static [f64],
}

impl Spectrum {
    fn at(&self, wavelength: f64) -> f64 {
        let x = ((wavelength - self.first) / self.step).clamp(0.0, (self.values.len() - 1) as f64);
        let i = (x as usize).min(self.values.len() - 2);
        let f = x - i as f64;
        self.values[i] * (1.0 - f) + self.values[i + 1] * f
    }
}

/// The colour of light of a spectrum, at luminance 1.
pub(super) fn light(emission: &Spectrum) -> Vec3 {
    let xyz = integrate(|w| emission.at(w));
    to_rec709(xyz / xyz.y).as_vec3()
}

/// The reflectance that, multiplied with [`light`] channel by channel, gives the colour that the
/// surface has under this very light: exact for light that is reflected once. Colours outside
/// Rec. 709 are clamped.
pub(super) fn reflectance(surface: &Spectrum, emission: &Spectrum) -> Vec3 {
    let lit = to_rec709(integrate(|w| emission.at(w) * surface.at(w)));
    let light = to_rec709(integrate(|w| emission.at(w)));
    (lit / light).as_vec3().clamp(Vec3::ZERO, Vec3::ONE)
}

/// ∫ spectrum · (x̄, ȳ, z̄) dλ over 400…700 nm, where the data are.
fn integrate(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    let steps = (300.0 / STEP) as u32;
    (0..steps)
        .map(|i| {
            let wavelength = 400.0 + (f64::from(i) + 0.5) * STEP;
            matching(wavelength) * (spectrum(wavelength) * STEP)
        })
        .sum()
}

/// The CIE 1931 2° colour matching functions.
fn matching(wavelength: f64) -> DVec3 {
    // A Gaussian lobe with different widths (given as inverses) on its two sides.
    let lobe = |height: f64, centre: f64, below: f64, above: f64| {
        let t = (wavelength - centre) * if wavelength < centre { below } else { above };
        height * (-0.5 * t * t).exp()
    };
    DVec3::new(
        lobe(0.362, 442.0, 0.0624, 0.0374)
            + lobe(1.056, 599.8, 0.0264, 0.0323)
            + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    )
}

fn to_rec709(xyz: DVec3) -> DVec3 {
    DVec3::new(
        DVec3::new(3.240_969_942, -1.537_383_178, -0.498_610_760).dot(xyz),
        DVec3::new(-0.969_243_636, 1.875_967_502, 0.041_555_057).dot(xyz),
        DVec3::new(0.055_630_080, -0.203_976_959, 1.056_971_514).dot(xyz),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: Spectrum = Spectrum { first: 400.0, step: 300.0, values: &[0.5, 0.5] };

    #[test]
    fn matching_functions_peak_where_the_tables_do() {
        // CIE 1931: ȳ(555) = 1, x̄(600) = 1.0622, z̄(445) = 1.7826.
        assert!((matching(555.0).y - 1.0).abs() < 0.02);
        assert!((matching(600.0).x - 1.0622).abs() < 0.02);
        assert!((matching(445.0).z - 1.7826).abs() < 0.04);
    }

    #[test]
    fn equal_energy_has_equal_tristimulus_values() {
        let xyz = integrate(|_| 1.0);
        assert!((xyz / xyz.y - DVec3::ONE).abs().max_element() < 0.02, "{xyz}");
    }

    #[test]
    fn grey_reflects_evenly_and_light_has_unit_luminance() {
        assert!(reflectance(&FLAT, &FLAT).abs_diff_eq(Vec3::splat(0.5), 1e-6));
        let y = light(&FLAT).dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((y - 1.0).abs() < 1e-3, "{y}");
    }
}
