//! What can keep a picture from being rendered.

use rayburst_image::ImageError;

/// A failure of this crate. Messages say what, where, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A setting is out of its range.
    #[error("{name} is {value}, but must be {must_be}")]
    Setting {
        /// Which setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        must_be: &'static str,
    },
    /// A saved render differs from the one that shall continue it.
    #[error(
        "the saved picture cannot be continued: its {name} is {saved}, this render's is {now}; use the \
         same, or render to another file"
    )]
    Resume {
        /// Which property.
        name: String,
        /// Its value in the file.
        saved: String,
        /// Its value here.
        now: String,
    },
    /// The rasteriser.
    #[error(transparent)]
    Raster(#[from] rayburst_raster::RasterError),
    /// A filter.
    #[error(transparent)]
    Denoise(#[from] rayburst_denoise::DenoiseError),
    /// The film or a file.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// The crate's result.
pub type Result<T, E = RenderError> = std::result::Result<T, E>;
