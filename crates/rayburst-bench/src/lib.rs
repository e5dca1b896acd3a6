//! Measurements: identical rays through Rayburst and its peers, in one process, interleaved; frames in real
//! time, pass by pass.
//!
//! Peers are loaded at run time; only with the feature `peers` are other crates linked. The only
//! `unsafe` is in [`peers`], at the foreign interface.

pub mod builds;
pub mod engine;
pub mod error;
pub mod frames;
pub mod geometry;
pub mod machine;
pub mod peers;
pub mod pipelines;
pub mod ray_sets;
pub mod rays;
pub mod row;
pub mod spec;
mod standing;
pub mod updates;

pub use builds::{BuildBench, bench_builds};
pub use engine::{Engine, Mode, Preset, Query};
pub use error::BenchError;
pub use frames::{FrameBench, bench_frames};
pub use geometry::FlatMesh;
pub use machine::Machine;
pub use pipelines::{PipelineBench, bench_pipelines};
pub use ray_sets::{RaySet, RaySetKind};
pub use rays::{RayBench, bench_rays};
pub use row::{Row, geometric_means};
pub use spec::EngineSpec;
pub use updates::{UpdateBench, UpdateCase, bench_updates};
