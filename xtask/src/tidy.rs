//! `cargo xtask tidy`: rules of the house that the compiler does not know.
//!
//! Crates may use only the crates below them; unfinished code, machine paths and very long files
//! stay out; crates without kernels or foreign interfaces forbid `unsafe`; every crate has its place
//! in `ARCHITECTURE.md`.

use std::{fs, path::Path, process::Command};

/// What each crate may use of the workspace, from the bottom up. Dev-dependencies are free.
const ALLOWED: &[(&str, &[&str])] = &[
    ("rayburst-math", &[]),
    ("rayburst-simd", &["rayburst-math"]),
    ("rayburst-accel", &["rayburst-math", "rayburst-simd"]),
    ("rayburst-pipeline", &["rayburst-math", "rayburst-accel"]),
    ("rayburst-procedural", &["rayburst-math"]),
    ("rayburst-image", &["rayburst-math"]),
    ("rayburst-scene", &["rayburst-math", "rayburst-accel", "rayburst-image"]),
    ("rayburst-raster", &["rayburst-math", "rayburst-simd", "rayburst-image"]),
    ("rayburst-denoise", &["rayburst-math", "rayburst-simd", "rayburst-image"]),
    (
        "rayburst-render",
        &[
            "rayburst-math",
            "rayburst-simd",
            "rayburst-accel",
            "rayburst-image",
            "rayburst-raster",
            "rayburst-denoise",
            "rayburst-scene",
        ],
    ),
    (
        "rayburst",
        &[
            "rayburst-math",
            "rayburst-accel",
            "rayburst-pipeline",
            "rayburst-procedural",
            "rayburst-image",
            "rayburst-denoise",
            "rayburst-scene",
            "rayburst-render",
        ],
    ),
    (
        "rayburst-bench",
        &[
            "rayburst-math",
            "rayburst-accel",
            "rayburst-pipeline",
            "rayburst-scene",
            "rayburst-render",
        ],
    ),
    ("rayburst-cli", &["rayburst", "rayburst-bench"]),
    ("rayburst-testkit", &["rayburst-math"]),
    ("rayburst-verify", &["rayburst-math", "rayburst-simd", "rayburst-accel", "rayburst-scene"]),
    ("xtask", &[]),
];

/// Crates that may hold `unsafe`: kernels, and the foreign interface of the peers.
const UNSAFE_CRATES: &[&str] = &["rayburst-simd", "rayburst-accel", "rayburst-bench"];

/// Above this a file must be split.
const MAX_LINES: usize = 800;

/// Words that mark unfinished code, spelled in halves so that this file passes.
const UNFINISHED: &[&str] =
    &[concat!("TO", "DO"), concat!("FIX", "ME"), concat!("XX", "X"), concat!("#[ig", "nore")];

/// Checks everything and reports all that is wrong at once.
pub(crate) fn run() -> Result<(), String> {
    let mut problems = Vec::new();
    check_dependencies(&mut problems)?;
    for file in tracked_files()? {
        check_file(&file, &mut problems);
    }
    if problems.is_empty() {
        eprintln!("tidy: ok");
        return Ok(());
    }
    Err(format!("tidy found {} problems:\n  {}", problems.len(), problems.join("\n  ")))
}

fn output(program: &str, arguments: &[&str]) -> Result<String, String> {
    let output = Command::new(program)
        .args(arguments)
        .output()
        .map_err(|e| format!("cannot run {program}: {e}"))?;
    if !output.status.success() {
        return Err(format!("{program} failed: {}", String::from_utf8_lossy(&output.stderr)));
    }
    String::from_utf8(output.stdout).map_err(|e| format!("{program}: {e}"))
}

fn check_dependencies(problems: &mut Vec<String>) -> Result<(), String> {
    let metadata = output("cargo", &["metadata", "--no-deps", "--format-version", "1"])?;
    let metadata: serde_json::Value =
        serde_json::from_str(&metadata).map_err(|e| format!("cargo metadata: {e}"))?;
    let architecture = fs::read_to_string("ARCHITECTURE.md").unwrap_or_default();
    let list = |value: &serde_json::Value| value.as_array().cloned().unwrap_or_default();
    for package in list(&metadata["packages"]) {
        let name = package["name"].as_str().unwrap_or_default();
        let Some((_, allowed)) = ALLOWED.iter().find(|(known, _)| *known == name) else {
            problems.push(format!("{name}: a crate without a place; add it to xtask's table"));
            continue;
        };
        if !architecture.contains(&format!("`{name}`")) {
            problems.push(format!("ARCHITECTURE.md does not name `{name}`"));
        }
        for dependency in list(&package["dependencies"]) {
            let used = dependency["name"].as_str().unwrap_or_default();
            let ours = ALLOWED.iter().any(|(known, _)| *known == used);
            if ours && dependency["kind"].is_null() && !allowed.contains(&used) {
                problems.push(format!("{name} must not depend on {used}"));
            }
        }
    }
    Ok(())
}

fn tracked_files() -> Result<Vec<String>, String> {
    let files = output("git", &["ls-files", "--cached", "--others", "--exclude-standard"])?;
    Ok(files.lines().filter(|f| Path::new(f).is_file()).map(str::to_owned).collect())
}

fn check_file(file: &str, problems: &mut Vec<String>) {
    let text_file = [".rs", ".md", ".toml", ".py", ".wgsl", ".json"];
    if !text_file.iter().any(|end| file.ends_with(end)) {
        return;
    }
    let Ok(text) = fs::read_to_string(file) else {
        problems.push(format!("{file}: not UTF-8"));
        return;
    };
    for (number, line) in text.lines().enumerate() {
        let at = format!("{file}:{}", number + 1);
        if file.ends_with(".rs") {
            for word in UNFINISHED.iter().filter(|w| line.contains(**w)) {
                problems.push(format!("{at}: unfinished ({word})"));
            }
        }
        for path in [concat!("/wo", "rk/"), concat!("/tmp/bash", "_jobs")] {
            if line.contains(path) {
                problems.push(format!("{at}: a path of one machine"));
            }
        }
    }
    if !file.ends_with(".rs") {
        return;
    }
    let lines = text.lines().count();
    if lines > MAX_LINES {
        problems.push(format!("{file}: {lines} lines; split it (at most {MAX_LINES})"));
    }
    let crate_root = file.ends_with("/src/lib.rs") || file.ends_with("/src/main.rs");
    let may_be_unsafe = UNSAFE_CRATES.iter().any(|c| file.starts_with(&format!("crates/{c}/")));
    if crate_root && !may_be_unsafe && !text.contains("#![forbid(unsafe_code)]") {
        problems.push(format!("{file}: lacks #![forbid(unsafe_code)]"));
    }
}
