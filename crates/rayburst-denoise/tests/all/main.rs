//! Tests of the denoisers from outside.

mod firefly;
mod frames;
mod occlusion;
mod reprojection;
mod shadow;
mod taa;
mod temporal;
mod upscale;
mod variance;
mod views;
