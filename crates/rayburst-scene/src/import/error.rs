//! Why a scene could not be read.

use std::{io, path::PathBuf};

use super::resolve::ResolveError;

/// Why a scene could not be read. Every message names the file, the place in it and, where there is
/// one, the way out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The operating system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The content breaks the rules of its format.
    #[error("{}: {location}: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// A line, a byte offset or a JSON pointer.
        location: String,
        /// What is wrong there.
        reason: String,
    },
    /// The file says that it cannot be read without an extension that is not supported.
    #[error("{}: requires the extension {name}, which is not supported; {way_out}", path.display())]
    UnsupportedExtension {
        /// The file.
        path: PathBuf,
        /// Name of the extension.
        name: String,
        /// How to get a file that can be read.
        way_out: String,
    },
    /// A file that the scene needs lies outside its folder.
    #[error(
        "{}: '{uri}' leaves the scene's folder; copy it there, or allow external files \
         (--allow-external) if you trust the scene",
        path.display()
    )]
    OutsideFolder {
        /// The scene.
        path: PathBuf,
        /// What it refers to.
        uri: String,
    },
    /// Reading on would take more memory than allowed.
    #[error("{}: {location}: {what} exceeds the limit of {limit}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// A line, a byte offset or a JSON pointer.
        location: String,
        /// What is too large, with its size.
        what: String,
        /// The limit, with its unit.
        limit: String,
    },
    /// Neither the file's name nor its content tells its format.
    #[error(
        "{}: unknown scene format; .gltf, .glb, .obj and .ply files can be read",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
}

impl ImportError {
    /// A [`ImportError::Malformed`].
    pub fn malformed(
        path: impl Into<PathBuf>,
        location: impl Into<String>,
        reason: impl Into<String>,
    ) -> Self {
        Self::Malformed { path: path.into(), location: location.into(), reason: reason.into() }
    }

    /// The error of a reference from `path` that the scene cannot do without.
    pub fn unresolved(
        path: impl Into<PathBuf>,
        location: impl Into<String>,
        error: ResolveError,
    ) -> Self {
        let path = path.into();
        match error {
            ResolveError::Outside { uri } => Self::OutsideFolder { path, uri },
            ResolveError::Io { path, source } => Self::Io { path, source },
            ResolveError::TooLarge { what, limit } => Self::TooLarge {
                path,
                location: location.into(),
                what,
                limit: format!("{limit} bytes"),
            },
            other => Self::malformed(path, location, other.to_string()),
        }
    }
}
