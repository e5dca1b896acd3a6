//! The frame's picture out of its signals.

use rayburst_image::{Plane, Plane3};
use rayburst_math::glam::Vec3;
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, GBuffer},
    signals::{Signals, guarded},
};

/// What is added up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompositeParameters {
    /// Radiance from everywhere that stands for what longer paths would bring, before ambient occlusion.
    pub ambient: Vec3,
    /// Whether what shines, and the sky, is shown.
    pub emission: bool,
}

/// Adds up the signals of a frame: colours times light, and what shines.
pub fn composite(
    gbuffer: &GBuffer,
    signals: &Signals,
    parameters: &CompositeParameters,
    picture: &mut Plane3,
) {
    let (width, height) = picture.size();
    let bands: Vec<_> = picture.bands_mut(BAND).collect();
    bands.into_par_iter().enumerate().for_each(|(band, mut rows)| {
        let band = band as u32;
        for y in band * BAND..(band * BAND + BAND).min(height) {
            for x in 0..width {
                let ambient = parameters.ambient * signals.ambient_occlusion.get(x, y);
                let diffuse = signals.direct_diffuse.get(x, y) + signals.indirect_diffuse.get(x, y);
                let specular =
                    signals.direct_specular.get(x, y) + signals.indirect_specular.get(x, y);
                let (broad, glossy) =
                    (signals.diffuse_reflectance.get(x, y), signals.specular_reflectance.get(x, y));
                let mut sum = Vec3::ZERO;
                if broad + glossy != Vec3::ZERO {
                    sum += guarded(broad) * diffuse + guarded(glossy) * specular;
                    sum += broad * ambient;
                }
                sum += signals.transparency.get(x, y);
                if parameters.emission {
                    sum += gbuffer.emitted.get(x, y);
                }
                rows.set(x, y, sum);
            }
        }
    });
}

/// The variance of the luminance of all demodulated light in the 3×3 pixels around each.
pub fn variance(signals: &Signals, out: &mut Plane) {
    let (width, height) = out.size();
    let luminance = |x: i32, y: i32| {
        let (x, y) = (x.clamp(0, width as i32 - 1) as u32, y.clamp(0, height as i32 - 1) as u32);
        let sum = signals.direct_diffuse.get(x, y)
            + signals.direct_specular.get(x, y)
            + signals.indirect_diffuse.get(x, y)
            + signals.indirect_specular.get(x, y);
        sum.dot(Vec3::new(0.2126, 0.7152, 0.0722))
    };
    let bands: Vec<_> = out.bands_mut(BAND).collect();
    bands.into_par_iter().enumerate().for_each(|(band, mut rows)| {
        let band = band as u32;
        for y in (band * BAND) as i32..((band * BAND + BAND).min(height)) as i32 {
            for x in 0..width as i32 {
                let (mut sum, mut squares) = (0.0f32, 0.0f32);
                for dy in -1..=1 {
                    for dx in -1..=1 {
                        let value = luminance(x + dx, y + dy);
                        sum += value;
                        squares += value * value;
                    }
                }
                let mean = sum / 9.0;
                rows.set(x as u32, y as u32, (squares / 9.0 - mean * mean).max(0.0));
            }
        }
    });
}
