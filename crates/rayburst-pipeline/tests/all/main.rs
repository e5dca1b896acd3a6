//! Conformance tests of the pipeline, in modules named after sections of Microsoft's DirectX Raytracing
//! (DXR) functional specification, against a model that tries every primitive in `f64`.

#![allow(unreachable_pub)] // one binary: nothing is reachable from outside

mod harness;
mod model;
mod scenes;
mod solids;

mod any_hit;
mod callable;
mod closest_hit;
mod compile_fail;
mod degenerate_primitives;
mod dispatch_rays;
mod geometry_flags;
mod inactive_primitives;
mod instance_flags;
mod instance_masking;
mod intersection;
mod miss;
mod payloads;
mod pipeline_errors;
mod portable;
mod portable_procedural;
mod ray_extents;
mod ray_flags;
mod ray_generation;
mod recursion;
mod shader_table_indexing;
mod shaders;
mod storage;
mod surface_values;
mod system_values;
mod trace_ray;
mod winding_and_culling;
