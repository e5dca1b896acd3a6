//! What the commands take and do.

mod fuzz;
mod leaks;
mod trace;

use std::path::PathBuf;

use clap::{Parser, Subcommand};

/// Proof tools of Rayburst.
#[derive(Parser)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Rays from inside closed meshes in every build, instruction set, mode and query; none may leave
    Leaks(leaks::Options),
    /// Random soups and rays, traced in every way; all must agree with brute force, bit for bit
    Fuzz(fuzz::Options),
    /// A small scene traced in one mode, for tools that count or read instructions
    Trace(trace::Options),
    /// Instructions per ray in every mode, counted by valgrind
    Instructions,
}

/// Does what the command says.
pub(crate) fn run(arguments: Arguments) -> Result<(), String> {
    match arguments.command {
        Command::Leaks(options) => leaks::run(&options),
        Command::Fuzz(options) => fuzz::run(&options),
        Command::Trace(options) => trace::run(&options),
        Command::Instructions => trace::instructions(),
    }
}

/// A folder, made if it is not there.
fn folder(path: &str) -> Result<PathBuf, String> {
    std::fs::create_dir_all(path).map_err(|e| format!("cannot make the folder {path}: {e}"))?;
    Ok(PathBuf::from(path))
}

/// A pool of so many threads; as many as the machine has if `None`.
fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, String> {
    let threads = threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| format!("cannot start {threads} threads: {e}"))
}
