//! Scratch planes of filters: several channels of a picture, row by row, with margins that repeat the
//! outermost pixels, so that kernels read past a row's ends without asking.

use rayburst_image::Plane;
use rayon::prelude::*;

use crate::lanes::LANES;

/// Columns on each side of the picture.
pub(crate) const MARGIN: usize = 32;

/// Rows that a thread works on at a time.
pub(crate) const BAND: usize = 8;

/// Channels of a picture with margins to the left and to the right. The channels of a row are side by
/// side.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    width: usize,
    height: usize,
    channels: usize,
    stride: usize,
    values: Vec<f32>,
}

impl Scratch {
    /// Makes place for a picture; says whether it is another one than before. What is in it is
    /// unspecified.
    pub(crate) fn resize(&mut self, size: (u32, u32), channels: usize) -> bool {
        let (width, height) = (size.0 as usize, size.1 as usize);
        if (width, height, channels) == (self.width, self.height, self.channels) {
            return false;
        }
        let stride = width.next_multiple_of(LANES) + 2 * MARGIN;
        self.values.clear();
        self.values.resize(stride * height * channels, 0.0);
        (self.width, self.height, self.channels, self.stride) = (width, height, channels, stride);
        true
    }

    pub(crate) fn width(&self) -> usize {
        self.width
    }

    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// A row of a channel with its margins: pixel x is at `MARGIN + x`.
    #[inline(always)]
    pub(crate) fn row(&self, y: usize, channel: usize) -> &[f32] {
        &self.values[(y * self.channels + channel) * self.stride..][..self.stride]
    }

    /// A row of a channel; the first or the last one for rows outside the picture.
    #[inline(always)]
    pub(crate) fn near_row(&self, y: isize, channel: usize) -> &[f32] {
        let last = self.height as isize - 1;
        let y = if y < last { y } else { last };
        self.row(if y > 0 { y as usize } else { 0 }, channel)
    }

    /// Bands of [`BAND`] rows, to be written in parallel.
    pub(crate) fn bands_mut(
        &mut self,
    ) -> impl IndexedParallelIterator<Item = ScratchBand<'_>> + use<'_> {
        let (width, stride, channels) = (self.width, self.stride, self.channels);
        let rows = (stride * channels * BAND).max(1);
        self.values.par_chunks_mut(rows).enumerate().map(move |(i, values)| ScratchBand {
            top: i * BAND,
            width,
            stride,
            channels,
            values,
        })
    }

    /// Copies a channel to a plane of the same size.
    pub(crate) fn copy_to(&self, channel: usize, plane: &mut Plane) {
        let stride = plane.stride();
        plane.values_mut().par_chunks_mut(stride * BAND).enumerate().for_each(|(i, rows)| {
            for (row, y) in rows.chunks_mut(stride).zip(i * BAND..) {
                row.copy_from_slice(&self.row(y, channel)[MARGIN..][..stride]);
            }
        });
    }
}

/// Some rows of a scratch that one thread writes.
#[derive(Debug)]
pub(crate) struct ScratchBand<'a> {
    pub(crate) top: usize,
    width: usize,
    stride: usize,
    channels: usize,
    values: &'a mut [f32],
}

impl ScratchBand<'_> {
    /// The rows' numbers in the picture.
    #[inline(always)]
    pub(crate) fn rows(&self) -> std::ops::Range<usize> {
        self.top..self.top + self.values.len() / (self.stride * self.channels)
    }

    /// A row of a channel with its margins, by its number in the picture.
    #[inline(always)]
    pub(crate) fn row_mut(&mut self, y: usize, channel: usize) -> &mut [f32] {
        &mut self.values[((y - self.top) * self.channels + channel) * self.stride..][..self.stride]
    }

    /// Repeats the outermost pixels of a row of all channels in its margins.
    #[inline(always)]
    pub(crate) fn extend(&mut self, y: usize) {
        for channel in 0..self.channels {
            let end = MARGIN + self.width;
            let row = self.row_mut(y, channel);
            let (first, last) = (row[MARGIN], row[end - 1]);
            row[..MARGIN].fill(first);
            row[end..].fill(last);
        }
    }
}

/// A row of a plane with its padding.
#[inline(always)]
pub(crate) fn padded_row(plane: &Plane, y: usize) -> &[f32] {
    &plane.values()[y * plane.stride()..][..plane.stride()]
}

/// Bands of [`BAND`] rows of a plane with their padding, to be written in parallel.
pub(crate) fn band_rows(plane: &mut Plane) -> rayon::slice::ChunksMut<'_, f32> {
    let rows = plane.stride() * BAND;
    plane.values_mut().par_chunks_mut(rows)
}

/// Makes a plane anew if it has another size than wanted.
pub(crate) fn fit(plane: &mut Plane, size: (u32, u32)) -> crate::Result<()> {
    if plane.size() != size {
        *plane = Plane::new(size.0, size.1)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_repeat_the_outermost_pixels() {
        for (width, height) in [(1, 1), (16, 3), (17, 20)] {
            let mut scratch = Scratch::default();
            assert!(scratch.resize((width, height), 2) && !scratch.resize((width, height), 2));
            scratch.bands_mut().for_each(|mut band| {
                for y in band.rows() {
                    for channel in 0..2 {
                        for x in 0..width as usize {
                            band.row_mut(y, channel)[MARGIN + x] =
                                (100 * y + 10 * channel + x) as f32;
                        }
                    }
                    band.extend(y);
                }
            });
            for y in 0..height as usize {
                for channel in 0..2 {
                    let (row, base) = (scratch.row(y, channel), 100 * y + 10 * channel);
                    assert_eq!(row[0], base as f32);
                    assert_eq!(row[row.len() - 1], (base + width as usize - 1) as f32);
                }
            }
            assert_eq!(scratch.near_row(-7, 1), scratch.row(0, 1));
            let mut plane = Plane::new(width, height).unwrap();
            scratch.copy_to(1, &mut plane);
            assert_eq!(
                plane.get(width - 1, height - 1),
                scratch.row(height as usize - 1, 1)[MARGIN + width as usize - 1]
            );
        }
    }
}
