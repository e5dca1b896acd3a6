//! What can go wrong with pictures and their files.

use std::io;
use std::path::PathBuf;

/// A failure of this crate. Messages say what, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file could not be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file could not be written; whatever stood there before is untouched.
    #[error("cannot write {}: {source}{}", path.display(), advice(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The bytes are not a well-formed picture of that format.
    #[error("{name}: not a readable {format} picture: {reason}")]
    Malformed {
        /// The file or other name of the bytes.
        name: String,
        /// The format that was expected.
        format: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// The picture may be well-formed, but uses something that is not read or written here.
    #[error("{name}: {reason}")]
    Unsupported {
        /// The file or other name of the bytes.
        name: String,
        /// What is not supported, and a way out.
        reason: String,
    },
    /// More pixels than allowed.
    #[error("{name}: {width}x{height} is {} pixels, the limit is {limit}", *width as u128 * *height as u128)]
    TooManyPixels {
        /// The file or other name of the picture.
        name: String,
        /// Width asked for.
        width: u64,
        /// Height asked for.
        height: u64,
        /// The limit in pixels.
        limit: u64,
    },
    /// More memory than allowed.
    #[error("{name}: the picture needs {bytes} bytes of memory, the limit is {limit}")]
    TooManyBytes {
        /// The file or other name of the picture.
        name: String,
        /// Bytes asked for.
        bytes: u128,
        /// The limit in bytes.
        limit: u64,
    },
    /// No pixels at all.
    #[error("{name}: {width}x{height} is an empty picture; both sides must be at least 1")]
    Empty {
        /// The file or other name of the picture.
        name: String,
        /// Width asked for.
        width: u64,
        /// Height asked for.
        height: u64,
    },
    /// Two pictures that must have the same size do not.
    #[error("the pictures differ in size: {}x{} and {}x{}", a.0, a.1, b.0, b.1)]
    SizeMismatch {
        /// Width and height of the first.
        a: (u32, u32),
        /// Width and height of the second.
        b: (u32, u32),
    },
    /// A value that contradicts another one.
    #[error("{0}")]
    Invalid(String),
}

/// The crate's result.
pub type Result<T, E = ImageError> = std::result::Result<T, E>;

fn advice(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            " (free some space, or write somewhere else)"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            " (choose a folder that you may write to)"
        }
        io::ErrorKind::NotFound => " (does the folder exist?)",
        _ => "",
    }
}

impl ImageError {
    pub(crate) fn malformed(name: &str, format: &'static str, reason: impl ToString) -> Self {
        Self::Malformed { name: name.to_owned(), format, reason: reason.to_string() }
    }

    pub(crate) fn unsupported(name: &str, reason: impl Into<String>) -> Self {
        Self::Unsupported { name: name.to_owned(), reason: reason.into() }
    }
}
