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

/// The light of a frame without the surfaces' colours, as it comes from the passes or out of filters: of
/// pairs of planes the first is broadly scattered, the second glossily.
#[derive(Clone, Copy, Debug)]
pub struct Lights<'a> {
    /// Straight from lights.
    pub direct: [&'a Plane3; 2],
    /// Along sampled rays.
    pub indirect: [&'a Plane3; 2],
    /// Of polygon lights as if nothing were in between, if that is not part of `direct`.
    pub analytic: Option<[&'a Plane3; 2]>,
    /// The share of that which is not blocked.
    pub shadow: &'a Plane,
    /// Radiance of mirrors and glass.
    pub transparency: &'a Plane3,
    /// The share of the hemisphere that is open, for ambient light; without it that is part of `indirect`.
    pub ambient_occlusion: Option<&'a Plane>,
}

/// Adds up the light of a frame: colours times light, and what shines.
pub fn composite(
    gbuffer: &GBuffer,
    signals: &Signals,
    lights: &Lights<'_>,
    parameters: &CompositeParameters,
    picture: &mut Plane3,
) {
    let (width, height) = picture.size();
    let bands: Vec<_> = picture.bands_mut(BAND).collect();
    bands.into_par_iter().enumerate().for_each(|(band, mut rows)| {
        let band = band as u32;
        for y in band * BAND..(band * BAND + BAND).min(height) {
            let out = rows.row_mut(y);
            for (channel, out) in out.into_iter().enumerate() {
                let row = |plane| Plane3::channel_row(plane, channel, y);
                let (broad, glossy) =
                    (row(&signals.diffuse_reflectance), row(&signals.specular_reflectance));
                let (direct, indirect) = (lights.direct.map(row), lights.indirect.map(row));
                let shadow = lights.shadow.row(y);
                let transparency = lights.transparency.channel_row(channel, y);
                let emitted = gbuffer.emitted.channel_row(channel, y);
                let ambient = parameters.ambient[channel];
                let shown = if parameters.emission { 1.0 } else { 0.0 };
                for x in 0..width as usize {
                    let diffuse = direct[0][x] + indirect[0][x];
                    let specular = direct[1][x] + indirect[1][x];
                    let scattered = broad[x].max(LEAST_REFLECTANCE) * diffuse
                        + glossy[x].max(LEAST_REFLECTANCE) * specular;
                    out[x] = scattered + transparency[x] + shown * emitted[x];
                }
                if let Some(occlusion) = lights.ambient_occlusion.map(|plane| plane.row(y)) {
                    for x in 0..width as usize {
                        out[x] += broad[x] * ambient * occlusion[x];
                    }
                }
                let Some(analytic) = lights.analytic.map(|planes| planes.map(row)) else {
                    continue;
                };
                for x in 0..width as usize {
                    let scattered = broad[x].max(LEAST_REFLECTANCE) * analytic[0][x]
                        + glossy[x].max(LEAST_REFLECTANCE) * analytic[1][x];
                    out[x] += scattered * shadow[x];
                }
            }
        }
    });
}

/// A row of one channel of all demodulated light: diffuse direct and indirect, specular direct and
/// indirect.
fn all_light(signals: &Signals, channel: usize, y: u32) -> [&[f32]; 4] {
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
            let lights = all_light(signals, channel, y);
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
