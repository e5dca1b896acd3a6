//! The proof tools as commands; `cargo xtask` calls them with the right profile.

#![allow(clippy::print_stderr, clippy::print_stdout, reason = "a command line tells its progress")]
#![forbid(unsafe_code)]

mod commands;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    match commands::run(commands::Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("error: {problem}");
            ExitCode::FAILURE
        }
    }
}
