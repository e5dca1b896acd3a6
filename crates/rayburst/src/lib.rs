//! Rayburst: real-time ray tracing on any CPU.
//!
//! This crate is the front door: it re-exports the engine's crates as modules, and what most programs
//! need in [`prelude`].
//!
//! One ray at a triangle:
//! ```
//! use rayburst::prelude::*;
//!
//! let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
//! let mesh = TriangleMesh::new(&corners, &[[0, 1, 2]]);
//! let blas = Blas::build(&[mesh], &BuildOptions::default())?;
//! let ray = Ray::new(Vec3::new(0.25, 0.25, 1.0), -Vec3::Z);
//! let hit = blas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
//! assert_eq!((hit.t, hit.u, hit.v), (1.0, 0.25, 0.25));
//! # Ok::<(), rayburst::accel::BuildError>(())
//! ```
//!
//! A million rays in one batch:
//! ```
//! use rayburst::prelude::*;
//!
//! let cornell = rayburst::scene::builtin::build("cornell")?;
//! let scene = rayburst::flatten(&cornell)?;
//! let camera = rayburst::default_camera(&cornell, &scene);
//! let rays: Vec<Ray> = (0..1_000_000)
//!     .map(|i| Vec2::new((i % 1000) as f32 + 0.5, (i / 1000) as f32 + 0.5))
//!     .map(|pixel| camera.ray(pixel, (1000, 1000), Vec2::ZERO).0)
//!     .collect();
//! let mut hits = vec![Hit::MISS; rays.len()];
//! scene.tlas.closest_hits(&rays, &mut hits, &TraceOptions::default(), &AcceptAll);
//! assert!(hits.iter().filter(|hit| hit.is_hit()).count() > 500_000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A glTF file to a PNG picture:
//! ```no_run
//! use rayburst::prelude::*;
//!
//! let scene = rayburst::load("helmet.glb")?;
//! let settings = RenderSettings { size: (1280, 720), spp: 64, ..RenderSettings::default() };
//! let picture = rayburst::picture(&scene, settings)?;
//! rayburst::save_png(&picture, "helmet.png")?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Your own `shade`: a mirror ball under a sky, rays up to 4 deep:
//! ```
//! use rayburst::prelude::*;
//!
//! let ball = rayburst::scene::builtin::build("furnace")?;
//! let scene = rayburst::flatten(&ball)?;
//! let camera = rayburst::default_camera(&ball, &scene);
//! let picture = ray_trace_image(&scene, &camera, (64, 48), 4, |tracer, ray, surface| {
//!     let Some(surface) = surface else { return Vec3::splat(0.5 + 0.5 * ray.direction.y) };
//!     let reflected = ray.direction.reflect(surface.shading_normal);
//!     0.8 * tracer.trace(&Ray::new(surface.spawn(reflected), reflected))
//! });
//! assert!(picture.get(32, 24).max_element() < 0.8);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod shortcuts;

pub use rayburst_accel as accel;
pub use rayburst_image as image;
pub use rayburst_math as math;
pub use rayburst_pipeline as pipeline;
pub use rayburst_procedural as procedural;
pub use rayburst_render as render;
pub use rayburst_scene as scene;

pub use glam;

pub use shortcuts::{Error, default_camera, flatten, load, picture, save_png};

/// What most programs need.
pub mod prelude {
    pub use glam::{Affine3A, Quat, Vec2, Vec3, Vec4};
    pub use rayburst_accel::{
        AcceptAll, Blas, BuildControl, BuildOptions, BuildQuality, Builder, CandidateFilter, Cull,
        Curve, FilterFn, Instance, ProceduralBoxes, RayFlags, Tlas, TraceOptions, TriangleMesh,
    };
    pub use rayburst_image::{FilterKind, LayeredImage, RgbImage, ToneMap};
    pub use rayburst_math::{Aabb, Hit, HitKind, Ray, SamplerKind};
    pub use rayburst_pipeline::{
        AnyHitResult, Barycentrics, HitGroup, Pipeline, RwBuffer, RwTexture, ShaderTable,
    };
    pub use rayburst_procedural::Shape;
    pub use rayburst_render::{
        Aov, IntegratorKind, Limits, Progress, RenderSettings, Renderer, Tracer, ray_trace_image,
    };
    pub use rayburst_scene::{
        Camera, Environment, FlatScene, Flattener, Light, LightKind, Material, Pose, Primitive,
        Projection, Scene, Surface,
    };
}
