//! Tests of the structures against the brute-force oracle, and of the benchmarks.

mod oracle;
mod real_scenes;
