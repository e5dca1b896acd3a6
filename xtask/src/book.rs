//! `cargo xtask book`: the tutorial's links, included code and pictures are there, and mdBook builds it where
//! it is installed. `cargo xtask tutorial` makes the pictures anew.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

const BOOK: &str = "docs/book";
/// Pictures of the book are small.
const MAX_PICTURE: u64 = 60_000;

/// The tutorial's programs, and how wide their pictures are in the book.
const PROGRAMS: &[(&str, u32)] = &[
    ("hello_triangle", 480),
    ("business_card", 400),
    ("whitted", 320),
    ("path_tracer", 190),
    ("cutouts", 232),
    ("transparency", 288),
    ("procedural_gallery", 340),
    ("callables", 240),
    ("adaptive", 420),
    ("animated_instances", 300),
];

/// Checks the book, and builds it if mdBook is there.
pub(crate) fn run() -> Result<(), String> {
    let problems = check(Path::new(BOOK));
    if !problems.is_empty() {
        return Err(format!(
            "the book has {} problems:\n  {}",
            problems.len(),
            problems.join("\n  ")
        ));
    }
    let is_installed = Command::new("mdbook")
        .arg("--version")
        .output()
        .is_ok_and(|output| output.status.success());
    if !is_installed {
        eprintln!("book: ok; not built, since there is no mdbook");
        return Ok(());
    }
    let out = std::env::current_dir().unwrap_or_default().join("target/book");
    let built = Command::new("mdbook").args(["build", BOOK, "--dest-dir"]).arg(out).status();
    match built {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("mdbook failed ({status})")),
        Err(e) => Err(format!("mdbook: {e}")),
    }
}

/// Runs the programs, which write the book's pictures and print what they have measured.
pub(crate) fn tutorial() -> Result<(), String> {
    for (name, width) in PROGRAMS {
        let picture = format!("{BOOK}/src/pictures/{name}.png");
        eprintln!("{name}:");
        let status = Command::new("cargo")
            .args(["run", "--quiet", "--release", "-p", "rayburst", "--example", name, "--"])
            .args([&picture, &width.to_string()])
            .status()
            .map_err(|e| format!("cargo: {e}"))?;
        if !status.success() {
            return Err(format!("{name} failed ({status})"));
        }
    }
    run()
}

/// All that is wrong with a book.
fn check(book: &Path) -> Vec<String> {
    let source = book.join("src");
    let mut problems = Vec::new();
    if !book.join("book.toml").is_file() {
        problems.push(format!("{}: missing", book.join("book.toml").display()));
    }
    let summary = match fs::read_to_string(source.join("SUMMARY.md")) {
        Ok(text) => text,
        Err(e) => return vec![format!("SUMMARY.md: {e}")],
    };
    let chapters = between(&summary, "](", ")");
    for chapter in &chapters {
        match fs::read_to_string(source.join(chapter)) {
            Ok(text) => check_chapter(&source, chapter, &text, &mut problems),
            Err(e) => problems.push(format!("SUMMARY.md: {chapter}: {e}")),
        }
    }
    for entry in fs::read_dir(&source).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with(".md") && name != "SUMMARY.md" && !chapters.contains(&name.as_str()) {
            problems.push(format!("{name}: not in SUMMARY.md"));
        }
    }
    problems
}

fn check_chapter(source: &Path, chapter: &str, text: &str, problems: &mut Vec<String>) {
    for include in between(text, "{{#include ", "}}") {
        let (file, anchor) = match include.split_once(':') {
            Some((file, anchor)) => (file, Some(anchor)),
            None => (include, None),
        };
        let Ok(code) = fs::read_to_string(source.join(file)) else {
            problems.push(format!("{chapter}: cannot include {file}"));
            continue;
        };
        let has = |mark: &str| anchor.is_none_or(|a| marks(&code, mark).any(|name| name == a));
        if !(has("ANCHOR:") && has("ANCHOR_END:")) {
            problems
                .push(format!("{chapter}: {file} lacks a whole anchor {}", anchor.unwrap_or("")));
        }
    }
    // Links of text and of pictures look alike.
    for link in between(text, "](", ")") {
        if link.starts_with("http") {
            continue;
        }
        let path: PathBuf = source.join(link.split('#').next().unwrap_or_default());
        match fs::metadata(&path) {
            Err(_) => problems.push(format!("{chapter}: there is no {link}")),
            Ok(file) if link.ends_with(".png") && file.len() > MAX_PICTURE => {
                let (size, most) = (file.len(), MAX_PICTURE);
                problems.push(format!("{chapter}: {link} has {size} bytes; at most {most}"));
            }
            Ok(_) => {}
        }
    }
}

/// What stands between two marks, each time.
fn between<'t>(text: &'t str, begin: &str, end: &str) -> Vec<&'t str> {
    let pieces = text.split(begin).skip(1);
    pieces.filter_map(|piece| piece.split_once(end)).map(|(inside, _)| inside.trim()).collect()
}

/// The names after a mark in comments.
fn marks<'t>(code: &'t str, mark: &str) -> impl Iterator<Item = &'t str> {
    let lines = code.lines().map(|line| line.trim().trim_start_matches("//").trim());
    lines.filter_map(move |line| line.strip_prefix(mark)).map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes a book and gives its problems.
    fn problems_of(name: &str, summary: &str, chapter: &str, code: &str) -> Vec<String> {
        let book =
            std::env::temp_dir().join(format!("rayburst-book-{}-{name}", std::process::id()));
        fs::create_dir_all(book.join("src")).unwrap();
        for (file, text) in [
            ("book.toml", ""),
            ("src/SUMMARY.md", summary),
            ("src/one.md", chapter),
            ("src/code.rs", code),
            ("src/small.png", ""),
        ] {
            fs::write(book.join(file), text).unwrap();
        }
        let problems = check(&book);
        fs::remove_dir_all(book).unwrap();
        problems
    }

    #[test]
    fn whole_books_pass_and_each_gap_is_named() {
        let code = "// ANCHOR: a\nfn f() {}\n// ANCHOR_END: a\n    // ANCHOR: open\n";
        let summary = "# Summary\n- [One](one.md)\n";
        let good = "![p](small.png) [x](https://x.y) {{#include code.rs:a}} {{#include code.rs}}";
        assert_eq!(problems_of("good", summary, good, code), Vec::<String>::new());
        for (name, summary, chapter) in [
            ("absent", "[One](one.md) [Two](two.md)", good),
            ("unlisted", "", good),
            ("picture", summary, "![p](large.png)"),
            ("file", summary, "{{#include none.rs:a}}"),
            ("anchor", summary, "{{#include code.rs:b}}"),
            ("open", summary, "{{#include code.rs:open}}"),
        ] {
            assert_eq!(problems_of(name, summary, chapter, code).len(), 1, "{name}");
        }
    }
}
