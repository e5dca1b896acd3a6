//! The film: what a progressive renderer has gathered so far.
//!
//! Each pixel holds the sum of its samples, of their squared luminance (for the variance), and of
//! its auxiliary values (AOVs), as [`Sum`]s. Samples are added one by one in order, so the state
//! depends only on the samples of that pixel: not on tiles, threads or passes, and a film that was
//! saved and loaded goes on as if it had never stopped.
//!
//! Pixels are stored tile by tile: [`Film::tiles_mut`] hands out disjoint slices, and threads add
//! without locks or copies.

mod layers;
mod sum;
mod tile;

use std::ops::Range;

use glam::Vec3;

pub use layers::STATE_PREFIX;
pub use sum::Sum;
pub use tile::FilmTile;

use crate::colour::luminance;
use crate::limits::{check_bytes, check_size};
use crate::{ImageError, Precision, Result, RgbImage};

/// The side of a tile in pixels.
pub const TILE: u32 = 16;

/// The most samples a pixel can hold: integers up to here are exact as `f32`.
pub const MAX_SAMPLES: u32 = 1 << 24;

/// Samples with a larger component are dropped like NaN: their squares would overflow the sums.
pub const MAX_SAMPLE: f32 = 1e15;

/// What a pixel keeps of an AOV's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AovMode {
    /// Their mean.
    Mean,
    /// The first one: for ids.
    First,
}

/// A named auxiliary output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AovSpec {
    /// The layer's name: `albedo`, `normal`, `depth`…
    pub name: String,
    /// The channels' names: `R G B`, `X Y Z`, `Z`…
    pub channels: Vec<String>,
    /// Mean or first sample.
    pub mode: AovMode,
    /// How a file stores it.
    pub precision: Precision,
}

impl AovSpec {
    /// An AOV with the given channels, for example `AovSpec::new("depth", &["Z"], …)`.
    pub fn new(name: &str, channels: &[&str], mode: AovMode, precision: Precision) -> Self {
        let channels = channels.iter().map(|c| (*c).to_owned()).collect();
        Self { name: name.to_owned(), channels, mode, precision }
    }
}

/// One pixel's sums.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelSum {
    /// Red, green and blue.
    pub rgb: [Sum; 3],
    /// Squared luminance.
    pub luminance2: Sum,
    /// Samples in the sums.
    pub samples: u32,
    /// Samples that were not finite (or above [`MAX_SAMPLE`]) and left out.
    pub dropped: u32,
}

impl PixelSum {
    /// Adds a sample; says whether it was good.
    #[inline]
    pub fn add(&mut self, rgb: Vec3) -> bool {
        // False for NaN too.
        let good = rgb.abs().max_element() <= MAX_SAMPLE && rgb.is_finite();
        if !good {
            self.dropped += 1;
            return false;
        }
        self.samples += 1;
        self.rgb[0].add(rgb.x);
        self.rgb[1].add(rgb.y);
        self.rgb[2].add(rgb.z);
        let l = luminance(rgb);
        self.luminance2.add(l * l);
        true
    }

    /// Samples taken, good or not: the index of the next one.
    #[inline]
    pub fn taken(&self) -> u32 {
        self.samples + self.dropped
    }

    /// The mean of the good samples, black without any.
    pub fn mean(&self) -> Vec3 {
        let n = f64::from(self.samples.max(1));
        Vec3::from_array(self.rgb.map(|s| (s.value() / n) as f32))
    }

    /// The variance of the mean's luminance, estimated from at least two samples.
    pub fn variance(&self) -> Option<f32> {
        let n = f64::from(self.samples);
        let sum: f64 =
            (0..3).map(|i| self.rgb[i].value() * f64::from(crate::colour::LUMINANCE[i])).sum();
        let of_samples = (self.luminance2.value() - sum * sum / n).max(0.0) / (n - 1.0);
        (self.samples >= 2).then_some((of_samples / n) as f32)
    }
}

/// The accumulated picture. See the module's description.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    aovs: Vec<AovSpec>,
    /// Channels of all AOVs together.
    stride: usize,
    /// By tile, then by row within the tile.
    pixels: Vec<PixelSum>,
    /// `stride` sums a pixel, in the pixels' order.
    values: Vec<Sum>,
}

impl Film {
    /// An empty film. Fails where the size is zero, or the memory would be more than the limit.
    pub fn new(width: u32, height: u32, aovs: &[AovSpec]) -> Result<Self> {
        let pixels = check_size("film", width.into(), height.into())?;
        let stride = aovs.iter().map(|a| a.channels.len()).sum::<usize>();
        let bytes = size_of::<PixelSum>() + stride * size_of::<Sum>();
        check_bytes("film", pixels as u128, bytes as u128)?;
        if let Some(bad) = aovs.iter().find(|a| a.name.is_empty() || a.channels.is_empty()) {
            return Err(ImageError::Invalid(format!(
                "AOV '{}' lacks a name or channels",
                bad.name
            )));
        }
        Ok(Self {
            width,
            height,
            aovs: aovs.to_vec(),
            stride,
            pixels: vec![PixelSum::default(); pixels],
            values: vec![Sum::default(); pixels * stride],
        })
    }

