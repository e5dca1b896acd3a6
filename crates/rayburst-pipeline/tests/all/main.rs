//! Tests of the pipeline.

mod portable;
mod shaders;
