//! PNG pictures of 8 or 16 bits, and reading PNG and JPEG as linear pictures.

use std::io::{BufWriter, Write};
use std::path::Path;

use glam::Vec3;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageEncoder};

use crate::colour::{srgb_decode, srgb_table};
use crate::file::{atomic_write, read_bytes};
use crate::limits::check_size;
use crate::quantise::to_srgb16;
use crate::texture::decode_limited;
use crate::{Result, Rgb8Image, RgbImage};

/// Writes an 8-bit sRGB PNG picture, whole or not at all.
pub fn write_png(path: &Path, picture: &Rgb8Image) -> Result<()> {
    let (width, height) = (picture.width, picture.height);
    write(path, &picture.data, width, height, ExtendedColorType::Rgb8)
}

/// Writes a 16-bit sRGB PNG picture of display-linear values, whole or not at all.
pub fn write_png16(path: &Path, picture: &RgbImage) -> Result<()> {
    let words = to_srgb16(picture);
    let (width, height) = (picture.width, picture.height);
    write(path, bytemuck::cast_slice(&words), width, height, ExtendedColorType::Rgb16)
}

fn write(
    path: &Path,
    data: &[u8],
    width: u32,
    height: u32,
    colour: ExtendedColorType,
) -> Result<()> {
    check_size(&path.display().to_string(), width.into(), height.into())?;
    atomic_write(path, |w| {
        // The encoder writes small pieces and must not swallow the error of the last.
        let mut buffer = BufWriter::new(w);
        PngEncoder::new_with_quality(&mut buffer, CompressionType::Default, FilterType::Adaptive)
            .write_image(data, width, height, colour)
            .map_err(|e| match e {
                image::ImageError::IoError(e) => e,
                e => std::io::Error::other(e),
            })?;
        buffer.flush()
    })
}

/// Reads a PNG or JPEG picture as display-linear values, 0 to 1; alpha is left out.
pub fn read_ldr(path: &Path) -> Result<RgbImage> {
    decode_ldr(&read_bytes(path)?, &path.display().to_string())
}

/// Decodes a PNG or JPEG picture in memory as display-linear values; `name` is what messages call it.
pub fn decode_ldr(bytes: &[u8], name: &str) -> Result<RgbImage> {
    let picture = decode_limited(bytes, name)?;
    let (width, height) = (picture.width(), picture.height());
    let wide = matches!(
        picture,
        DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_)
    );
    let pixels = if wide {
        let word = |w: u16| srgb_decode(f32::from(w) / 65_535.0);
        picture.into_rgb16().pixels().map(|p| Vec3::from_array(p.0.map(word))).collect()
    } else {
        let table = srgb_table();
        let byte = |b: u8| table[usize::from(b)];
        picture.into_rgb8().pixels().map(|p| Vec3::from_array(p.0.map(byte))).collect()
    };
    Ok(RgbImage { width, height, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantise::{Dither, to_srgb8};

    #[test]
    fn both_depths_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let ramp = RgbImage::from_fn(64, 16, |x, y| {
            Vec3::new(x as f32 / 63.0, y as f32 / 15.0, (x * y) as f32 / 945.0)
        });
        let bytes = to_srgb8(&ramp, Dither::None);
        write_png(&path, &bytes).unwrap();
        let read = read_ldr(&path).unwrap();
        assert_eq!(to_srgb8(&read, Dither::None), bytes);
        write_png16(&path, &ramp).unwrap();
        let read = read_ldr(&path).unwrap();
        for (a, b) in ramp.pixels.iter().zip(&read.pixels) {
            assert!((*a - *b).abs().max_element() < 3e-5, "{a} {b}");
        }
    }

    #[test]
    fn a_full_disk_is_an_error() {
        if cfg!(target_os = "linux") {
            let picture = Rgb8Image { width: 64, height: 64, data: vec![9; 64 * 64 * 3] };
            let text = write_png(Path::new("/dev/full"), &picture).unwrap_err().to_string();
            assert!(text.contains("/dev/full") && text.contains("free some space"), "{text}");
        }
    }
}
