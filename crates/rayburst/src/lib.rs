//! Rayburst: real-time ray tracing on any CPU.
//!
//! This crate is the front door: it re-exports the engine's crates as modules, and what most programs
//! need in [`prelude`].
#![forbid(unsafe_code)]

pub use rayburst_accel as accel;
pub use rayburst_image as image;
pub use rayburst_math as math;
pub use rayburst_render as render;
pub use rayburst_scene as scene;

pub use glam;

/// What most programs need.
pub mod prelude {
    pub use glam::{Affine3A, Quat, Vec2, Vec3, Vec4};
    pub use rayburst_accel::{
        AcceptAll, Blas, BuildOptions, BuildQuality, CandidateFilter, Cull, FilterFn, Instance,
        Tlas, TraceOptions, TriangleMesh,
    };
    pub use rayburst_image::{FilterKind, LayeredImage, RgbImage, ToneMap};
    pub use rayburst_math::{Aabb, Hit, HitKind, Ray, SamplerKind};
    pub use rayburst_render::{
        Aov, IntegratorKind, Limits, Progress, RenderSettings, Renderer, Tracer, ray_trace_image,
    };
    pub use rayburst_scene::{
        Camera, Environment, FlatScene, Flattener, Light, LightKind, Material, Pose, Primitive,
        Projection, Scene, Surface,
    };
}
