//! Picture files: OpenEXR, Radiance HDR, PFM, PNG, JPEG (reading) and animated GIF (writing).

pub mod atomic;
pub mod exr;
pub mod gif;
pub mod hdr;
pub mod pfm;
pub mod png;

use std::fs::File;
use std::io::Read;
use std::path::Path;

pub use atomic::atomic_write;

use crate::{ImageError, LayeredImage, Result, RgbImage};

/// The largest file that is read: 4 GiB.
const MAX_FILE_BYTES: u64 = 1 << 32;

/// The most that is read from what is not a regular file: 128 MiB.
const MAX_PIPE_BYTES: u64 = 1 << 27;

/// The formats of pictures that are read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// OpenEXR: linear floats, layers.
    Exr,
    /// Radiance: linear, shared exponents.
    Hdr,
    /// Portable float map: linear floats.
    Pfm,
    /// PNG: display-encoded.
    Png,
    /// JPEG: display-encoded, read only.
    Jpeg,
    /// GIF: display-encoded, written only.
    Gif,
}

impl PictureFormat {
    /// The format by a path's extension.
    pub fn from_path(path: &Path) -> Option<Self> {
        Some(match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "exr" => Self::Exr,
            "hdr" | "pic" | "rgbe" => Self::Hdr,
            "pfm" => Self::Pfm,
            "png" => Self::Png,
            "jpg" | "jpeg" => Self::Jpeg,
            "gif" => Self::Gif,
            _ => return None,
        })
    }

    /// The format by a file's first bytes.
    fn sniff(bytes: &[u8]) -> Self {
        let starts = |magic: &[u8]| bytes.starts_with(magic);
        if starts(&[0x76, 0x2f, 0x31, 0x01]) {
            Self::Exr
        } else if starts(b"#?") {
            Self::Hdr
        } else if starts(b"PF") || starts(b"Pf") {
            Self::Pfm
        } else {
            // The decoder of PNG and JPEG names what it finds instead.
            Self::Png
        }
    }

    /// Whether its values are linear radiance, without tone mapping.
    pub fn is_linear(self) -> bool {
        matches!(self, Self::Exr | Self::Hdr | Self::Pfm)
    }
}

/// Reads any picture as linear RGB; the content decides the format. Of an EXR file it is the
/// beauty, or else the first layer with colours.
pub fn read_picture(path: &Path) -> Result<RgbImage> {
    decode_picture(&read_bytes(path)?, &path.display().to_string())
}

/// Decodes any picture in memory as linear RGB; `name` is what messages call it.
pub fn decode_picture(bytes: &[u8], name: &str) -> Result<RgbImage> {
    match PictureFormat::sniff(bytes) {
        PictureFormat::Exr => {
            let image = exr::decode_exr(bytes, name)?;
            image.beauty().ok_or_else(|| {
                ImageError::unsupported(name, "no layer of the file has colours (R, G, B or Y)")
            })
        }
        PictureFormat::Hdr => hdr::decode_hdr(bytes, name),
        PictureFormat::Pfm => pfm::decode_pfm(bytes, name),
        _ => png::decode_ldr(bytes, name),
    }
}

/// Writes a picture of linear values as EXR, HDR or PFM by the path's extension.
pub fn write_linear(path: &Path, picture: &RgbImage) -> Result<()> {
    match PictureFormat::from_path(path) {
        Some(PictureFormat::Exr) => exr::write_exr(path, &LayeredImage::from_rgb(picture)),
        Some(PictureFormat::Hdr) => hdr::write_hdr(path, picture),
        Some(PictureFormat::Pfm) => pfm::write_pfm(path, picture),
        _ => Err(ImageError::unsupported(
            &path.display().to_string(),
            "linear pictures are written as .exr, .hdr or .pfm",
        )),
    }
}

/// A file's bytes, with the file's name in the error. Pipes are read too, devices without an end
/// up to a limit.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let error = |source| ImageError::Read { path: path.to_owned(), source };
    let file = File::open(path).map_err(error)?;
    let meta = file.metadata().map_err(error)?;
    let limit = if meta.is_file() { MAX_FILE_BYTES } else { MAX_PIPE_BYTES };
    let too_large = |bytes: u64| {
        let name = path.display().to_string();
        ImageError::TooManyBytes { name, bytes: bytes.into(), limit }
    };
    if meta.len() > limit {
        return Err(too_large(meta.len()));
    }
    let mut bytes = Vec::with_capacity(meta.len() as usize);
    file.take(limit + 1).read_to_end(&mut bytes).map_err(error)?;
    if bytes.len() as u64 > limit {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_missing_files_are_errors_with_a_name() {
        let folder = tempfile::tempdir().unwrap();
        for path in [folder.path().to_owned(), folder.path().join("missing.png")] {
            let text = read_bytes(&path).unwrap_err().to_string();
            assert!(text.starts_with(&format!("cannot read {}: ", path.display())), "{text}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_without_an_end_is_refused() {
        let text = read_bytes(Path::new("/dev/zero")).unwrap_err().to_string();
        assert!(text.contains("the limit is 134217728"), "{text}");
    }
}
