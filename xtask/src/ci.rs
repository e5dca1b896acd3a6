//! `cargo xtask ci`: exactly what continuous integration runs.

use std::process::Command;

use crate::{book, portable, tidy};

/// The README's second command; `ci` runs this very line.
const TEST_COMMAND: &str = "cargo test --workspace";

/// Runs every step, stopping at the first that fails.
pub(crate) fn run() -> Result<(), String> {
    step("cargo fmt --all --check", &[])?;
    tidy::run()?;
    book::run()?;
    step("cargo clippy --workspace --all-targets -- -D warnings", &[])?;
    step("cargo clippy -p rayburst-cli --features bench-peers --all-targets -- -D warnings", &[])?;
    portable::run()?;
    step("cargo doc --workspace --no-deps", &[("RUSTDOCFLAGS", "-D warnings")])?;
    let readme = std::fs::read_to_string("README.md").map_err(|e| format!("README.md: {e}"))?;
    if !readme.lines().any(|line| line.trim() == TEST_COMMAND) {
        return Err(format!("README.md does not name the test command `{TEST_COMMAND}`"));
    }
    step(TEST_COMMAND, &[])
}

fn step(line: &str, environment: &[(&str, &str)]) -> Result<(), String> {
    eprintln!("$ {line}");
    let mut words = line.split(' ');
    let program = words.next().unwrap_or_default();
    let status = Command::new(program)
        .args(words)
        .envs(environment.iter().copied())
        .status()
        .map_err(|e| format!("cannot run `{line}`: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("`{line}` failed ({status})")) }
}
