//! The inner loops of the wavelet transform: a block of pixels at a time, all taps, all signals.

use std::f32::consts::LOG2_E;

use rayburst_simd::{Isa, Kernel};

use crate::{
    approximate::{exp2, fused, reciprocal},
    geometry::{DEPTH, LEAST_SLOPE, NORMAL, OBJECT, SLOPE},
    stack::{AHEAD, BLOCK, Lanes, Stack, lanes, prefetch},
};

/// Channels of a signal: red, green, blue, luminance, variance of the luminance.
pub(crate) const SIGNAL: usize = 5;
/// The luminance's channel.
pub(crate) const LUMINANCE: usize = 3;
/// The variance's channel.
pub(crate) const VARIANCE: usize = 4;
/// Rec. 709 weights of the channels.
pub(crate) const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];
/// Differences of luminance that are tolerated without any variance, as a share of the luminance.
pub(crate) const LEAST_DEVIATION: f32 = 1e-3;

/// Offsets of taps that are not multiples of each other.
const DIRECTIONS: [[f32; 2]; 8] = [
    [1.0, 0.0],
    [0.0, 1.0],
    [1.0, 1.0],
    [1.0, -1.0],
    [2.0, 1.0],
    [2.0, -1.0],
    [1.0, 2.0],
    [1.0, -2.0],
];
/// Of these there are taps at twice the distance, too.
const DOUBLED: usize = 4;
/// For a tap's offset from −2 to 2 in either direction, row by row: the index of the direction in
/// [`DIRECTIONS`], or 8 more than that if it is twice as far away.
const OFFSETS: [[usize; 5]; 5] =
    [[10, 6, 9, 7, 11], [4, 2, 1, 3, 5], [8, 0, 0, 0, 8], [5, 3, 1, 2, 4], [11, 7, 9, 6, 10]];

/// What the taps of a kernel have in common wherever it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taps {
    /// By row and column: the logarithm of the weight, less the sharpness of normals.
    bases: [[f32; 5]; 5],
    /// The weight of the centre.
    centre: f32,
    /// Rows and columns to every side.
    radius: usize,
}

impl Taps {
    /// Of a kernel that is the product of a row and a column with these weights by distance from the centre,
    /// and normals told apart so sharply.
    pub(crate) fn new(weights: [f32; 3], normal: f32) -> Self {
        let radius = if weights[2] > 0.0 { 2 } else { 1 };
        let mut bases = [[0.0; 5]; 5];
        for row in 0..5usize {
            for column in 0..5usize {
                let weight = weights[row.abs_diff(2)] * weights[column.abs_diff(2)];
                bases[row][column] = weight.log2() - normal;
            }
        }
        Self { bases, centre: weights[0] * weights[0], radius }
    }
}

/// One level over some rows of N signals.
pub(crate) struct LevelKernel<'a, const N: usize> {
    /// See [`crate::geometry`].
    pub(crate) geometry: &'a Stack,
    /// N times [`SIGNAL`] channels.
    pub(crate) from: &'a Stack,
    /// The same, of the rows that are written.
    pub(crate) to: &'a mut [f32],
    /// The first of those rows.
    pub(crate) top: usize,
    /// Pixels from a tap to the next.
    pub(crate) step: usize,
    /// The taps.
    pub(crate) taps: &'a Taps,
    /// How many times the slope is tolerated.
    pub(crate) depth: f32,
    /// How sharply normals are told apart.
    pub(crate) normal: f32,
    /// How many standard deviations of luminance are tolerated; or how much luminance, if `plain`.
    pub(crate) luminance: f32,
    /// Whether there is no variance.
    pub(crate) plain: bool,
}

/// Channels of a row: of the geometry and of the signals.
#[derive(Clone, Copy)]
struct Row<'a> {
    shape: &'a [f32],
    values: &'a [f32],
}

/// What a block of pixels is compared by.
struct Centre<const N: usize> {
    depth: Lanes,
    /// Times the sharpness.
    normal: [Lanes; 3],
    object: Lanes,
    luminance: [Lanes; N],
    /// One over the difference of luminance that is tolerated.
    scale: [Lanes; N],
}

/// Weighted sums of a block: red, green, blue, the weights, the variance with squared weights.
type Sums<const N: usize> = [[Lanes; SIGNAL]; N];

