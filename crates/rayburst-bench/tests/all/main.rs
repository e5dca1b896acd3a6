//! Tests of the structures against the brute-force oracle, and of the benchmarks.
#![expect(clippy::print_stdout, reason = "a skipped test says so")]

mod embree;
mod oracle;
mod real_scenes;
