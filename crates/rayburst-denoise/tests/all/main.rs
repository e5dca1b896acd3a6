//! Tests of the denoisers from outside.

mod firefly;
mod frames;
mod occlusion;
mod reprojection;
mod shadow;
mod temporal;
mod variance;
mod views;
