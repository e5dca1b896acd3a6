//! Tests of the denoisers from outside.

mod adaptive;
mod average;
mod frames;
mod reprojection;
mod robust;
mod svgf;
mod temporal;
mod variance;
mod wavelet;
