//! What can go wrong.

use rayburst_image::ImageError;

/// A failure of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The picture is empty or too large.
    #[error(transparent)]
    Size(#[from] ImageError),
    /// A side of the picture is longer than pixel coordinates go.
    #[error("a picture of {0} × {1} pixels is too large to rasterise (at most 65535 a side)")]
    TooLarge(u32, u32),
    /// More triangles than have numbers.
    #[error("{0} triangles are too many to rasterise (at most 4294967294, instances counted)")]
    TooMany(u64),
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, RasterError>;
