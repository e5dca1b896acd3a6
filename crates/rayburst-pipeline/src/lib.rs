//! DXR's programming model without ray tracing hardware: shaders, hit groups, shader tables.
//!
//! A [`ShaderTable`] is filled with shaders, which are closures or methods of types, and becomes a [`Pipeline`], which is run
//! over a structure of `rayburst-accel` by [`Pipeline::dispatch_rays`]. Names and rules are those of
//! Microsoft's DirectX Raytracing (DXR) functional specification; what it forbids has no method in
//! the shader type's context and does not compile, or is an error when the pipeline is built or first meets
//! the structure.
//!
//! | DXR | here |
//! |---|---|
//! | `TraceRay(…)` | `trace_ray` of [`RayGeneration`], [`ClosestHit`], [`Miss`] |
//! | `CallShader(…)` | `call_shader` of those and [`Callable`] |
//! | `ReportHit(…)` | [`Intersection::report_hit`] |
//! | `IgnoreHit()`, `AcceptHitAndEndSearch()` | [`AnyHitResult`], the value of the any hit shader |
//! | `DispatchRays(…)` | [`Pipeline::dispatch_rays`] |
//! | local root arguments | typed record data, or what a closure captures |
//! | global root arguments | what closures capture |
//! | unordered access views | [`RwBuffer`], [`RwTexture`] |
//!
//! ```
//! use std::sync::Arc;
//!
//! use glam::{Affine3A, UVec2, Vec3};
//! use rayburst_accel::{Blas, BuildOptions, Instance, RayFlags, Tlas, TriangleMesh};
//! use rayburst_math::Ray;
//! use rayburst_pipeline::{HitGroup, RwTexture, ShaderTable};
//!
//! let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
//! let blas = Blas::build(&[TriangleMesh::new(&corners, &[[0, 1, 2]])], &BuildOptions::default())?;
//! let instances = [Instance::new(0, Affine3A::IDENTITY)];
//! let tlas = Tlas::build(vec![Arc::new(blas)], &instances, &BuildOptions::default())?;
//!
//! let picture = RwTexture::<Vec3>::new(4, 4);
//! let mut table = ShaderTable::new();
//! let camera_ray = table.ray_type::<Vec3>("camera", 0, 1, 0);
//! table.miss("sky", |_, color: &mut Vec3| *color = Vec3::Z);
//! table.hit(
//!     &HitGroup::triangles("triangle").closest_hit(|hit, color: &mut Vec3| {
//!         *color = Vec3::new(hit.attributes().u, hit.attributes().v, 0.0);
//!     }),
//!     (),
//! );
//! let generate = table.ray_generation(|launch| {
//!     let at = launch.launch_index().truncate();
//!     let origin = (at.as_vec2() + 0.5).extend(4.0) / 4.0;
//!     let mut color = Vec3::ZERO;
//!     launch.trace_ray(camera_ray, RayFlags::empty(), 0xFF, &Ray::new(origin, -Vec3::Z), &mut color);
//!     picture.store(at, color);
//! });
//! table.build(1)?.dispatch_rays(&tlas, generate, 4, 4, 1)?;
//! assert_eq!(picture.load(UVec2::new(1, 0)), Vec3::new(0.375, 0.125, 0.0));
//! assert_eq!(picture.load(UVec2::new(3, 3)), Vec3::Z);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What shaders capture must be declared before the [`ShaderTable`], as `picture` is above: the table and its
//! [`Pipeline`] borrow it until they are dropped, and variables are dropped in reverse order. What is read
//! afterwards needs no more than that the pipeline is gone or no longer used.
//!
//! # What callable shaders can do
//!
//! - *Return any data?* Yes: parameters are one value of any type, changed in place.
//! - *Several at once?* A launch runs one after another; different launches run theirs at the same time.
//! - *How are parameters passed?* By reference: nothing is copied, and the size costs nothing.
//! - *Shared memory?* There is none; [`RwBuffer`] is shared by all launches of a dispatch.
//! - *Fire and forget?* No: a call returns when the shader has, so what it did can be relied upon. Work for
//!   later goes into a buffer and another dispatch.
//! - *Recursion?* Yes, 31 deep.
#![forbid(unsafe_code)]

mod call;
mod context;
mod error;
mod hit_group;
mod identity;
mod pipeline;
mod portable;
mod procedural;
mod shaders;
mod storage;
mod table;
mod trace;

pub use context::{AnyHit, Callable, ClosestHit, Intersection, Miss, RayGeneration};
pub use error::{DispatchError, PipelineError};
pub use hit_group::{AnyHitResult, Barycentrics, HitGroup, MAX_ATTRIBUTE_BYTES};
pub use pipeline::{MAX_LAUNCHES, MAX_RECURSION_DEPTH, Pipeline};
pub use portable::{
    MAX_PORTABLE_REPORTS, Next, PortableCandidate, PortableHit, PortableHitGroup, PortablePipeline,
    PortableRay, PortableRayType, PortableReport, PortableReports, PortableTable, TraceRequest,
};
pub use shaders::{ProceduralShaders, TriangleShaders};
pub use storage::{RwBuffer, RwTexture};
pub use table::{CallableId, RayGenerationId, RayType, ShaderTable};
