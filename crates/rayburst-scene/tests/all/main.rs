//! Integration tests: files in, scenes out.
#![allow(clippy::print_stderr)]

mod gltf;
