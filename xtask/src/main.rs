//! House keeping of the workspace: `cargo xtask ci` runs what a change must pass, `cargo xtask tidy`
//! checks the house rules, `cargo xtask performance` makes the tables of `docs/performance.md`; the
//! others are proof tools, described in `CONTRIBUTING.md`.
#![forbid(unsafe_code)]

mod asm_check;
mod book;
mod ci;
mod ltc;
mod performance;
mod portable;
mod proofs;
mod tidy;

use std::process::ExitCode;

const USAGE: &str = "usage: cargo xtask COMMAND

  ci      formatting, lints, documentation, house rules, all tests
  tidy    the house rules alone
  book    links, code and pictures of the tutorial; builds it where mdbook is installed
  tutorial
          runs the tutorial's programs, which make the pictures of the book anew
  ltc [--check]
          fits the lobes of polygon lights to GGX and writes their table, or compares it with the fit
  performance FILE.json…
          the tables of docs/performance.md from the rows of `rayburst bench … --json`
  portable
          lints of the kernels for other targets, those that rustup has installed
  verify [--rays N] [--resume] [--threads N] [--mesh FILE] …
          rays from inside closed meshes in every build, instruction set, mode and query
  fuzz [--minutes N] [--seed N] …
          random soups and rays, traced in every way, against brute force
  asm-check
          no call and no panic in the inner loops of the kernels
  instructions
          instructions per ray in every mode, counted by valgrind
  miri    small scenes under Miri, in plain Rust";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["ci"] => ci::run(),
        ["tidy"] => tidy::run(),
        ["book"] => book::run(),
        ["tutorial"] => book::tutorial(),
        ["ltc", ref arguments @ ..] => ltc::run(arguments),
        ["portable"] => portable::run(),
        ["verify", ref arguments @ ..] => proofs::verify(arguments),
        ["fuzz", ref arguments @ ..] => proofs::fuzz(arguments),
        ["asm-check"] => asm_check::run(),
        ["instructions"] => proofs::instructions(),
        ["miri"] => proofs::miri(),
        ["performance", ref files @ ..] if !files.is_empty() => performance::run(files),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("error: {problem}");
            ExitCode::FAILURE
        }
    }
}
