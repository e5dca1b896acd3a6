//! `cargo xtask ltc`: the table of polygon lights' lobes, fitted anew.

use std::process::Command;

const TABLE: &str = "crates/rayburst-scene/src/ltc/table.bin";

/// Writes the table; with `--check` compares it instead.
pub(crate) fn run(arguments: &[&str]) -> Result<(), String> {
    let mut command = Command::new("cargo");
    command.args("run --quiet -p rayburst-scene --example ltc_table --".split(' '));
    let status = command.arg(TABLE).args(arguments).status();
    let status = status.map_err(|e| format!("cannot run cargo: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("the fit failed ({status})")) }
}