impl<const N: usize> Kernel for LevelKernel<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        let Self { geometry, from, top, step, .. } = self;
        let length = from.channels() * from.stride();
        let (width, height) = (from.size().0 as usize, from.size().1 as usize);
        let to = std::mem::take(&mut self.to);
        let count = to.len() / length;
        // Rows that read the same rows follow each other.
        for first in 0..step.min(count) {
            for index in (first..count).step_by(step) {
                let y = top + index;
                let mut rows = [Row { shape: &[], values: &[] }; 5];
                for i in 0..5 {
                    let row = (y + i * step).wrapping_sub(2 * step);
                    if row < height {
                        let row = row as u32;
                        rows[i] = Row { shape: geometry.rows(row), values: from.rows(row) };
                    }
                }
                let near = [
                    from.rows((y as u32).saturating_sub(1)),
                    from.rows((y + 1).min(height - 1) as u32),
                ];
                let coming = (y + 2 * step).min(height - 1) as u32;
                let coming = Row { shape: geometry.rows(coming), values: from.rows(coming) };
                let to = &mut to[index * length..][..length];
                for x in (0..width).step_by(BLOCK) {
                    let (shape_at, at) = (geometry.margin() + x, from.margin() + x);
                    prefetch(
                        isa,
                        coming.shape,
                        shape_at + AHEAD + 2 * step,
                        geometry.stride(),
                        SLOPE,
                    );
                    prefetch(isa, coming.values, at + AHEAD + 2 * step, from.stride(), N * SIGNAL);
                    prefetch(isa, to, at + AHEAD, from.stride(), N * SIGNAL);
                    self.block::<I>(&rows, near, x, to);
                }
            }
        }
    }
}

impl<const N: usize> LevelKernel<'_, N> {
    #[inline(always)]
    fn block<I: Isa>(&self, rows: &[Row<'_>; 5], near: [&[f32]; 2], x: usize, to: &mut [f32]) {
        let (shape_stride, stride) = (self.geometry.stride(), self.from.stride());
        let (shape_at, at) = (self.geometry.margin() + x, self.from.margin() + x);
        let centre = self.centre(&rows[2], near, x);
        let tolerances = self.tolerances(&rows[2], &centre.depth, shape_at);
        let mut sums: Sums<N> = [[[0.0; BLOCK]; SIGNAL]; N];
        let weight = self.taps.centre;
        for s in 0..N {
            let values = signal(rows[2].values, stride, s, at, BLOCK);
            let [red, green, blue, _, variance] = blocks(&values, 0);
            for i in 0..BLOCK {
                sums[s][0][i] = weight * red[i];
                sums[s][1][i] = weight * green[i];
                sums[s][2][i] = weight * blue[i];
                sums[s][LUMINANCE][i] = weight;
                sums[s][VARIANCE][i] = (weight * weight) * variance[i];
            }
        }
        let (radius, step) = (self.taps.radius, self.step);
        let length = 2 * radius * step + BLOCK;
        for row in 2 - radius..=2 + radius {
            let Row { shape, values } = rows[row];
            if shape.is_empty() {
                continue;
            }
            // Windows of one length: that a tap is in one of them shows that it is in all.
            let (shape_from, from) = (shape_at - radius * step, at - radius * step);
            let mut shapes = [&shape[..length]; SLOPE];
            for c in 0..SLOPE {
                shapes[c] = &shape[c * shape_stride + shape_from..][..length];
            }
            let mut signals = [[&values[..length]; SIGNAL]; N];
            for s in 0..N {
                signals[s] = signal(values, stride, s, from, length);
            }
            for column in 0..=2 * radius {
                if row == 2 && column == radius {
                    continue;
                }
                let base = self.taps.bases[row][column + 2 - radius];
                let tolerance = &tolerances[OFFSETS[row][column + 2 - radius]];
                let shape = blocks(&shapes, column * step);
                let [depth, nx, ny, nz, object] = shape;
                let mut values = [[depth; SIGNAL]; N];
                for s in 0..N {
                    values[s] = blocks(&signals[s], column * step);
                }
                for i in 0..BLOCK {
                    let cosine = nx[i] * centre.normal[0][i]
                        + ny[i] * centre.normal[1][i]
                        + nz[i] * centre.normal[2][i];
                    let apart = (depth[i] - centre.depth[i]).abs() * tolerance[i];
                    let alike = (base - apart) + cosine;
                    let same = object[i].to_bits() == centre.object[i].to_bits();
                    let alike = if same { alike } else { -1e30 };
                    for s in 0..N {
                        let [red, green, blue, luminance, variance] = values[s];
                        let apart = (luminance[i] - centre.luminance[s][i]).abs();
                        let weight = exp2::<I>(fused::<I>(apart, -centre.scale[s][i], alike));
                        sums[s][0][i] = fused::<I>(weight, red[i], sums[s][0][i]);
                        sums[s][1][i] = fused::<I>(weight, green[i], sums[s][1][i]);
                        sums[s][2][i] = fused::<I>(weight, blue[i], sums[s][2][i]);
                        sums[s][LUMINANCE][i] += weight;
                        let squared = weight * weight;
                        sums[s][VARIANCE][i] =
                            fused::<I>(squared, variance[i], sums[s][VARIANCE][i]);
                    }
                }
            }
        }
        for s in 0..N {
            let [red, green, blue, weights, variance] = &sums[s];
            let mut result = [[0.0; BLOCK]; SIGNAL];
            for i in 0..BLOCK {
                let scale = 1.0 / weights[i];
                let colour = [red[i] * scale, green[i] * scale, blue[i] * scale];
                result[0][i] = colour[0];
                result[1][i] = colour[1];
                result[2][i] = colour[2];
                result[LUMINANCE][i] = luminance(colour);
                result[VARIANCE][i] = variance[i] * (scale * scale);
            }
            for c in 0..SIGNAL {
                to[(s * SIGNAL + c) * stride + at..][..BLOCK].copy_from_slice(&result[c]);
            }
        }
    }

    /// For every direction, and those that are doubled, one over the difference of depth that is tolerated,
    /// times the logarithm of e.
    #[inline(always)]
    fn tolerances(&self, row: &Row<'_>, depth: &Lanes, at: usize) -> [Lanes; 8 + DOUBLED] {
        let stride = self.geometry.stride();
        let across = lanes(row.shape, SLOPE * stride + at);
        let down = lanes(row.shape, (SLOPE + 1) * stride + at);
        let mut tolerances = [[0.0; BLOCK]; 8 + DOUBLED];
        let scale = LOG2_E / self.step as f32;
        for direction in 0..8 {
            let [dx, dy] = DIRECTIONS[direction];
            for i in 0..BLOCK {
                let change = (across[i] * dx + down[i] * dy).abs() + LEAST_SLOPE * depth[i].abs();
                let inverse = scale * reciprocal((self.depth * change).max(1e-18));
                tolerances[direction][i] = inverse;
            }
        }
        for direction in 0..DOUBLED {
            for i in 0..BLOCK {
                tolerances[8 + direction][i] = 0.5 * tolerances[direction][i];
            }
        }
        tolerances
    }

    #[inline(always)]
    fn centre(&self, row: &Row<'_>, near: [&[f32]; 2], x: usize) -> Centre<N> {
        let (shape_stride, stride) = (self.geometry.stride(), self.from.stride());
        let at = self.from.margin() + x;
        let shape = |channel| lanes(row.shape, channel * shape_stride + self.geometry.margin() + x);
        let mut centre = Centre {
            depth: *shape(DEPTH),
            normal: [*shape(NORMAL), *shape(NORMAL + 1), *shape(NORMAL + 2)],
            object: *shape(OBJECT),
            luminance: [[0.0; BLOCK]; N],
            scale: [[0.0; BLOCK]; N],
        };
        for axis in 0..3 {
            for i in 0..BLOCK {
                centre.normal[axis][i] *= self.normal;
            }
        }
        for s in 0..N {
            centre.luminance[s] = *lanes(row.values, (s * SIGNAL + LUMINANCE) * stride + at);
            let variance = (s * SIGNAL + VARIANCE) * stride + at;
            let rows = [near[0], row.values, near[1]];
            let blurred = blurred(rows, variance);
            for i in 0..BLOCK {
                let least = LEAST_DEVIATION * centre.luminance[s][i] + 1e-18;
                let tolerated = if self.plain {
                    self.luminance
                } else {
                    self.luminance * blurred[i].max(0.0).sqrt()
                };
                centre.scale[s][i] = LOG2_E / (tolerated + least);
            }
        }
        centre
    }
}

