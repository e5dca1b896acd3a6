//! Integration tests: files in, scenes out.
#![allow(clippy::print_stderr)]

mod glb;
mod gltf;
mod gltf_broken;
mod gltf_values;
mod hostile_meshes;
mod moving;
mod obj;
mod ply;
mod polygon_lamps;
mod polygon_lights;
mod real_meshes;
mod view;
