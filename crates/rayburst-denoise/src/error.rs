//! What can go wrong.

use std::ops::RangeInclusive;

use rayburst_image::ImageError;

/// A failure of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DenoiseError {
    /// The picture is empty or too large.
    #[error(transparent)]
    Size(#[from] ImageError),
    /// Planes that belong together differ in size.
    #[error("{name} is {}×{} pixels, but the picture is {}×{}: all planes must be of one size", found.0, found.1, expected.0, expected.1)]
    Mismatch {
        /// Which plane.
        name: &'static str,
        /// Its size.
        found: (u32, u32),
        /// The size of the picture.
        expected: (u32, u32),
    },
    /// A setting is out of its range.
    #[error("{name} is {value}; it must be {range}")]
    Setting {
        /// Which setting.
        name: &'static str,
        /// What it was.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, DenoiseError>;

/// Fails where a setting is not in its range, which is said in words, too.
pub(crate) fn check(
    name: &'static str,
    value: f32,
    range: RangeInclusive<f32>,
    words: &'static str,
) -> Result<()> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(DenoiseError::Setting { name, value: f64::from(value), range: words })
}
