//! Whole pictures against closed forms, against the reference, and against themselves.

mod analytic;
mod convergence;
mod determinism;
mod furnace;
mod inspection;
mod raster;
mod reference;
mod scenes;
mod techniques;
mod visibility;
mod whitted;
