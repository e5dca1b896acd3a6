//! What can end a command, with its exit code and its one line for the user.

use std::{fmt, io, path::PathBuf};

/// Why a command stopped.
#[derive(Debug)]
pub(crate) enum CliError {
    /// The command line asks for something that makes no sense; exit code 2.
    Usage(String),
    /// The command line is fine, the work failed; exit code 1.
    Failed(String),
    /// Whoever read the results has gone away (`rayburst scenes | head -1`); nothing to complain of.
    PipeClosed,
}

/// The result of a command or a part of it.
pub(crate) type Result<T, E = CliError> = std::result::Result<T, E>;

impl CliError {
    /// A wrong command line.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self::Usage(message.into())
    }

    /// Work that failed.
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self::Failed(message.into())
    }

    /// A file that cannot be read or written, in the words of the system.
    pub(crate) fn file(action: &str, path: &std::path::Path, source: &io::Error) -> Self {
        Self::Failed(format!("cannot {action} {}: {}", path.display(), describe(source)))
    }

    /// The process's exit code.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::PipeClosed => 0,
            Self::Failed(_) => 1,
            Self::Usage(_) => 2,
        }
    }

    /// The line for stderr, if there is anything to say.
    pub(crate) fn line(&self) -> Option<String> {
        match self {
            Self::PipeClosed => None,
            Self::Failed(message) | Self::Usage(message) => {
                // Whatever a library says ends up as one line.
                let words: Vec<&str> = message.split_whitespace().collect();
                Some(format!("error: {}", words.join(" ")))
            }
        }
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.line().unwrap_or_default())
    }
}

macro_rules! failures {
    ($($source:ty),* $(,)?) => {
        $(impl From<$source> for CliError {
            fn from(source: $source) -> Self {
                Self::Failed(source.to_string())
            }
        })*
    };
}

failures!(
    rayburst::image::ImageError,
    rayburst::accel::BuildError,
    rayburst_bench::BenchError,
    rayburst::render::RenderError,
    rayburst::scene::FlattenError,
    rayburst::scene::import::ImportError,
);

/// The system's reason without its error number.
pub(crate) fn describe(source: &io::Error) -> String {
    match source.kind() {
        io::ErrorKind::NotFound => "there is no such file or folder".into(),
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        io::ErrorKind::ReadOnlyFilesystem => "the file system is read-only".into(),
        io::ErrorKind::StorageFull => "no space left on the device".into(),
        io::ErrorKind::IsADirectory => "it is a folder".into(),
        _ => {
            let text = source.to_string();
            text.split(" (os error").next().unwrap_or(&text).to_owned()
        }
    }
}

/// A path for messages.
pub(crate) fn shown(path: &std::path::Path) -> PathBuf {
    path.strip_prefix("./").unwrap_or(path).to_owned()
}
