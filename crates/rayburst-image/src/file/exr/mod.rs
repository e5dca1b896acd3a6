//! OpenEXR files: named planes of half or 32-bit floats, with text attributes.
//!
//! Layers are channel name prefixes in one part (`albedo.R`), which every viewer understands; the
//! beauty has none. Compression is ZIP (16 lines a block), lossless.

mod blocks;
mod read;
mod write;

pub use read::{decode_exr, read_exr};
pub use write::{encode_exr, write_exr};

/// Attributes that the format gives a name and a type of its own, and that are text.
const STANDARD_TEXT: [&str; 4] = ["comments", "owner", "software", "capDate"];
