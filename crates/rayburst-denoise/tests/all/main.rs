//! Tests of the denoisers from outside.

mod firefly;
mod frames;
mod occlusion;
mod reflection;
mod reprojection;
mod shadow;
mod taa;
mod temporal;
mod upscale;
mod variance;
mod views;
