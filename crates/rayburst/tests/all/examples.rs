//! The tutorial's programs as modules.
#![allow(dead_code, reason = "their `main` is not called")]
#![allow(clippy::duplicate_mod, reason = "each brings what they share")]

#[path = "../../examples/hello_triangle.rs"]
pub(crate) mod hello_triangle;
#[path = "../../examples/path_tracer.rs"]
pub(crate) mod path_tracer;
#[path = "../../examples/whitted.rs"]
pub(crate) mod whitted;
