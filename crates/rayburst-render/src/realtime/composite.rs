//! The frame's picture out of its signals.

use rayburst_image::{Plane, Plane3};
use rayburst_math::glam::Vec3;
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, GBuffer},
    signals::{LEAST_REFLECTANCE, Signals},
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
            let occlusion = signals.ambient_occlusion.row(y);
            let out = rows.row_mut(y);
            for (channel, out) in out.into_iter().enumerate() {
                let row = |plane| Plane3::channel_row(plane, channel, y);
                let (broad, glossy) =
                    (row(&signals.diffuse_reflectance), row(&signals.specular_reflectance));
                let lights = lights(signals, channel, y);
                let analytic = [
                    signals.analytic_diffuse.channel_row(channel, y),
                    signals.analytic_specular.channel_row(channel, y),
                ];
                let shadow = signals.shadow.row(y);
                let transparency = signals.transparency.channel_row(channel, y);
                let emitted = gbuffer.emitted.channel_row(channel, y);
                let ambient = parameters.ambient[channel];
                let shown = if parameters.emission { 1.0 } else { 0.0 };
                for x in 0..width as usize {
                    let diffuse = lights[0][x] + lights[1][x] + analytic[0][x] * shadow[x];
                    let specular = lights[2][x] + lights[3][x] + analytic[1][x] * shadow[x];
                    let scattered = broad[x].max(LEAST_REFLECTANCE) * diffuse
                        + glossy[x].max(LEAST_REFLECTANCE) * specular;
                    let around = broad[x] * ambient * occlusion[x];
                    out[x] = scattered + around + transparency[x] + shown * emitted[x];
                }
            }
        }
    });
}

/// A row of one channel of all demodulated light: diffuse direct and indirect, specular direct and
/// indirect.
fn lights(signals: &Signals, channel: usize, y: u32) -> [&[f32]; 4] {
    [
        signals.direct_diffuse.channel_row(channel, y),
        signals.indirect_diffuse.channel_row(channel, y),
        signals.direct_specular.channel_row(channel, y),
        signals.indirect_specular.channel_row(channel, y),
    ]
}

/// The variance of the luminance of all demodulated light in the 3×3 pixels around each.
pub fn variance(signals: &Signals, out: &mut Plane) {
    let (width, height) = out.size();
    let (last, width) = (height as i32 - 1, width as usize);
    let luminances = |y: i32, into: &mut Vec<[f32; 2]>| {
        into.clear();
        into.resize(width, [0.0; 2]);
        let y = y.clamp(0, last) as u32;
        for (channel, weight) in [0.2126, 0.7152, 0.0722].into_iter().enumerate() {
            let lights = lights(signals, channel, y);
            for (x, value) in into.iter_mut().enumerate() {
                let sum = lights[0][x] + lights[1][x] + lights[2][x] + lights[3][x];
                value[0] += weight * sum;
            }
        }
        for value in into {
            value[1] = value[0] * value[0];
        }
    };
    let bands: Vec<_> = out.bands_mut(BAND).collect();
    bands.into_par_iter().enumerate().for_each_init(
        <[Vec<[f32; 2]>; 3]>::default,
        |rows, (i, mut out)| {
            let top = i as i32 * BAND as i32;
            for (row, y) in rows.iter_mut().zip(top - 1..) {
                luminances(y, row);
            }
            for y in top..top + out.rows() as i32 {
                let row = out.row_mut(y as u32);
                for (x, value) in row.iter_mut().enumerate() {
                    let columns = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
                    let mut sum = [0.0f32; 2];
                    for row in &*rows {
                        for &column in &columns {
                            sum[0] += row[column][0];
                            sum[1] += row[column][1];
                        }
                    }
                    let mean = sum[0] / 9.0;
                    *value = (sum[1] / 9.0 - mean * mean).max(0.0);
                }
                rows.rotate_left(1);
                luminances(y + 2, &mut rows[2]);
            }
        },
    );
}
