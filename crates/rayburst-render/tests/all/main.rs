//! Whole pictures against closed forms, against the reference, and against themselves.
#![allow(clippy::print_stderr)]

mod analytic;
mod convergence;
mod determinism;
mod frames;
mod furnace;
mod inspection;
mod raster;
mod reference;
mod scenes;
mod screen_space;
mod techniques;
mod texture_lod;
mod visibility;
mod whitted;
