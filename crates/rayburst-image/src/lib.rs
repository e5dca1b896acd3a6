//! Pictures: files, film, tone maps, mip maps and metrics.
//!
//! Radiance is linear Rec. 709 throughout. Pictures in files of 8 or 16 bits are sRGB.
#![forbid(unsafe_code)]

pub mod colour;
mod error;
pub mod exposure;
pub mod falsecolour;
pub mod file;
pub mod film;
pub mod filter;
pub mod limits;
pub mod metrics;
pub mod mip;
pub mod picture;
pub mod quantise;
pub mod texture;
pub mod tonemap;

pub use error::{ImageError, Result};
pub use falsecolour::ColourMap;
pub use file::exr::{decode_exr, encode_exr, read_exr, write_exr};
pub use file::gif::write_gif;
pub use file::hdr::{decode_hdr, read_hdr, write_hdr};
pub use file::png::{decode_ldr, read_ldr, write_png, write_png16};
pub use file::{PictureFormat, atomic_write, decode_picture, read_picture, write_linear};
pub use film::{AovMode, AovSpec, Film, FilmTile};
pub use filter::{FilterKind, PixelFilter};
pub use limits::check_size;
pub use metrics::{Comparison, Metric, StoredAs, compare};
pub use mip::{MipMap, RgbPyramid, TexelFormat};
pub use picture::{Channel, Layer, LayeredImage, Precision, Rgb8Image, RgbImage};
pub use quantise::Dither;
pub use texture::{Texels, decode_texture};
pub use tonemap::ToneMap;
