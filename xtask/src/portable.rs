//! Targets other than this machine's: lints of the crates that hold kernels, where rustup has the
//! target already, so that nothing is downloaded.

use std::{path::Path, process::Command};

/// Targets, and what their instruction sets need.
const TARGETS: &[(&str, &str)] = &[
    ("aarch64-unknown-linux-gnu", ""),
    ("wasm32-unknown-unknown", ""),
    ("wasm32-unknown-unknown", "-C target-feature=+simd128"),
];

/// Checks every target that is installed and says which are not.
pub(crate) fn run() -> Result<(), String> {
    let sysroot = Command::new("rustc").args(["--print", "sysroot"]).output();
    let sysroot = sysroot.map_err(|e| format!("cannot run rustc: {e}"))?;
    let sysroot = String::from_utf8_lossy(&sysroot.stdout).trim().to_owned();
    for (target, flags) in TARGETS {
        if !Path::new(&sysroot).join("lib/rustlib").join(target).join("lib").is_dir() {
            eprintln!("skipped: {target} is not installed; `rustup target add {target}` adds it");
            continue;
        }
        eprintln!("$ cargo clippy --target {target} {flags}");
        // Flags would build everything anew.
        let folder = if flags.is_empty() { "target" } else { "target/simd128" };
        let line = "clippy -p rayburst-simd -p rayburst-accel --all-targets --target";
        let status = Command::new("cargo")
            .args(line.split(' '))
            .args([*target, "--target-dir", folder])
            .args(["--", "-D", "warnings"])
            .env("RUSTFLAGS", flags)
            .status()
            .map_err(|e| format!("cannot run cargo: {e}"))?;
        if !status.success() {
            return Err(format!("clippy for {target} failed ({status})"));
        }
    }
    Ok(())
}
