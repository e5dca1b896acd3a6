//! Tests of the denoisers from outside.

mod frames;
mod reprojection;
mod temporal;
mod variance;
