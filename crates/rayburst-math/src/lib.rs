//! Mathematics of ray tracing: rays and hits, boxes, frames, sampling and samplers.
//!
//! Everything here is plain data and pure functions over `f32`; vectors are [`glam`] types.
//! World space is right-handed with +Y up and metres as units (glTF's conventions).
#![forbid(unsafe_code)]

pub mod aabb;
pub mod cone;
pub mod curvature;
pub mod differential;
pub mod distribution;
pub mod frame;
pub mod hash;
pub mod lanes;
pub mod offset;
pub mod ray;
pub mod sampler;
pub mod warp;

pub use aabb::Aabb;
pub use cone::RayCone;
pub use differential::RayDifferential;
pub use frame::Frame;
pub use glam;
pub use ray::{Hit, HitKind, Ray};
pub use sampler::{Sampler, SamplerKind};
