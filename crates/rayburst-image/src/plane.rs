//! Planes: what passes of a frame hand each other, one channel each.
//!
//! A signal of a frame (depth, a colour's red, a material's index) is a plane of 32-bit numbers. Rows
//! are padded to [`ROW_ALIGN`] values, so that kernels read whole vectors; what the padding holds is
//! not part of the picture. Vectors are three planes side by side.

use glam::Vec3;

use crate::limits::check_size;
use crate::{Result, RgbImage};

/// Rows begin at multiples of this many values.
pub const ROW_ALIGN: usize = 16;

/// One channel of a frame, row by row from the top left, rows padded to [`ROW_ALIGN`] values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plane<T = f32> {
    width: u32,
    height: u32,
    stride: usize,
    values: Vec<T>,
}

impl<T: Copy + Default> Plane<T> {
    /// A plane of zeros. Fails where a picture of that size would be empty or too large.
    pub fn new(width: u32, height: u32) -> Result<Self> {
        check_size("plane", u64::from(width), u64::from(height))?;
        let stride = (width as usize).next_multiple_of(ROW_ALIGN);
        Ok(Self { width, height, stride, values: vec![T::default(); stride * height as usize] })
    }

    /// Pixels in a row.
    #[inline]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[inline]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Width and height.
    #[inline]
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Values from the beginning of a row to the beginning of the next.
    #[inline]
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// All values, with the padding.
    #[inline]
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// All values, with the padding.
    #[inline]
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// A row without its padding.
    #[inline]
    pub fn row(&self, y: u32) -> &[T] {
        &self.values[y as usize * self.stride..][..self.width as usize]
    }

    /// A row without its padding.
    #[inline]
    pub fn row_mut(&mut self, y: u32) -> &mut [T] {
        &mut self.values[y as usize * self.stride..][..self.width as usize]
    }

    /// The value of a pixel. Panics outside the picture.
    #[inline]
    pub fn get(&self, x: u32, y: u32) -> T {
        self.row(y)[x as usize]
    }

    /// Where in [`Plane::values`] a pixel is: the same in all planes of a size.
    #[inline]
    pub fn index(&self, x: u32, y: u32) -> usize {
        y as usize * self.stride + x as usize
    }

    /// The value at an [`Plane::index`].
    #[inline]
    pub fn at(&self, index: usize) -> T {
        self.values[index]
    }

    /// Sixteen values from an [`Plane::index`] on. Panics beyond the plane's end.
    #[inline(always)]
    pub fn lanes(&self, index: usize) -> [T; ROW_ALIGN] {
        let mut out = [T::default(); ROW_ALIGN];
        out.copy_from_slice(&self.values[index..index + ROW_ALIGN]);
        out
    }

    /// The value of the nearest pixel of the picture; the picture must not be empty.
    #[inline]
    pub fn get_clamped(&self, x: i32, y: i32) -> T {
        let x = x.clamp(0, self.width as i32 - 1);
        let y = y.clamp(0, self.height as i32 - 1);
        self.get(x as u32, y as u32)
    }

    /// Sets a pixel. Panics outside the picture.
    #[inline]
    pub fn set(&mut self, x: u32, y: u32, value: T) {
        self.row_mut(y)[x as usize] = value;
    }

    /// Sets all values.
    pub fn fill(&mut self, value: T) {
        self.values.fill(value);
    }

    /// Cuts the plane into bands of `rows` rows, the last one perhaps of fewer, to be written in
    /// parallel.
    pub fn bands_mut(&mut self, rows: u32) -> impl Iterator<Item = Band<'_, T>> {
        let (width, stride) = (self.width, self.stride);
        self.values
            .chunks_mut(stride * rows.max(1) as usize)
            .zip(0..)
            .map(move |(values, i)| Band { top: i * rows.max(1), width, stride, values })
    }
}

/// Some rows of a plane that one thread writes.
#[derive(Debug)]
pub struct Band<'a, T = f32> {
    top: u32,
    width: u32,
    stride: usize,
    values: &'a mut [T],
}

impl<T: Copy> Band<'_, T> {
    /// The first row's number in the plane.
    #[inline]
    pub fn top(&self) -> u32 {
        self.top
    }

    /// Number of rows.
    #[inline]
    pub fn rows(&self) -> u32 {
        (self.values.len() / self.stride) as u32
    }

    /// A row, by its number in the plane, without its padding.
    #[inline]
    pub fn row_mut(&mut self, y: u32) -> &mut [T] {
        &mut self.values[(y - self.top) as usize * self.stride..][..self.width as usize]
    }

    /// The values from a pixel on to the end of its row, with the padding.
    #[inline]
    pub fn from_pixel_mut(&mut self, x: u32, y: u32) -> &mut [T] {
        let row = (y - self.top) as usize * self.stride;
        &mut self.values[row + x as usize..row + self.stride]
    }

    /// The value of a pixel, by its place in the plane. Panics outside the band.
    #[inline]
    pub fn get(&self, x: u32, y: u32) -> T {
        self.values[(y - self.top) as usize * self.stride..][..self.width as usize][x as usize]
    }

    /// Sets a pixel, by its place in the plane. Panics outside the band.
    #[inline]
    pub fn set(&mut self, x: u32, y: u32, value: T) {
        self.row_mut(y)[x as usize] = value;
    }
}

/// Three planes: a colour or a vector.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plane3 {
    /// The channels.
    pub channels: [Plane; 3],
}

