//! stdout carries results, stderr everything else; neither may panic when nobody listens.

use std::io::{self, Write as _};

use crate::error::{CliError, Result};

/// Writes a result to stdout, with a line end.
pub(crate) fn result(text: impl AsRef<str>) -> Result<()> {
    let mut out = io::stdout().lock();
    let written = out
        .write_all(text.as_ref().as_bytes())
        .and_then(|()| out.write_all(b"\n"))
        .and_then(|()| out.flush());
    match written {
        Ok(()) => Ok(()),
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Err(CliError::PipeClosed),
        Err(e) => Err(CliError::failed(format!(
            "cannot write to standard output: {}",
            crate::error::describe(&e)
        ))),
    }
}

/// Says something on stderr.
pub(crate) fn say(text: impl AsRef<str>) {
    let mut err = io::stderr().lock();
    // With stderr closed there is nobody left to tell.
    let _ = writeln!(err, "{}", text.as_ref());
}

/// Says on stderr what the user did not ask for but should know.
pub(crate) fn note(text: impl AsRef<str>) {
    say(format!("note: {}", text.as_ref()));
}

/// Says on stderr what may not be as the user wanted it.
pub(crate) fn warn(text: impl AsRef<str>) {
    say(format!("warning: {}", text.as_ref()));
}
