//! Mip pyramids of 8-bit textures, and of environment maps.
//!
//! Each level halves the one above, rounding down, by an area-weighted box: a texel averages
//! exactly the area it covers, so that sizes that are no powers of two neither shift nor lose
//! edges. Averages are taken of linear values; colour of sRGB textures with alpha is weighted by
//! alpha, so that what lies hidden under transparent texels does not bleed out.

mod coverage;
mod downsample;
mod environment;

pub use environment::RgbPyramid;

use std::sync::Arc;

use glam::Vec4;

use crate::colour::{linear_table, srgb_table};
use crate::texture::Texels;

/// What the bytes of a texture's colour channels mean. Alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TexelFormat {
    /// sRGB-encoded colour: base colour, emission.
    Srgb,
    /// Numbers from 0 to 1: normals, roughness, occlusion.
    Linear,
}

/// One level of a pyramid.
#[derive(Clone, Debug)]
pub struct MipLevel {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    data: Arc<[u8]>,
}

/// A texture with all its levels, in as many bytes a texel as it has channels.
#[derive(Clone, Debug)]
pub struct MipMap {
    levels: Vec<MipLevel>,
    channels: usize,
    format: TexelFormat,
    decode: &'static [f32; 256],
}

impl MipMap {
    /// Builds all levels down to one texel.
    pub fn new(texels: Texels, format: TexelFormat) -> Self {
        let channels = usize::from(texels.channels);
        let (decode, encode) = match format {
            TexelFormat::Srgb => (srgb_table(), downsample::srgb_encoder()),
            TexelFormat::Linear => (linear_table(), downsample::linear_encoder()),
        };
        let codec = downsample::Codec {
            channels,
            has_alpha: channels == 2 || channels == 4,
            weighted: format == TexelFormat::Srgb,
            decode,
            encode,
        };
        let mut levels = vec![];
        let mut last = codec.decode(&texels);
        levels.push(MipLevel {
            width: texels.width,
            height: texels.height,
            data: texels.data.into(),
        });
        while last.width > 1 || last.height > 1 {
            last = last.half();
            let data = codec.encode(&last).into();
            levels.push(MipLevel { width: last.width, height: last.height, data });
        }
        Self { levels, channels, format, decode }
    }

    /// The levels, the finest first; there is always one.
    pub fn levels(&self) -> &[MipLevel] {
        &self.levels
    }

    /// Width of the finest level.
    pub fn width(&self) -> u32 {
        self.levels[0].width
    }

    /// Height of the finest level.
    pub fn height(&self) -> u32 {
        self.levels[0].height
    }

    /// Bytes a texel: 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// What the bytes mean.
    pub fn format(&self) -> TexelFormat {
        self.format
    }

    /// Bytes of all levels.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|l| l.data.len()).sum()
    }

    /// A texel as linear red, green, blue and alpha; grey is repeated, missing alpha is 1.
    ///
    /// Panics when `level`, `x` or `y` is out of range.
    #[inline]
    pub fn texel(&self, level: usize, x: u32, y: u32) -> [f32; 4] {
        let level = &self.levels[level];
        debug_assert!(x < level.width && y < level.height);
        let at = (y as usize * level.width as usize + x as usize) * self.channels;
        let colour = |byte: u8| self.decode[usize::from(byte)];
        let alpha = |byte: u8| f32::from(byte) * (1.0 / 255.0);
        let texel = &level.data[at..at + self.channels];
        match *texel {
            [r, g, b, a] => [colour(r), colour(g), colour(b), alpha(a)],
            [r, g, b] => [colour(r), colour(g), colour(b), 1.0],
            [y, a] => [colour(y), colour(y), colour(y), alpha(a)],
            [y] => [colour(y), colour(y), colour(y), 1.0],
            _ => [0.0, 0.0, 0.0, 1.0],
        }
    }

    /// Four texels of one level as linear red, green, blue and alpha, weighted and added up: what a
    /// bilinear lookup asks for, decoded for one number of channels at a time.
    ///
    /// Panics when the level or a coordinate is out of range.
    #[inline]
    pub fn blend(
        &self,
        level: usize,
        columns: [u32; 2],
        rows: [u32; 2],
        weights: [f32; 4],
    ) -> Vec4 {
        let MipLevel { width, data, .. } = &self.levels[level];
        let channels = self.channels;
        let at = |x: u32, y: u32| (y as usize * *width as usize + x as usize) * channels;
        let places = [
            at(columns[0], rows[0]),
            at(columns[1], rows[0]),
            at(columns[0], rows[1]),
            at(columns[1], rows[1]),
        ];
        let decode = self.decode;
        let mut sum = Vec4::ZERO;
        for (place, weight) in places.into_iter().zip(weights) {
            let texel = &data[place..place + channels];
            let value = match *texel {
                [r, g, b, a] => Vec4::new(
                    decode[usize::from(r)],
                    decode[usize::from(g)],
                    decode[usize::from(b)],
                    f32::from(a) * (1.0 / 255.0),
                ),
                [r, g, b] => Vec4::new(
                    decode[usize::from(r)],
                    decode[usize::from(g)],
                    decode[usize::from(b)],
                    1.0,
                ),
                [y, a] => {
                    let y = decode[usize::from(y)];
                    Vec4::new(y, y, y, f32::from(a) * (1.0 / 255.0))
                }
                [y] => {
                    let y = decode[usize::from(y)];
                    Vec4::new(y, y, y, 1.0)
                }
                _ => Vec4::W,
            };
            sum += weight * value;
        }
        sum
    }

    /// The bytes of four texels of one level, where two columns and two rows meet, row by row: red in the
    /// lowest byte, then green, blue and alpha; grey is repeated, missing alpha is 255.
    ///
    /// Panics when the level or a coordinate is out of range.
    #[inline]
    pub fn bytes_at(&self, level: usize, columns: [u32; 2], rows: [u32; 2]) -> [u32; 4] {
        let MipLevel { width, data, .. } = &self.levels[level];
        let channels = self.channels;
        let at = |x: u32, y: u32| (y as usize * *width as usize + x as usize) * channels;
        let places = [
            at(columns[0], rows[0]),
            at(columns[1], rows[0]),
            at(columns[0], rows[1]),
            at(columns[1], rows[1]),
        ];
        match channels {
            4 => places.map(|place| {
                let texel = &data[place..place + 4];
                u32::from_le_bytes([texel[0], texel[1], texel[2], texel[3]])
            }),
            3 => places.map(|place| {
                let texel = &data[place..place + 3];
                u32::from_le_bytes([texel[0], texel[1], texel[2], 255])
            }),
            2 => places.map(|place| {
                let texel = &data[place..place + 2];
                u32::from_le_bytes([texel[0], texel[0], texel[0], texel[1]])
            }),
            _ => places.map(|place| {
                let grey = data[place];
                u32::from_le_bytes([grey, grey, grey, 255])
            }),
        }
    }

    /// A texel's alpha alone, from 0 to 1.
    #[inline]
    pub fn alpha(&self, level: usize, x: u32, y: u32) -> f32 {
        if self.channels % 2 == 1 {
            return 1.0;
        }
        let level = &self.levels[level];
        let at = (y as usize * level.width as usize + x as usize + 1) * self.channels - 1;
        f32::from(level.data[at]) * (1.0 / 255.0)
    }
}

#[cfg(test)]
mod tests;
