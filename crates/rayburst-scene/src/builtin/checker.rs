//! Checkerboard textures.

use std::sync::Arc;

use rayburst_image::{MipMap, TexelFormat, Texels};

use crate::{Scene, Texture};

/// Texels along a side of a square: enough that its edges stay sharp seen from near.
const SQUARE: u32 = 128;

/// Adds a repeating texture of 2×2 squares in two sRGB colours and returns its index.
pub(super) fn add_checker(scene: &mut Scene, colors: [[u8; 3]; 2]) -> u32 {
    let side = 2 * SQUARE;
    let mut data = Vec::with_capacity((side * side * 3) as usize);
    for y in 0..side {
        for x in 0..side {
            data.extend(colors[((x / SQUARE + y / SQUARE) % 2) as usize]);
        }
    }
    let texels = Texels { width: side, height: side, channels: 3, data };
    scene.images.push(Arc::new(MipMap::new(texels, TexelFormat::Srgb)));
    scene.textures.push(Texture::new(scene.images.len() as u32 - 1));
    scene.textures.len() as u32 - 1
}
