//! Conformance tests of the pipeline, in modules named after sections of Microsoft's DirectX Raytracing
//! (DXR) functional specification, against a model that tries every primitive in `f64`.

#![allow(unreachable_pub)] // one binary: nothing is reachable from outside

mod harness;
mod model;
mod scenes;
mod solids;

mod ray_flags;
