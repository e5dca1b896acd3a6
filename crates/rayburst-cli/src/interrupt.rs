//! Ctrl-C: the first one asks the work to stop and keep what it has, the second ends the process.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicU8, Ordering},
};

use crate::error::{CliError, Result};

static REQUESTS: AtomicU8 = AtomicU8::new(0);

/// Exit code of a process that the user stopped (128 + SIGINT).
const ABORTED: i32 = 130;

/// Watches for Ctrl-C (and, where there are signals, termination) from now on.
pub(crate) fn watch(output: &Path) -> Result<()> {
    let folder = match output.parent() {
        Some(parent) if parent != Path::new("") => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    ctrlc::set_handler(move || {
        if REQUESTS.fetch_add(1, Ordering::SeqCst) == 0 {
            crate::terminal::say("stopping: the picture so far is kept (again to abort)");
        } else {
            remove_parts(&folder);
            std::process::exit(ABORTED);
        }
    })
    .map_err(|e| CliError::failed(format!("cannot watch for Ctrl-C: {e}")))
}

/// Removes what this process was about to rename to its place.
fn remove_parts(folder: &Path) {
    let mine = format!(".{}-", std::process::id());
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(".part") && name.contains(&mine) {
            // The process ends either way.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Whether the user wants to stop.
pub(crate) fn requested() -> bool {
    REQUESTS.load(Ordering::SeqCst) > 0
}
