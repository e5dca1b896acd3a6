//! The proof tools of `rayburst-verify` in the profiles they want, and Miri.

use std::process::Command;

/// Arguments of cargo that build and run a command of `rayburst-verify`.
const RELEASE: &[&str] = &["run", "--quiet", "--release", "-p", "rayburst-verify", "--"];
/// The same with assertions on.
const CHECKED: &[&str] = &[
    "run",
    "--quiet",
    "--profile",
    "checked",
    "-p",
    "rayburst-verify",
    "--no-default-features",
    "--",
];

/// `cargo xtask verify`.
pub(crate) fn verify(arguments: &[&str]) -> Result<(), String> {
    cargo(RELEASE, "leaks", arguments)
}

/// `cargo xtask fuzz`.
pub(crate) fn fuzz(arguments: &[&str]) -> Result<(), String> {
    cargo(CHECKED, "fuzz", arguments)
}

/// `cargo xtask instructions`.
pub(crate) fn instructions() -> Result<(), String> {
    cargo(RELEASE, "instructions", &[])
}

/// `cargo xtask miri`: the small scenes of `rayburst-accel`'s tests, in plain Rust.
pub(crate) fn miri() -> Result<(), String> {
    let test = "+nightly miri test -p rayburst-accel --test all -- small::";
    // Crates below rayon do not follow stacked borrows; it keeps its threads until the end.
    let flags = "-Zmiri-tree-borrows -Zmiri-disable-isolation -Zmiri-ignore-leaks -Zmiri-permissive-provenance";
    let mut command = Command::new("cargo");
    command.args(test.split(' ')).env("MIRIFLAGS", flags).env("RAYBURST_ISA", "scalar");
    finish(command, "Miri")
}

fn cargo(cargo: &[&str], verb: &str, arguments: &[&str]) -> Result<(), String> {
    let mut command = Command::new("cargo");
    command.args(cargo).arg(verb).args(arguments);
    finish(command, verb)
}

fn finish(mut command: Command, what: &str) -> Result<(), String> {
    let status = command.status().map_err(|e| format!("cannot run cargo: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("{what} failed ({status})")) }
}
