//! 8-bit textures as scenes bring them: PNG and JPEG, in memory.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader, Limits};

use crate::limits::{MAX_TEXTURE_SIDE, check_size};
use crate::{ImageError, Result};

/// The most memory a decoder may take for one texture: 1 GiB.
const MAX_DECODER_BYTES: u64 = 1 << 30;

/// A decoded texture: interleaved bytes, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texels {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha.
    pub channels: u8,
    /// `width * height * channels` bytes.
    pub data: Vec<u8>,
}

/// Decodes a PNG or JPEG texture; `name` is what messages call it.
///
/// The content decides the format, not the name. Palettes are expanded, 16-bit samples rounded to
/// 8, grey pictures stay grey. Sides are at most [`MAX_TEXTURE_SIDE`].
pub fn decode_texture(bytes: &[u8], name: &str) -> Result<Texels> {
    let picture = decode_limited(bytes, name)?;
    let (width, height) = (picture.width(), picture.height());
    let (channels, data) = match picture {
        DynamicImage::ImageLuma8(p) => (1, p.into_raw()),
        DynamicImage::ImageLumaA8(p) => (2, p.into_raw()),
        DynamicImage::ImageRgb8(p) => (3, p.into_raw()),
        DynamicImage::ImageRgba8(p) => (4, p.into_raw()),
        DynamicImage::ImageLuma16(p) => (1, to_bytes(&p)),
        DynamicImage::ImageLumaA16(p) => (2, to_bytes(&p)),
        DynamicImage::ImageRgb16(p) => (3, to_bytes(&p)),
        DynamicImage::ImageRgba16(p) => (4, to_bytes(&p)),
        _ => return Err(ImageError::unsupported(name, "a texture of floats; save it as PNG")),
    };
    Ok(Texels { width, height, channels, data })
}

fn to_bytes(words: &[u16]) -> Vec<u8> {
    words.iter().map(|&w| ((u32::from(w) * 255 + 32_767) / 65_535) as u8).collect()
}

/// Decodes PNG or JPEG after its size has been found harmless.
pub(crate) fn decode_limited(bytes: &[u8], name: &str) -> Result<DynamicImage> {
    let format = sniff(bytes, name)?;
    let label = if format == ImageFormat::Png { "PNG" } else { "JPEG" };
    let malformed = |e: image::ImageError| match e {
        image::ImageError::Unsupported(e) => ImageError::unsupported(name, e.to_string()),
        image::ImageError::Limits(e) => ImageError::unsupported(
            name,
            format!(
                "too large to decode ({e}); the limit is {MAX_TEXTURE_SIDE}x{MAX_TEXTURE_SIDE}"
            ),
        ),
        e => ImageError::malformed(name, label, e),
    };
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_TEXTURE_SIDE);
    limits.max_image_height = Some(MAX_TEXTURE_SIDE);
    limits.max_alloc = Some(MAX_DECODER_BYTES);

    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits.clone());
    let (width, height) = reader.into_dimensions().map_err(malformed)?;
    let pixels = check_size(name, width.into(), height.into())?;
    // Deflate packs at most 1032 bytes into one, a palette 8 pixels into a byte; JPEG spends at
    // least a bit on a block of 64 pixels.
    let most = if format == ImageFormat::Png { 8 * 1032 } else { 8 * 64 };
    if pixels / most > bytes.len() {
        let reason = format!(
            "the header promises {width}x{height} pixels, more than {} bytes can hold",
            bytes.len()
        );
        return Err(ImageError::malformed(name, label, reason));
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    reader.decode().map_err(malformed)
}

fn sniff(bytes: &[u8], name: &str) -> Result<ImageFormat> {
    let starts = |magic: &[u8]| bytes.starts_with(magic);
    let other = if starts(b"\x89PNG\r\n\x1a\n") {
        return Ok(ImageFormat::Png);
    } else if starts(b"\xff\xd8\xff") {
        return Ok(ImageFormat::Jpeg);
    } else if starts(b"\xabKTX 20\xbb") {
        "KTX2"
    } else if starts(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        "WebP"
    } else if starts(b"DDS ") {
        "DDS"
    } else if starts(b"BM") {
        "BMP"
    } else if starts(b"GIF8") {
        "GIF"
    } else {
        let reason = "neither a PNG nor a JPEG picture by its first bytes";
        return Err(ImageError::unsupported(name, reason));
    };
    Err(ImageError::unsupported(name, format!("{other} is not read; convert it to PNG or JPEG")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(picture: &DynamicImage) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn channels_are_kept_and_words_rounded() {
        let grey = image::GrayImage::from_fn(5, 3, |x, y| image::Luma([(x * 40 + y) as u8]));
        let texels = decode_texture(&png(&grey.clone().into()), "grey").unwrap();
        assert_eq!((texels.width, texels.height, texels.channels), (5, 3, 1));
        assert_eq!(texels.data, grey.into_raw());

        let words = image::ImageBuffer::from_fn(256, 1, |x, _| {
            image::Rgba([x as u16 * 257, 65_535, 128, 129])
        });
        let texels = decode_texture(&png(&DynamicImage::ImageRgba16(words)), "words").unwrap();
        assert_eq!(texels.channels, 4);
        for (i, texel) in texels.data.chunks(4).enumerate() {
            assert_eq!(texel, [i as u8, 255, 0, 1]);
        }
    }

    #[test]
    fn jpeg_is_read_whatever_the_name() {
        let picture = image::RgbImage::from_pixel(16, 8, image::Rgb([200, 100, 50]));
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        let texels = decode_texture(bytes.get_ref(), "wrong.png").unwrap();
        assert_eq!((texels.width, texels.height, texels.channels), (16, 8, 3));
        assert!(texels.data[0].abs_diff(200) < 6 && texels.data[2].abs_diff(50) < 6);
    }

    #[test]
    fn other_formats_are_named() {
        let text = decode_texture(b"\xabKTX 20\xbb\r\n", "a.ktx2").unwrap_err().to_string();
        assert_eq!(text, "a.ktx2: KTX2 is not read; convert it to PNG or JPEG");
        assert!(decode_texture(b"", "a").is_err());
    }

    #[test]
    fn a_small_file_with_a_huge_header_is_refused() {
        let picture = DynamicImage::ImageRgb8(image::RgbImage::new(4, 4));
        let mut bytes = png(&picture);
        bytes[16..20].copy_from_slice(&16_000u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&16_000u32.to_be_bytes());
        let crc = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        let text = decode_texture(&bytes, "bomb.png").unwrap_err().to_string();
        assert!(text.contains("16000x16000"), "{text}");
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |crc, &b| {
            (0..8).fold(crc ^ u32::from(b), |c, _| {
                (c >> 1) ^ (0xEDB8_8320 & (0u32.wrapping_sub(c & 1)))
            })
        })
    }
}
