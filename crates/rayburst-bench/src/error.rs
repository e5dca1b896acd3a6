//! Why nothing was measured.

use std::path::PathBuf;

use rayburst_accel::BuildError;
use rayburst_pipeline::{DispatchError, PipelineError};
use rayburst_render::RenderError;

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// A peer's library cannot be used.
    #[error("cannot use the peer library {path}: {reason}")]
    Peer {
        /// The library.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A peer is to be measured, but its library is not named.
    #[error("{engine} needs Embree's library; name it with --peer embree=LIBRARY")]
    NoLibrary {
        /// The engine that needs it.
        engine: String,
    },
    /// The structure cannot be built.
    #[error("cannot build the acceleration structure: {0}")]
    Build(#[from] BuildError),
    /// A shader table does not fit the scene.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// Shaders failed.
    #[error(transparent)]
    Dispatch(#[from] DispatchError),
    /// Frames cannot be rendered as asked.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Forms of one computation disagree, so their speeds cannot be compared.
    #[error("{first} and {second} disagree on {differing} pixels")]
    PicturesDiffer {
        /// A form.
        first: String,
        /// The form that differs from it.
        second: String,
        /// In so many pixels.
        differing: usize,
    },
    /// There are no worker threads.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system says.
        reason: String,
    },
    /// Engines disagree, so their speeds cannot be compared.
    #[error("{scene}, {ray_set}: {engine} hits {hits} rays where {reference} hits {expected}")]
    Disagreement {
        /// Scene.
        scene: String,
        /// Ray set.
        ray_set: &'static str,
        /// The engine that differs.
        engine: String,
        /// Its number of hits.
        hits: usize,
        /// The engine it is compared with.
        reference: String,
        /// That one's number of hits.
        expected: usize,
    },
}

/// A pool of worker threads for one measurement.
pub(crate) fn pool(threads: usize) -> Result<rayon::ThreadPool, BenchError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| BenchError::Threads { threads, reason: e.to_string() })
}
