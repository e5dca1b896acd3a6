//! Acceleration structures: which triangles does a ray meet?
//!
//! A [`Blas`] holds the triangles of many geometries; a [`Tlas`] holds instances of BLASes under 3×4
//! transforms. Both answer *closest hit*, *any hit*, *all hits* and *nearest hits* (the first few of
//! all), for one ray or for a batch: batches are the normal case, plain slices without an allocation
//! per ray, run on the calling thread. This crate knows no material: alpha comes in as a [`CandidateFilter`].
//! What moves is refitted ([`Blas::refit`], [`Blas::refit_procedural`], [`Tlas::update`]) or built anew;
//! [`MovingBlas`] chooses.
//! Beside triangles there may be procedural primitives, boxes of which only the caller knows what is in
//! them: `procedural_candidates` tells which a ray meets, and a [`RayQuery`] stops at both.
//!
//! What holds for every structure, instruction set and mode:
//! - Hits have `t_min ≤ t ≤ t_max`; `t` is in units of the ray's direction, through instances too.
//!   Invalid rays ([`rayburst_math::Ray::is_valid`]) are misses.
//! - The triangle test is watertight and the box test conservative: no ray leaves a closed mesh
//!   through an edge or a vertex.
//! - Of hits at equal `t` the smallest `(instance, geometry, primitive)` wins.
//! - `any_hit` is `closest_hit(..).is_hit()`, and a batch gives the bits of its rays one by one.
//! - Triangles with a coordinate that is not finite or beyond [`MAX_COORDINATE`], and triangles of
//!   zero area, are never hit; rays whose origin is farther than 2⁹⁰ on some axis are misses.

mod blas;
mod build;
mod control;
mod error;
mod geometry;
mod layout;
mod lists;
mod options;
mod procedural;
mod query;
mod ray_flags;
mod ray_query;
mod refit;
mod structure;
mod tlas;
mod traverse;
mod update;
mod validate;

pub use blas::Blas;
pub use control::BuildControl;
pub use error::BuildError;
pub use geometry::{
    Geometry, GeometryInfo, GeometryKind, Instance, InstanceFlags, MAX_COORDINATE, ProceduralBoxes,
    TriangleMesh,
};
pub use options::{BuildOptions, BuildQuality, BuildStats, Builder, Curve, Layout};
pub use procedural::ProceduralCandidate;
pub use query::{
    AcceptAll, AllHits, CandidateFilter, Counters, Cull, FilterFn, Skip, TraceMode, TraceOptions,
};
pub use ray_flags::RayFlags;
pub use ray_query::{CandidateType, CommittedStatus, RayQuery};
pub use rayburst_simd::IsaLevel;
pub use refit::RefitReport;
pub use tlas::Tlas;
pub use update::{MovingBlas, RebuildReason, UpdateAction, UpdatePolicy, UpdateReport};
pub use validate::{BvhDefect, ValidationReport};
