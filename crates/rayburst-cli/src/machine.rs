//! The threads that everything runs on.

use crate::error::{CliError, Result};

/// Starts the one pool of the process.
pub(crate) fn start(threads: Option<usize>) -> Result<()> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build_global()
        .map_err(|e| CliError::failed(format!("cannot start the threads: {e}")))
}
