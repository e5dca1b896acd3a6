//! Several planes row by row in one piece of memory, with room at both sides.

use rayburst_image::Plane;
use rayburst_simd::Isa;

use crate::Result;

/// Rows that a thread works on at a time.
pub(crate) const BAND: usize = 8;
/// Values that kernels work on at a time: rows are multiples of it.
pub(crate) const BLOCK: usize = 16;

/// How many values before kernels reach them memory is asked for: rows of many channels are more streams than
/// the CPU foresees by itself.
pub(crate) const AHEAD: usize = 4 * BLOCK;

/// Asks for the blocks of some channels that lie a stride apart, at an index of the first.
#[inline(always)]
pub(crate) fn prefetch<I: Isa>(isa: I, values: &[f32], at: usize, stride: usize, channels: usize) {
    for channel in 0..channels {
        isa.prefetch(values.as_ptr().wrapping_add(at + channel * stride));
    }
}

/// A block of values.
pub(crate) type Lanes = [f32; BLOCK];

/// The block of values from an index on.
#[inline(always)]
pub(crate) fn lanes(values: &[f32], at: usize) -> &Lanes {
    values[at..at + BLOCK].first_chunk().expect("a block")
}

/// Channels of a picture: row 0 of every channel, then row 1 of every channel, and so on.
///
/// Rows of all channels that belong together lie side by side, so a band of rows of any number of
/// channels is one slice that one thread writes. Every row has `margin` values before its first pixel and
/// at least as many after its last, so that kernels read whole vectors beyond the picture's sides.
#[derive(Clone, Debug, Default)]
pub struct Stack {
    size: (u32, u32),
    channels: usize,
    margin: usize,
    stride: usize,
    /// A plane as wide as a padded row and as high as all rows.
    plane: Plane,
}

impl Stack {
    /// Zeros. The margin is rounded up to whole vectors. Fails where it would be empty or too large.
    pub fn new(size: (u32, u32), channels: usize, margin: usize) -> Result<Self> {
        // The picture alone is checked first, so that the message names its size.
        Plane::<u8>::new(size.0, size.1)?;
        let stride = (size.0 as usize).next_multiple_of(BLOCK);
        let margin = margin.next_multiple_of(BLOCK);
        let stride = stride + 2 * margin;
        let rows = u32::try_from(channels as u64 * u64::from(size.1)).unwrap_or(u32::MAX);
        let plane = Plane::new(stride as u32, rows)?;
        Ok(Self { size, channels, margin, stride, plane })
    }

    /// Width and height.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Values before a row's first pixel.
    pub fn margin(&self) -> usize {
        self.margin
    }

    /// Values from a row to the next, which is the same row of the next channel.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// A row of a channel without its margins.
    #[inline(always)]
    pub fn row(&self, channel: usize, y: u32) -> &[f32] {
        &self.padded_row(channel, y)[self.margin..][..self.size.0 as usize]
    }

    /// A row of a channel with its margins.
    #[inline(always)]
    pub fn padded_row(&self, channel: usize, y: u32) -> &[f32] {
        let start = (y as usize * self.channels + channel) * self.stride;
        &self.plane.values()[start..start + self.stride]
    }

    /// All channels of a row with their margins, [`Stack::stride`] values each.
    #[inline(always)]
    pub fn rows(&self, y: u32) -> &[f32] {
        let length = self.channels * self.stride;
        &self.plane.values()[y as usize * length..][..length]
    }

    /// The values of all rows, to be cut into bands of [`Stack::band_len`] values.
    pub fn values_mut(&mut self) -> &mut [f32] {
        self.plane.values_mut()
    }

    /// Values in a band of some rows.
    pub fn band_len(&self, rows: usize) -> usize {
        (self.channels * self.stride * rows).max(1)
    }

    /// Sets all values.
    pub fn fill(&mut self, value: f32) {
        self.plane.fill(value);
    }

    /// Copies a channel into a plane of the same size, as far as both reach.
    pub fn copy_channel(&self, channel: usize, to: &mut Plane) {
        let height = self.size.1.min(to.height());
        for y in 0..height {
            let (from, to) = (self.row(channel, y), to.row_mut(y));
            let width = from.len().min(to.len());
            to[..width].copy_from_slice(&from[..width]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_of_a_row_lie_side_by_side() {
        let mut stack = Stack::new((17, 5), 3, 20).unwrap();
        assert_eq!((stack.margin(), stack.stride(), stack.channels()), (32, 96, 3));
        let (margin, stride, band) = (stack.margin(), stack.stride(), stack.band_len(1));
        for (y, rows) in stack.values_mut().chunks_mut(band).enumerate() {
            for (channel, row) in rows.chunks_mut(stride).enumerate() {
                for x in 0..17 {
                    row[margin + x] = (100 * y + 20 * channel + x) as f32;
                }
            }
        }
        assert_eq!(stack.row(2, 3)[16], 356.0);
        assert_eq!(stack.rows(3)[2 * stride..][..stride], *stack.padded_row(2, 3));
        let mut plane = Plane::new(17, 5).unwrap();
        stack.copy_channel(1, &mut plane);
        assert_eq!(plane.get(16, 4), 436.0);
        assert!(Stack::new((0, 5), 1, 0).is_err() && Stack::new((1 << 30, 1 << 30), 1, 0).is_err());
    }
}
