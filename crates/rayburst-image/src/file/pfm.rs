//! Portable float maps (.pfm): a text header and plain 32-bit floats, rows from the bottom.

use std::io::Write;
use std::path::Path;

use glam::Vec3;

use crate::file::{atomic_write, read_bytes};
use crate::limits::check_size;
use crate::{ImageError, Result, RgbImage};

/// Reads a PFM picture.
pub fn read_pfm(path: &Path) -> Result<RgbImage> {
    decode_pfm(&read_bytes(path)?, &path.display().to_string())
}

/// Decodes a PFM picture in memory, colour (`PF`) or grey (`Pf`), either byte order.
pub fn decode_pfm(bytes: &[u8], name: &str) -> Result<RgbImage> {
    let malformed = |reason: &str| ImageError::malformed(name, "PFM", reason);
    let mut at = 0;
    let mut word = || {
        let begin = at + bytes[at..].iter().position(|b| !b.is_ascii_whitespace())?;
        let length = bytes[begin..].iter().take(64).position(u8::is_ascii_whitespace)?;
        at = begin + length + 1;
        Some((std::str::from_utf8(&bytes[begin..begin + length]).ok()?, at))
    };
    let mut next = || word().ok_or_else(|| malformed("the header does not end"));
    let channels = match next()?.0 {
        "PF" => 3,
        "Pf" => 1,
        _ => return Err(malformed("the file does not begin with 'PF' or 'Pf'")),
    };
    let number = |text: &str| text.parse::<u32>().map_err(|_| malformed("the size is no number"));
    let (width, height) = (number(next()?.0)?, number(next()?.0)?);
    let (scale, begin) = next()?;
    let scale: f32 = scale.parse().map_err(|_| malformed("the scale is no number"))?;
    let pixels = check_size(name, width.into(), height.into())?;
    let data = bytes
        .get(begin..begin + pixels * channels * 4)
        .ok_or_else(|| malformed("the file ends too early"))?;
    let value = |i: usize| {
        let b = [data[4 * i], data[4 * i + 1], data[4 * i + 2], data[4 * i + 3]];
        if scale < 0.0 { f32::from_le_bytes(b) } else { f32::from_be_bytes(b) }
    };
    Ok(RgbImage::from_fn(width, height, |x, y| {
        let i = ((height - 1 - y) as usize * width as usize + x as usize) * channels;
        if channels == 1 {
            Vec3::splat(value(i))
        } else {
            Vec3::new(value(i), value(i + 1), value(i + 2))
        }
    }))
}

/// Writes a little-endian colour PFM picture, whole or not at all.
pub fn write_pfm(path: &Path, picture: &RgbImage) -> Result<()> {
    check_size(&path.display().to_string(), picture.width.into(), picture.height.into())?;
    atomic_write(path, |w| {
        write!(w, "PF\n{} {}\n-1.0\n", picture.width, picture.height)?;
        for row in picture.pixels.rchunks_exact(picture.width as usize) {
            w.write_all(bytemuck::cast_slice(row))?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_come_back_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pfm");
        let picture = RgbImage::from_fn(5, 4, |x, y| Vec3::new(x as f32, y as f32, 1e-30));
        write_pfm(&path, &picture).unwrap();
        assert_eq!(read_pfm(&path).unwrap(), picture);
        let bytes = std::fs::read(&path).unwrap();
        assert!(decode_pfm(&bytes[..bytes.len() - 1], "a").is_err());
        let grey = b"Pf 1 2 1.0\n\x3f\x80\0\0\x40\0\0\0";
        let grey = decode_pfm(grey, "grey").unwrap();
        assert_eq!(grey.pixels, [Vec3::splat(2.0), Vec3::ONE]);
    }
}