    /// Pixels in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The AOVs, in the order of the values that [`FilmTile::add`] takes.
    pub fn aovs(&self) -> &[AovSpec] {
        &self.aovs
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.pixels) + size_of_val(&*self.values)
    }

    /// The tiles, row by row, each with exclusive access to its pixels: share them out to threads.
    pub fn tiles_mut(&mut self) -> Vec<FilmTile<'_>> {
        let (mut pixels, mut values) = (&mut *self.pixels, &mut *self.values);
        let mut tiles = Vec::new();
        for y in (0..self.height).step_by(TILE as usize) {
            for x in (0..self.width).step_by(TILE as usize) {
                let (width, height) = (TILE.min(self.width - x), TILE.min(self.height - y));
                let count = (width * height) as usize;
                let (own, rest) = pixels.split_at_mut(count);
                let (own_values, rest_values) = values.split_at_mut(count * self.stride);
                (pixels, values) = (rest, rest_values);
                tiles.push(FilmTile::new([x, y, width, height], own, own_values, &self.aovs));
            }
        }
        tiles
    }

    /// Adds one sample; for whole tiles see [`Self::tiles_mut`]. `aovs` holds the values of all
    /// AOVs' channels, one after the other.
    pub fn add(&mut self, x: u32, y: u32, rgb: Vec3, aovs: &[f32]) {
        let index = self.index(x, y);
        let values = &mut self.values[index * self.stride..][..self.stride];
        tile::add(&mut self.pixels[index], values, &self.aovs, rgb, aovs);
    }

    /// A pixel's sums.
    #[inline]
    pub fn pixel(&self, x: u32, y: u32) -> &PixelSum {
        &self.pixels[self.index(x, y)]
    }

    /// The picture: each pixel's mean.
    pub fn mean(&self) -> RgbImage {
        let pixels = self.rows(|film, i| film.pixels[i].mean());
        RgbImage { width: self.width, height: self.height, pixels }
    }

    /// The variance of each pixel's mean luminance, row by row; infinite under two samples.
    pub fn variance(&self) -> Vec<f32> {
        self.rows(|film, i| film.pixels[i].variance().unwrap_or(f32::INFINITY))
    }

    /// One channel of an AOV, row by row: mean or first sample, 0 without samples.
    pub fn aov(&self, name: &str, channel: usize) -> Option<Vec<f32>> {
        let at = self.aovs.iter().position(|a| a.name == name)?;
        let spec = &self.aovs[at];
        (channel < spec.channels.len()).then_some(())?;
        let offset = self.aovs[..at].iter().map(|a| a.channels.len()).sum::<usize>() + channel;
        Some(self.rows(|film, index| {
            let sum = film.values[index * film.stride + offset];
            match spec.mode {
                AovMode::First => sum.hi,
                AovMode::Mean => {
                    (sum.value() / f64::from(film.pixels[index].samples.max(1))) as f32
                }
            }
        }))
    }

    /// The least and the largest number of samples taken by any pixel.
    pub fn samples_taken(&self) -> (u32, u32) {
        let taken = || self.pixels.iter().map(PixelSum::taken);
        (taken().min().unwrap_or(0), taken().max().unwrap_or(0))
    }

    /// Samples dropped in all pixels.
    pub fn dropped(&self) -> u64 {
        self.pixels.iter().map(|p| u64::from(p.dropped)).sum()
    }

    /// An estimate of the relative root mean square error of the picture's luminance: the square
    /// root of the mean of `variance / (luminance² + (mean luminance / 10)²)`. Infinite while a
    /// pixel has fewer than two samples.
    pub fn noise(&self) -> f32 {
        let n = self.pixels.len() as f64;
        let mean_luminance = |p: &PixelSum| f64::from(luminance(p.mean()));
        let average: f64 = self.pixels.iter().map(mean_luminance).sum::<f64>() / n;
        let floor = (average * 0.1).powi(2).max(f64::MIN_POSITIVE);
        let sum: f64 = self
            .pixels
            .iter()
            .map(|p| {
                let variance = p.variance().map_or(f64::INFINITY, f64::from);
                variance / (mean_luminance(p).powi(2) + floor)
            })
            .sum();
        (sum / n).sqrt() as f32
    }

    /// A plane, row by row, of values that `value` takes from pixels in tile order.
    fn rows<T: Clone + Default>(&self, value: impl Fn(&Self, usize) -> T) -> Vec<T> {
        let mut values = vec![T::default(); self.pixels.len()];
        for (place, index) in tile_rows(self.width, self.height) {
            for (value_at, i) in values[place].iter_mut().zip(index) {
                *value_at = value(self, i);
            }
        }
        values
    }

    /// Where a pixel lies in tile order.
    #[inline]
    fn index(&self, x: u32, y: u32) -> usize {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) is outside the film");
        let (tile_x, tile_y) = (x / TILE * TILE, y / TILE * TILE);
        let (width, height) = (TILE.min(self.width - tile_x), TILE.min(self.height - tile_y));
        let before = tile_y as usize * self.width as usize + (tile_x * height) as usize;
        before + ((y - tile_y) * width + x - tile_x) as usize
    }
}

/// Each row of each tile: where it lies in a picture, and where in tile order.
fn tile_rows(width: u32, height: u32) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
    let starts = |end: u32| (0..end).step_by(TILE as usize);
    let mut index = 0;
    starts(height)
        .flat_map(move |tile_y| starts(width).map(move |tile_x| (tile_x, tile_y)))
        .flat_map(move |(tile_x, tile_y)| {
            let columns = TILE.min(width - tile_x) as usize;
            let first = index;
            let rows = TILE.min(height - tile_y) as usize;
            index += columns * rows;
            (0..rows).map(move |row| {
                let place = (tile_y as usize + row) * width as usize + tile_x as usize;
                let at = first + row * columns;
                (place..place + columns, at..at + columns)
            })
        })
}

#[cfg(test)]
mod tests;
