//! Tests of the denoisers from outside.

mod adaptive;
mod average;
mod firefly;
mod frames;
mod occlusion;
mod reflection;
mod reprojection;
mod robust;
mod shadow;
mod svgf;
mod taa;
mod temporal;
mod upscale;
mod variance;
mod views;
mod wavelet;
