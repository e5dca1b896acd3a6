//! Histories of colours with a fourth number, whose four values lie side by side: they are read where
//! motion leads to, one texel at a time.

use rayon::prelude::*;

use crate::{
    lanes::{LANES, Lanes, load},
    scratch::BAND,
};

/// Four numbers of a pixel.
pub(crate) type Texel = [f32; 4];

/// A picture of texels, row by row without padding.
#[derive(Clone, Debug, Default)]
pub(crate) struct Texels {
    width: usize,
    height: usize,
    values: Vec<Texel>,
}

/// The nearest of so many places. Written out: what is not inlined here is compiled for the baseline.
#[inline(always)]
fn within(place: i32, count: usize) -> usize {
    let last = count as i32 - 1;
    let place = if place < last { place } else { last };
    if place > 0 { place as usize } else { 0 }
}

/// The weights of four texels in a row, at a fraction between the second and the third: cubic
/// interpolation (Catmull, Rom: "A Class of Local Interpolating Splines", 1974).
#[inline(always)]
pub(crate) fn cubic(f: f32) -> [f32; 4] {
    let squared = f * f;
    [
        f * (-0.5 + f * (1.0 - 0.5 * f)),
        1.0 + squared * (1.5 * f - 2.5),
        f * (0.5 + f * (2.0 - 1.5 * f)),
        squared * (0.5 * f - 0.5),
    ]
}

/// Motion of so little of a pixel is none.
const ROUNDING: f32 = 1e-3;

impl Texels {
    /// Makes place for a picture; says whether it is another one than before, and zero then.
    pub(crate) fn resize(&mut self, size: (u32, u32)) -> bool {
        let (width, height) = (size.0 as usize, size.1 as usize);
        if (width, height) == (self.width, self.height) {
            return false;
        }
        self.values.clear();
        self.values.resize(width * height, [0.0; 4]);
        (self.width, self.height) = (width, height);
        true
    }

    pub(crate) fn width(&self) -> usize {
        self.width
    }

    pub(crate) fn fill(&mut self, texel: Texel) {
        self.values.fill(texel);
    }

    /// A row.
    #[inline(always)]
    pub(crate) fn row(&self, y: usize) -> &[Texel] {
        &self.values[y * self.width..][..self.width]
    }

    /// The nearest texel of the picture.
    #[inline(always)]
    pub(crate) fn near(&self, x: i32, y: i32) -> Texel {
        let (x, y) = (within(x, self.width), within(y, self.height));
        self.values[y * self.width + x]
    }

    /// Bands of [`BAND`] rows, to be written in parallel.
    pub(crate) fn bands_mut(&mut self) -> rayon::slice::ChunksMut<'_, Texel> {
        let texels = (self.width * BAND).max(1);
        self.values.par_chunks_mut(texels)
    }

    /// Whether a point, in texels from the centre of the first one, is in the picture.
    #[inline(always)]
    pub(crate) fn contains(&self, x: f32, y: f32) -> bool {
        x >= -0.5 && x <= self.width as f32 - 0.5 && y >= -0.5 && y <= self.height as f32 - 0.5
    }

    /// Interpolates with [`cubic`] weights at a point that the picture [`Texels::contains`]. What is off a
    /// texel's centre by rounding is that texel.
    #[inline(always)]
    pub(crate) fn cubic(&self, x: f32, y: f32) -> Texel {
        // Not negative, so that rounding to zero rounds down.
        let (i, j) = ((x + 4.5) as i32 - 4, (y + 4.5) as i32 - 4);
        if (x - i as f32).abs() < ROUNDING && (y - j as f32).abs() < ROUNDING {
            return self.near(i, j);
        }
        let (left, top) = ((x + 4.0) as i32 - 4, (y + 4.0) as i32 - 4);
        let (fx, fy) = (x - left as f32, y - top as f32);
        let (across, down) = (cubic(fx), cubic(fy));
        let inside =
            left >= 1 && top >= 1 && left + 2 < self.width as i32 && top + 2 < self.height as i32;
        let mut columns = [0.0; LANES];
        if inside {
            let start = 4 * ((top as usize - 1) * self.width + left as usize - 1);
            columns = self.columns(start, &down);
        } else {
            for j in 0..4 {
                for i in 0..4 {
                    let texel = self.near(left + i as i32 - 1, top + j as i32 - 1);
                    for c in 0..4 {
                        columns[4 * i + c] += texel[c] * down[j];
                    }
                }
            }
        }
        fold(&columns, &across)
    }

    /// Four columns of four texels, each column added up by weights.
    #[inline(always)]
    fn columns(&self, start: usize, down: &[f32; 4]) -> Lanes {
        let rows = &self.values.as_flattened()[start..start + 4 * (3 * self.width + 4)];
        let a = load(rows, 0);
        let b = load(rows, 4 * self.width);
        let c = load(rows, 8 * self.width);
        let d = load(rows, 12 * self.width);
        let mut columns = [0.0; LANES];
        for i in 0..LANES {
            columns[i] = (a[i] * down[0] + b[i] * down[1]) + (c[i] * down[2] + d[i] * down[3]);
        }
        columns
    }
}

/// Four texels side by side, added up by weights.
#[inline(always)]
fn fold(columns: &Lanes, weights: &[f32; 4]) -> Texel {
    let mut sum = [0.0; 4];
    for c in 0..4 {
        sum[c] = (columns[c] * weights[0] + columns[4 + c] * weights[1])
            + (columns[8 + c] * weights[2] + columns[12 + c] * weights[3]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Texels {
        let mut texels = Texels::default();
        texels.resize((9, 7));
        texels.bands_mut().for_each(|band| {
            for (i, texel) in band.iter_mut().enumerate() {
                let (x, y) = ((i % 9) as f32, (i / 9) as f32);
                *texel = [x, y, x + 2.0 * y, 1.0];
            }
        });
        texels
    }

    #[test]
    fn ramps_are_kept_within_and_ends_repeated() {
        let texels = ramp();
        for (x, y) in [(3.25, 2.5), (4.0, 3.0), (2.99, 2.01)] {
            for (found, expected) in texels.cubic(x, y).into_iter().zip([x, y, x + 2.0 * y, 1.0]) {
                assert!((found - expected).abs() < 1e-5, "{found} {expected}");
            }
        }
        assert_eq!(texels.near(-3, 2), [0.0, 2.0, 4.0, 1.0]);
        assert_eq!(texels.near(9, 8), [8.0, 6.0, 20.0, 1.0]);
        assert!((texels.cubic(8.4, 6.4)[3] - 1.0).abs() < 1e-6);
        assert!(!texels.contains(f32::NAN, 0.0) && !texels.contains(8.6, 0.0));
    }

    #[test]
    fn weights_add_up_to_one() {
        for i in 0..=16 {
            let sum: f32 = cubic(i as f32 / 16.0).iter().sum();
            assert!((sum - 1.0).abs() < 1e-6);
        }
    }
}