impl Plane3 {
    /// Planes of zeros. Fails where a picture of that size would be too large.
    pub fn new(width: u32, height: u32) -> Result<Self> {
        let plane = Plane::new(width, height)?;
        Ok(Self { channels: [plane.clone(), plane.clone(), plane] })
    }

    /// Width and height.
    #[inline]
    pub fn size(&self) -> (u32, u32) {
        self.channels[0].size()
    }

    /// The value of a pixel. Panics outside the picture.
    #[inline]
    pub fn get(&self, x: u32, y: u32) -> Vec3 {
        let [a, b, c] = &self.channels;
        Vec3::new(a.get(x, y), b.get(x, y), c.get(x, y))
    }

    /// The value at an [`Plane::index`].
    #[inline]
    pub fn at(&self, index: usize) -> Vec3 {
        let [a, b, c] = &self.channels;
        Vec3::new(a.at(index), b.at(index), c.at(index))
    }

    /// Sets a pixel. Panics outside the picture.
    #[inline]
    pub fn set(&mut self, x: u32, y: u32, value: Vec3) {
        let [a, b, c] = &mut self.channels;
        a.set(x, y, value.x);
        b.set(x, y, value.y);
        c.set(x, y, value.z);
    }

    /// Sets all values.
    pub fn fill(&mut self, value: Vec3) {
        for (channel, value) in self.channels.iter_mut().zip(value.to_array()) {
            channel.fill(value);
        }
    }

    /// Cuts the planes into bands of `rows` rows, to be written in parallel.
    pub fn bands_mut(&mut self, rows: u32) -> impl Iterator<Item = Band3<'_>> {
        let [a, b, c] = &mut self.channels;
        let bands = a.bands_mut(rows).zip(b.bands_mut(rows)).zip(c.bands_mut(rows));
        bands.map(|((a, b), c)| Band3 { channels: [a, b, c] })
    }

    /// A row of one channel without padding.
    #[inline]
    pub fn channel_row(&self, channel: usize, y: u32) -> &[f32] {
        self.channels[channel].row(y)
    }

    /// The picture without padding.
    pub fn to_image(&self) -> RgbImage {
        let (width, height) = self.size();
        RgbImage::from_fn(width, height, |x, y| self.get(x, y))
    }
}

/// Some rows of three planes that one thread writes.
#[derive(Debug)]
pub struct Band3<'a> {
    channels: [Band<'a>; 3],
}

impl Band3<'_> {
    /// The first row's number in the planes.
    #[inline]
    pub fn top(&self) -> u32 {
        self.channels[0].top()
    }

    /// Number of rows.
    #[inline]
    pub fn rows(&self) -> u32 {
        self.channels[0].rows()
    }

    /// The values of each channel from a pixel on to the end of its row, with the padding.
    #[inline]
    pub fn from_pixel_mut(&mut self, x: u32, y: u32) -> [&mut [f32]; 3] {
        let [a, b, c] = &mut self.channels;
        [a.from_pixel_mut(x, y), b.from_pixel_mut(x, y), c.from_pixel_mut(x, y)]
    }

    /// The value of a pixel, by its place in the plane. Panics outside the band.
    #[inline]
    pub fn get(&self, x: u32, y: u32) -> Vec3 {
        let [a, b, c] = &self.channels;
        Vec3::new(a.get(x, y), b.get(x, y), c.get(x, y))
    }

    /// Sets a pixel, by its place in the plane. Panics outside the band.
    #[inline]
    pub fn set(&mut self, x: u32, y: u32, value: Vec3) {
        let [a, b, c] = &mut self.channels;
        a.set(x, y, value.x);
        b.set(x, y, value.y);
        c.set(x, y, value.z);
    }

    /// The three channels of a row, by its number in the plane, without padding.
    #[inline]
    pub fn row_mut(&mut self, y: u32) -> [&mut [f32]; 3] {
        let [a, b, c] = &mut self.channels;
        [a.row_mut(y), b.row_mut(y), c.row_mut(y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_padded_and_bands_cover_them_once() {
        for (width, height) in [(1, 1), (16, 3), (17, 8), (640, 13)] {
            let mut plane = Plane::<u32>::new(width, height).unwrap();
            assert_eq!(plane.stride() % ROW_ALIGN, 0);
            let mut rows = 0;
            for mut band in plane.bands_mut(8) {
                for y in band.top()..band.top() + band.rows() {
                    for x in 0..width {
                        let value = band.get(x, y);
                        band.set(x, y, value + 1 + x + width * y);
                    }
                    rows += 1;
                }
            }
            assert_eq!(rows, height);
            for y in 0..height {
                assert!(plane.row(y).iter().zip(0..).all(|(&v, x)| v == 1 + x + width * y));
            }
            assert_eq!(plane.get_clamped(-5, 1000), plane.get(0, height - 1));
        }
        assert!(Plane::<f32>::new(1 << 30, 1 << 30).is_err());
    }

    #[test]
    fn vectors_come_back() {
        let mut planes = Plane3::new(5, 9).unwrap();
        for mut band in planes.bands_mut(4) {
            let top = band.channels[0].top();
            for y in top..top + band.channels[0].rows() {
                for x in 0..5 {
                    band.set(x, y, Vec3::new(x as f32, y as f32, 1.0));
                    assert_eq!(band.get(x, y).y, y as f32);
                }
            }
        }
        assert_eq!(planes.get(3, 8), Vec3::new(3.0, 8.0, 1.0));
        assert_eq!(planes.to_image().get(4, 7), Vec3::new(4.0, 7.0, 1.0));
    }
}
