//! Tests of the pipeline.

mod portable;
