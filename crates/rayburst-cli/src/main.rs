//! The rayburst command line.
//!
//! stdout carries results, stderr everything else. Exit codes: 0 it worked, 1 it failed, 2 the
//! command line was wrong.
#![forbid(unsafe_code)]

mod args;
mod bench;
mod camera;
mod compare;
mod completions;
mod develop;
mod error;
mod figure;
mod info;
mod inspect;
mod interrupt;
mod light;
mod load;
mod machine;
mod memory;
mod method;
mod movie;
mod names;
mod output;
mod progress;
mod render;
mod scenes;
mod terminal;

use std::process::ExitCode;

use clap::{Parser as _, error::ErrorKind};

use args::{Cli, Verb};

/// Exit code of a wrong command line.
const WRONG_USAGE: u8 = 2;

fn main() -> ExitCode {
    report_panics();
    // The hook has told what happened; what is left is the exit code of a failure.
    std::panic::catch_unwind(run).unwrap_or(ExitCode::FAILURE)
}

fn run() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return explain(&error),
    };
    log();
    let done = match &cli.verb {
        Verb::Render(args) => render::run(args),
        Verb::Info(args) => info::run(args),
        Verb::Scenes(args) => scenes::run(args),
        Verb::Compare(args) => compare::run(args),
        Verb::Inspect(args) => inspect::run(args),
        Verb::Bench(args) => bench::run(args),
        Verb::Figure(args) => figure::run(args),
        Verb::Completions(args) => completions::run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if let Some(line) = error.line() {
                terminal::say(line);
            }
            ExitCode::from(error.exit_code())
        }
    }
}

/// Help, the version, or what is wrong with the command line.
fn explain(error: &clap::Error) -> ExitCode {
    // Nobody may be listening any more; that is no failure of ours.
    let _ = error.print();
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => ExitCode::SUCCESS,
        _ => ExitCode::from(WRONG_USAGE),
    }
}

/// Logs of the libraries on stderr, as `RAYBURST_LOG` asks; warnings only unless told otherwise.
fn log() {
    let filter = tracing_subscriber::EnvFilter::try_from_env("RAYBURST_LOG")
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_target(false)
        .without_time()
        .init();
}

/// A bug ends in one line too.
fn report_panics() {
    std::panic::set_hook(Box::new(|info| {
        let message = info.payload_as_str().unwrap_or("no message");
        let place = info.location().map_or(String::new(), |l| format!(" at {l}"));
        terminal::say(format!("error: this is a bug in rayburst: {message}{place}"));
    }));
}
