//! Picture files: OpenEXR, Radiance HDR, PFM, PNG, JPEG (reading) and animated GIF (writing).

pub mod atomic;
pub mod exr;
pub mod gif;
pub mod hdr;
pub mod pfm;
pub mod png;

use std::path::Path;

pub use atomic::atomic_write;

use crate::{ImageError, LayeredImage, Result, RgbImage};

/// The largest file that is read: 4 GiB.
const MAX_FILE_BYTES: u64 = 1 << 32;

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

/// A file's bytes, with the file's name in the error.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let error = |source| ImageError::Read { path: path.to_owned(), source };
    let length = std::fs::metadata(path).map_err(error)?.len();
    if length > MAX_FILE_BYTES {
        let name = path.display().to_string();
        return Err(ImageError::TooManyBytes { name, bytes: length.into(), limit: MAX_FILE_BYTES });
    }
    std::fs::read(path).map_err(error)
}
