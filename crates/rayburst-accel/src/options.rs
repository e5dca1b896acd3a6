//! How to build, and what came out.

use rayburst_simd::{IsaError, IsaLevel};

/// The trade of build time against trace time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum BuildQuality {
    /// The fastest build: triangles in the order of a Morton curve.
    Fast,
    /// Binned surface area heuristic.
    #[default]
    Balanced,
}

/// Options of a build.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildOptions {
    /// The trade of build time against trace time.
    pub quality: BuildQuality,
    /// The instruction set of this structure's kernels; `None` is what `RAYBURST_ISA` names, or the
    /// best one.
    pub isa: Option<IsaLevel>,
}

impl BuildOptions {
    /// The instruction set asked for.
    pub(crate) fn resolve_isa(&self) -> Result<IsaLevel, IsaError> {
        self.isa.map_or_else(IsaLevel::from_environment, Ok)
    }
}

/// What a build made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildStats {
    /// Triangles of a BLAS or instances of a TLAS that rays can hit.
    pub primitives: usize,
    /// Triangles and instances that are never hit: not finite, too large, zero area, no inverse.
    pub inactive: usize,
    /// Inner nodes.
    pub nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Inner nodes on the longest path from the root.
    pub depth: usize,
    /// Expected cost of a random ray by the surface area heuristic, in node visits: one for a node,
    /// one for a block of four triangles.
    pub sah_cost: f32,
    /// Memory of the structure; a TLAS does not count its BLASes.
    pub bytes: usize,
    /// Time of the build.
    pub seconds: f64,
}