/// A block of a channel of three rows blurred by a kernel of 3×3 with weights 1, 2, 1.
#[inline(always)]
fn blurred(rows: [&[f32]; 3], at: usize) -> Lanes {
    let mut sum = [0.0; BLOCK];
    for (row, weight) in rows.into_iter().zip([0.0625, 0.125, 0.0625]) {
        let (left, middle, right) = (lanes(row, at - 1), lanes(row, at), lanes(row, at + 1));
        for i in 0..BLOCK {
            sum[i] += weight * (left[i] + 2.0 * middle[i] + right[i]);
        }
    }
    sum
}

/// The channels of a signal, from an index of the first one on.
#[inline(always)]
fn signal(
    values: &[f32],
    stride: usize,
    signal: usize,
    at: usize,
    length: usize,
) -> [&[f32]; SIGNAL] {
    let first = signal * SIGNAL * stride + at;
    let mut channels = [&values[first..][..length]; SIGNAL];
    for c in 1..SIGNAL {
        channels[c] = &values[first + c * stride..][..length];
    }
    channels
}

/// A block of every channel, from an index on.
#[inline(always)]
fn blocks<'a>(channels: &[&'a [f32]; 5], at: usize) -> [&'a Lanes; 5] {
    let mut blocks = [lanes(channels[0], at); 5];
    for c in 1..5 {
        blocks[c] = lanes(channels[c], at);
    }
    blocks
}

/// Luminance of a colour.
#[inline(always)]
pub(crate) fn luminance([red, green, blue]: [f32; 3]) -> f32 {
    WEIGHTS[0] * red + WEIGHTS[1] * green + WEIGHTS[2] * blue
}
