//! Radiance pictures (.hdr): a shared 8-bit exponent for three 8-bit mantissas (RGBE).
//!
//! Ward: "Real Pixels", Graphics Gems II, 1991. Files come flat, in the old run lengths, or in
//! the new ones (each component of a row by itself). Values are relative to white 1, linear Rec. 709.

mod decode;
mod encode;

use std::io::Write;
use std::path::Path;

pub use decode::decode_hdr;
pub use encode::encode_hdr;

use crate::file::{atomic_write, read_bytes};
use crate::{Result, RgbImage};

/// Reads a Radiance picture.
pub fn read_hdr(path: &Path) -> Result<RgbImage> {
    decode_hdr(&read_bytes(path)?, &path.display().to_string())
}

/// Writes a Radiance picture, whole or not at all.
pub fn write_hdr(path: &Path, picture: &RgbImage) -> Result<()> {
    let bytes = encode_hdr(picture, &path.display().to_string())?;
    atomic_write(path, |w| w.write_all(&bytes))
}
