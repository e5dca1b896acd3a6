//! Proof tools: what the tests of `rayburst-accel` show on thousands of rays, shown on billions.
//!
//! - [`leaks`]: rays from inside closed meshes, none of which may leave, under every builder,
//!   instruction set, mode and query.
//! - [`fuzz`]: any bytes as a soup of triangles and rays; all ways to trace them must agree with
//!   brute force, bit for bit.
//!
//! `cargo xtask verify`, `fuzz`, `asm-check` and `instructions` are the commands.
#![forbid(unsafe_code)]

pub mod builds;
#[cfg(feature = "files")]
pub mod files;
pub mod fuzz;
pub mod leaks;
pub mod meshes;
pub mod rays;
