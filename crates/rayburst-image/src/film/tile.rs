//! Exclusive access to one tile of a film.

use glam::Vec3;

use super::{AovMode, AovSpec, PixelSum, Sum};

/// One tile: adds samples to its pixels.
#[derive(Debug)]
pub struct FilmTile<'a> {
    /// The first pixel's column in the film.
    pub x: u32,
    /// The first pixel's row in the film.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    pixels: &'a mut [PixelSum],
    values: &'a mut [Sum],
    aovs: &'a [AovSpec],
}

impl<'a> FilmTile<'a> {
    pub(super) fn new(
        [x, y, width, height]: [u32; 4],
        pixels: &'a mut [PixelSum],
        values: &'a mut [Sum],
        aovs: &'a [AovSpec],
    ) -> Self {
        Self { x, y, width, height, pixels, values, aovs }
    }

    /// The number of pixels.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether it has no pixels; no tile of a film is empty.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// The film coordinates of the tile's pixel `i`, row by row.
    #[inline]
    pub fn position(&self, i: usize) -> (u32, u32) {
        (self.x + i as u32 % self.width, self.y + i as u32 / self.width)
    }

    /// The sums of the tile's pixel `i`.
    #[inline]
    pub fn pixel(&self, i: usize) -> &PixelSum {
        &self.pixels[i]
    }

    /// Adds a sample to the tile's pixel `i`. `aovs` holds the values of all AOVs' channels, one
    /// after the other; values that are not finite count as 0. A sample that is not finite is
    /// dropped with its AOVs, and counted.
    #[inline]
    pub fn add(&mut self, i: usize, rgb: Vec3, aovs: &[f32]) {
        let stride = self.values.len() / self.pixels.len();
        let values = &mut self.values[i * stride..][..stride];
        add(&mut self.pixels[i], values, self.aovs, rgb, aovs);
    }
}

#[inline]
pub(super) fn add(
    pixel: &mut PixelSum,
    values: &mut [Sum],
    specs: &[AovSpec],
    rgb: Vec3,
    aovs: &[f32],
) {
    assert_eq!(values.len(), aovs.len(), "one value for each channel of each AOV");
    let first = pixel.samples == 0;
    if !pixel.add(rgb) || values.is_empty() {
        return;
    }
    let mut i = 0;
    for spec in specs {
        for _ in &spec.channels {
            let value = if aovs[i].abs() <= super::MAX_SAMPLE { aovs[i] } else { 0.0 };
            match spec.mode {
                AovMode::Mean => values[i].add(value),
                AovMode::First if first => values[i].hi = value,
                AovMode::First => {}
            }
            i += 1;
        }
    }
}
