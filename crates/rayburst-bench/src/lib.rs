//! Measurements: identical rays through Rayburst and its peers, in one process, interleaved.
//!
//! Peers are loaded at run time; nothing here is linked against them. The only `unsafe` is in
//! [`peers`], at the foreign interface.

pub mod engine;
pub mod geometry;
pub mod peers;
pub mod ray_sets;
pub mod rays;
pub mod row;

pub use engine::{Engine, Query};
pub use geometry::FlatMesh;
pub use ray_sets::{RaySet, RaySetKind};
pub use rays::{BenchError, RayBench, bench_rays};
pub use row::Row;
