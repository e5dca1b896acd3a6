//! Conformance tests of the pipeline, in modules named after sections of Microsoft's DirectX Raytracing
//! (DXR) functional specification, against a model that tries every primitive in `f64`.

#![allow(unreachable_pub)] // one binary: nothing is reachable from outside

mod harness;
mod model;
mod scenes;
mod solids;

mod any_hit;
mod callable;
mod dispatch_rays;
mod geometry_flags;
mod instance_flags;
mod instance_masking;
mod intersection;
mod ray_extents;
mod ray_flags;
mod recursion;
mod shader_table_indexing;
mod trace_ray;
mod winding_and_culling;
