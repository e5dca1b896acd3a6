//! One measured figure.

use serde::Serialize;

/// A row of a benchmark's JSON array; fields that a benchmark does not have are left out.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    /// Which benchmark: `rays`.
    pub bench: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// Triangles in the scene.
    pub triangles: usize,
    /// Which rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ray_set: Option<&'static str>,
    /// What was measured: `rayburst:PRESET:MODE`, `embree:QUALITY:WIDTH`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub engine: Option<String>,
    /// Threads that traced.
    pub threads: usize,
    /// Median of the repeats.
    pub value: f64,
    /// Unit of `value`, `min` and `max`.
    pub unit: &'static str,
    /// `value` over that of the best peer in the same run; absent for peers and without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ratio: Option<f64>,
    /// Number of timed runs.
    pub repeats: usize,
    /// Slowest run.
    pub min: f64,
    /// Fastest run.
    pub max: f64,
    /// Rays in the set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rays: Option<usize>,
    /// Rays that hit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hits: Option<usize>,
}
