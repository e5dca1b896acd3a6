//! House keeping of the workspace: `cargo xtask ci` runs what a change must pass, `cargo xtask tidy`
//! checks the house rules, `cargo xtask performance` makes the tables of `docs/performance.md`.
#![forbid(unsafe_code)]

mod ci;
mod performance;
mod tidy;

use std::process::ExitCode;

const USAGE: &str = "usage: cargo xtask COMMAND

  ci      formatting, lints, documentation, house rules, all tests
  tidy    the house rules alone
  performance FILE.json…
          the tables of docs/performance.md from the rows of `rayburst bench … --json`";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["ci"] => ci::run(),
        ["tidy"] => tidy::run(),
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
