//! The command line as scripts and people use it: every test runs the program.

#![allow(clippy::print_stderr)] // A skipped test says why.

mod broken;
mod frames;
mod interrupt;
mod output;
mod program;
mod render;
mod usage;
mod verbs;
