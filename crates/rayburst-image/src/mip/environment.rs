//! Pyramids of linear pictures: environment maps, and pictures made smaller.

use glam::Vec3;

use super::downsample::Plane;
use crate::RgbImage;

/// A picture with all its smaller levels.
#[derive(Clone, Debug)]
pub struct RgbPyramid {
    levels: Vec<RgbImage>,
}

impl RgbPyramid {
    /// Builds all levels down to one pixel.
    pub fn new(picture: RgbImage) -> Self {
        let mut levels = vec![picture];
        let first = &levels[0];
        let mut last = Plane {
            width: first.width,
            height: first.height,
            channels: 3,
            values: first.pixels.iter().flat_map(|p| p.to_array()).collect(),
        };
        while last.width > 1 || last.height > 1 {
            last = last.half();
            let pixels = last.values.chunks_exact(3).map(Vec3::from_slice).collect();
            levels.push(RgbImage { width: last.width, height: last.height, pixels });
        }
        Self { levels }
    }

    /// The levels, the finest first; there is always one.
    pub fn levels(&self) -> &[RgbImage] {
        &self.levels
    }
}
