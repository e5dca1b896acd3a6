//! How far apart two pictures are.
//!
//! `rmse`, `relmse`, `psnr` and `ssim` are computed on the values as files store them: sRGB from 0
//! to 1 for PNG and JPEG, linear for EXR, HDR and PFM; `psnr` and `ssim` take 1 as the range.
//! `flip` compares what a screen shows, clipped to 0 to 1; `hdr-flip` looks at all exposures.
//! The numbers agree with scikit-image and with the ꟻLIP authors' tool.

mod convolve;
mod errors;
mod flip;
mod ssim;

pub use errors::{mse, psnr, relmse, relmse_map, rmse, rmse_map};
pub use flip::{ExposureRange, PIXELS_PER_DEGREE, flip, hdr_flip};
pub use ssim::ssim;

use crate::colour::srgb_encode3;
use crate::falsecolour::ColourMap;
use crate::{ImageError, Result, Rgb8Image, RgbImage};

/// A measure of difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Metric {
    /// LDR-ꟻLIP; 0 is equal, 1 the worst.
    Flip,
    /// HDR-ꟻLIP; 0 is equal, 1 the worst.
    HdrFlip,
    /// Root mean square error.
    Rmse,
    /// Relative mean square error.
    RelMse,
    /// Peak signal to noise ratio in decibels; larger is better.
    Psnr,
    /// Structural similarity; 1 is equal.
    Ssim,
}

impl Metric {
    /// Every metric by name.
    pub const ALL: [(&'static str, Self); 6] = [
        ("flip", Self::Flip),
        ("hdr-flip", Self::HdrFlip),
        ("rmse", Self::Rmse),
        ("relmse", Self::RelMse),
        ("psnr", Self::Psnr),
        ("ssim", Self::Ssim),
    ];

    /// The metric of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(n, _)| *n == name).map(|(_, metric)| *metric)
    }

    /// The metric's name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, metric)| *metric == self).map_or("", |(name, _)| name)
    }
}

/// What the stored values of the compared files mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoredAs {
    /// Linear radiance: EXR, HDR, PFM.
    Linear,
    /// sRGB: PNG, JPEG.
    Srgb,
}

/// The outcome of a comparison.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Which metric.
    pub metric: Metric,
    /// The number for the whole picture.
    pub value: f64,
    /// Width of the map.
    pub width: u32,
    /// Height of the map.
    pub height: u32,
    /// Each pixel's error, larger is worse, row by row. For `ssim` it is 1 less the index, for
    /// `psnr` that of `rmse`.
    pub map: Vec<f32>,
}

impl Comparison {
    /// The map in magma's colours: black where equal, bright where the error is 1 (`flip`,
    /// `hdr-flip`, `ssim`) or that of the worst hundredth of all pixels (the others).
    pub fn heat_map(&self) -> Rgb8Image {
        let fixed = matches!(self.metric, Metric::Flip | Metric::HdrFlip | Metric::Ssim);
        let brightest = if fixed { 1.0 } else { percentile(&self.map, 0.99) };
        ColourMap::Magma.apply(self.width, self.height, &self.map, 0.0, brightest)
    }
}

/// Compares a picture with a reference; both linear, as read. Fails where sizes differ or a value
/// is not finite.
pub fn compare(
    metric: Metric,
    reference: &RgbImage,
    test: &RgbImage,
    stored: StoredAs,
) -> Result<Comparison> {
    reference.check_same_size(test)?;
    check_finite("the reference", reference)?;
    check_finite("the tested picture", test)?;
    let as_stored = |picture: &RgbImage| match stored {
        StoredAs::Linear => picture.clone(),
        StoredAs::Srgb => picture.clone().map(srgb_encode3),
    };
    let average = |map: &[f32]| map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len() as f64;
    let (value, map) = match metric {
        Metric::Flip => {
            let map = flip(reference, test, PIXELS_PER_DEGREE);
            (average(&map), map)
        }
        Metric::HdrFlip => {
            let range = ExposureRange::of(reference);
            let map = hdr_flip(reference, test, PIXELS_PER_DEGREE, range);
            (average(&map), map)
        }
        _ => {
            let (a, b) = (as_stored(reference), as_stored(test));
            match metric {
                Metric::RelMse => (relmse(&a, &b), relmse_map(&a, &b)),
                Metric::Psnr => (psnr(&a, &b), rmse_map(&a, &b)),
                Metric::Ssim => {
                    let (value, mut map) = ssim(&a, &b)?;
                    map.iter_mut().for_each(|s| *s = 1.0 - *s);
                    (value, map)
                }
                _ => (rmse(&a, &b), rmse_map(&a, &b)),
            }
        }
    };
    Ok(Comparison { metric, value, width: reference.width, height: reference.height, map })
}

fn check_finite(what: &str, picture: &RgbImage) -> Result<()> {
    let bad = picture.pixels.iter().filter(|p| !p.is_finite()).count();
    let Some(first) = picture.pixels.iter().position(|p| !p.is_finite()) else { return Ok(()) };
    let (x, y) = (first % picture.width as usize, first / picture.width as usize);
    Err(ImageError::Invalid(format!(
        "{what} has {bad} pixels that are not finite numbers, the first at ({x}, {y})"
    )))
}

fn percentile(values: &[f32], share: f32) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let at = (sorted.len() as f32 * share) as usize;
    sorted.get(at).or(sorted.last()).copied().unwrap_or(1.0).max(f32::MIN_POSITIVE)
}
