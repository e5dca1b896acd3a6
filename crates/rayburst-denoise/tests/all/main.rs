//! Tests of the denoisers from outside.

mod firefly;
mod occlusion;
mod shadow;
mod views;
