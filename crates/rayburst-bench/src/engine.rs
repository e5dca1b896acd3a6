//! What is measured: anything that answers batches of rays.

use rayburst_accel::{AcceptAll, Blas, TraceOptions};
use rayburst_math::{Hit, Ray};

/// What is asked of the rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The nearest hit.
    Closest,
    /// Whether anything is hit.
    Any,
}

/// An engine with its structure built.
pub trait Engine: Sync {
    /// Name in the rows, such as `rayburst:balanced:auto` or `embree:medium:1`.
    fn name(&self) -> String;
    /// Whether the engine is one to be compared with.
    fn is_peer(&self) -> bool;
    /// Answers a batch on the calling thread; returns how many rays hit. The answers are stored in
    /// `hits` (`Closest`) or `occluded` (`Any`), as a renderer would.
    fn trace(&self, query: Query, rays: &[Ray], hits: &mut [Hit], occluded: &mut [bool]);
}

/// Rayburst's own structure.
#[derive(Debug)]
pub struct Rayburst {
    /// The structure.
    pub blas: Blas,
    /// Name of the build preset.
    pub preset: &'static str,
}

impl Engine for Rayburst {
    fn name(&self) -> String {
        format!("rayburst:{}:auto", self.preset)
    }

    fn is_peer(&self) -> bool {
        false
    }

    fn trace(&self, query: Query, rays: &[Ray], hits: &mut [Hit], occluded: &mut [bool]) {
        let options = TraceOptions::default();
        match query {
            Query::Closest => self.blas.closest_hits(rays, hits, &options, &AcceptAll),
            Query::Any => self.blas.any_hits(rays, occluded, &options, &AcceptAll),
        }
    }
}
