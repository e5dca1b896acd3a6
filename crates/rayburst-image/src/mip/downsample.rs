//! Halving a picture by area, and the way between bytes and linear values.

use std::sync::LazyLock;

use crate::colour::srgb_encode;
use crate::texture::Texels;

/// Linear interleaved values of one level.
pub(super) struct Plane {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) channels: usize,
    pub(super) values: Vec<f32>,
}

/// The source cells that a target cell covers along one axis, with their shares.
fn weights(from: u32, to: u32) -> Vec<(usize, Vec<f32>)> {
    (0..to)
        .map(|i| {
            // In units of 1/to source cells, so that everything is exact.
            let (from, to, i) = (u64::from(from), u64::from(to), u64::from(i));
            let (begin, end) = (i * from, (i + 1) * from);
            let first = begin / to;
            let last = end.div_ceil(to);
            let share = |cell: u64| {
                let overlap = ((cell + 1) * to).min(end) - (cell * to).max(begin);
                overlap as f32 / from as f32
            };
            (first as usize, (first..last).map(share).collect())
        })
        .collect()
}

impl Plane {
    /// The next level: both sides halved, rounded down, at least 1.
    pub(super) fn half(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let columns = weights(self.width, width);
        let rows = weights(self.height, height);
        let n = self.channels;
        let (row_values, source) = (width as usize * n, self.width as usize * n);
        let mut values = vec![0.0f32; row_values * height as usize];
        for (target, (first, shares)) in values.chunks_exact_mut(row_values).zip(&rows) {
            for (dy, &share_y) in shares.iter().enumerate() {
                let row = &self.values[(first + dy) * source..][..source];
                for (texel, (first, shares)) in target.chunks_exact_mut(n).zip(&columns) {
                    for (dx, &share_x) in shares.iter().enumerate() {
                        let from = &row[(first + dx) * n..][..n];
                        for (to, value) in texel.iter_mut().zip(from) {
                            *to += share_x * share_y * value;
                        }
                    }
                }
            }
        }
        Self { width, height, channels: n, values }
    }
}

/// The byte of each linear value from 0 to 65535.
type Encoder = [u8; 65_536];

pub(super) fn srgb_encoder() -> &'static Encoder {
    static TABLE: LazyLock<Box<Encoder>> = LazyLock::new(|| table(srgb_encode));
    &TABLE
}

pub(super) fn linear_encoder() -> &'static Encoder {
    static TABLE: LazyLock<Box<Encoder>> = LazyLock::new(|| table(|v| v));
    &TABLE
}

fn table(encode: impl Fn(f32) -> f32) -> Box<Encoder> {
    let mut table = Box::new([0; 65_536]);
    for (i, byte) in table.iter_mut().enumerate() {
        *byte = (encode(i as f32 / 65_535.0) * 255.0 + 0.5) as u8;
    }
    table
}

/// Bytes to linear values and back, for one kind of texture.
pub(super) struct Codec {
    pub(super) channels: usize,
    pub(super) has_alpha: bool,
    /// Colour is averaged by alpha.
    pub(super) weighted: bool,
    pub(super) decode: &'static [f32; 256],
    pub(super) encode: &'static Encoder,
}

/// The weight of a fully transparent texel: its colour counts only among its like.
const HIDDEN: f32 = 1.0 / 65_536.0;

impl Codec {
    fn colours(&self) -> usize {
        self.channels - usize::from(self.has_alpha)
    }

    /// Linear values; with weighting, colours are multiplied by the alpha that follows them.
    pub(super) fn decode(&self, texels: &Texels) -> Plane {
        let colours = self.colours();
        let mut values = Vec::with_capacity(texels.data.len());
        for texel in texels.data.chunks_exact(self.channels) {
            let alpha = match self.has_alpha {
                true => f32::from(texel[colours]) / 255.0,
                false => 1.0,
            };
            let weight = if self.weighted { alpha.max(HIDDEN) } else { 1.0 };
            values.extend(texel[..colours].iter().map(|&b| self.decode[usize::from(b)] * weight));
            if self.has_alpha {
                values.push(if self.weighted { weight } else { alpha });
            }
        }
        let (width, height) = (texels.width, texels.height);
        Plane { width, height, channels: self.channels, values }
    }

    pub(super) fn encode(&self, plane: &Plane) -> Vec<u8> {
        let colours = self.colours();
        let mut bytes = Vec::with_capacity(plane.values.len());
        for texel in plane.values.chunks_exact(self.channels) {
            let scale = match self.has_alpha && self.weighted {
                true => 65_535.0 / texel[colours],
                false => 65_535.0,
            };
            // `as` saturates at both ends.
            bytes.extend(
                texel[..colours].iter().map(|v| self.encode[usize::from((v * scale + 0.5) as u16)]),
            );
            if self.has_alpha {
                bytes.push((texel[colours] * 255.0 + 0.5) as u8);
            }
        }
        bytes
    }
}
