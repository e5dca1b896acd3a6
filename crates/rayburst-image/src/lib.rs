//! Pictures: files, film, tone maps, mip maps and metrics.
//!
//! Radiance is linear Rec. 709 throughout; files of 8 or 16 bits hold sRGB. What comes from files
//! is checked before memory is taken for it, and files are written whole or not at all.
//!
//! ```
//! use rayburst_image::{Dither, Film, ToneMap, exposure, quantise, write_png};
//! use glam::Vec3;
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("ramp.png");
//! let mut film = Film::new(64, 32, &[])?;
//! for y in 0..32 {
//!     for x in 0..64 {
//!         film.add(x, y, Vec3::splat(x as f32), &[]);
//!     }
//! }
//! let picture = film.mean();
//! let shown = ToneMap::Agx.apply_image(&picture, exposure::auto_exposure(&picture));
//! write_png(&path, &quantise::to_srgb8(&shown, Dither::Triangular))?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
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
pub mod plane;
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
pub use plane::{Band, Band3, Plane, Plane3};
pub use quantise::Dither;
pub use texture::{Texels, decode_texture};
pub use tonemap::ToneMap;
