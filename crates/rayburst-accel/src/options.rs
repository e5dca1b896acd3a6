//! How to build, and what came out.

use rayburst_simd::{IsaError, IsaLevel};

use crate::{BuildControl, BuildError, build::reinsertion::Effort};

/// The trade of build time against trace time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum BuildQuality {
    /// The fastest build: triangles in the order of a Morton curve.
    Fast,
    /// Binned surface area heuristic, and a little reinsertion.
    #[default]
    Balanced,
    /// Spatial splits: triangles may be in several leaves; and more reinsertion.
    Best,
}

/// How the tree over the triangles is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Builder {
    /// Top-down by the binned surface area heuristic.
    BinnedSah,
    /// The same with splits of the triangles themselves.
    SpatialSplits,
    /// Along a space-filling curve (LBVH), straight into wide nodes.
    Lbvh,
    /// Clusters along a space-filling curve, straight into wide nodes, the surface area heuristic
    /// above them (HLBVH).
    Hlbvh,
    /// Bottom-up along a space-filling curve: nearest neighbours merge (PLOC).
    Ploc,
}

/// The space-filling curve of builders that sort along one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Curve {
    /// Interleaved bits, most for the longest side of the scene.
    #[default]
    Morton,
    /// A curve without jumps, of ten bits an axis.
    Hilbert,
}

/// How the nodes and leaves of a BLAS are laid out in memory. Hits do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Layout {
    /// As they are tested: about 55 bytes a triangle.
    #[default]
    Wide,
    /// Quantised boxes, leaves without gaps: about 45 bytes a triangle, somewhat slower to trace. Made
    /// from the wide one, so the build needs memory for both, and cannot be refitted.
    Compressed,
}

/// Options of a build.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildOptions<'a> {
    /// The trade of build time against trace time.
    pub quality: BuildQuality,
    /// The builder of a BLAS; `None` is the quality's.
    pub builder: Option<Builder>,
    /// The curve of [`Builder::Lbvh`], [`Builder::Hlbvh`] and [`Builder::Ploc`].
    pub curve: Curve,
    /// The layout of a BLAS in memory; a TLAS is always wide.
    pub layout: Layout,
    /// How many references to triangles spatial splits may make, as a multiple of the triangles;
    /// `None` is 1.5, and there are never fewer than one a triangle.
    pub reference_budget: Option<f32>,
    /// How many passes of reinsertion improve a binary tree before it is made wide; `None` is the
    /// quality's. [`Builder::Lbvh`] and [`Builder::Hlbvh`] make no binary tree, so more than none is an
    /// error with them.
    pub reinsertion: Option<u32>,
    /// The instruction set of this structure's kernels; `None` is what `RAYBURST_ISA` names, or the
    /// best one.
    pub isa: Option<IsaLevel>,
    /// For watching and stopping the build from another thread.
    pub control: Option<&'a BuildControl>,
}

impl BuildOptions<'_> {
    /// The instruction set asked for.
    pub(crate) fn resolve_isa(&self) -> Result<IsaLevel, IsaError> {
        self.isa.map_or_else(IsaLevel::from_environment, Ok)
    }

    /// The builder asked for.
    pub(crate) fn resolve_builder(&self) -> Builder {
        self.builder.unwrap_or(match self.quality {
            BuildQuality::Fast => Builder::Hlbvh,
            BuildQuality::Balanced => Builder::BinnedSah,
            BuildQuality::Best => Builder::SpatialSplits,
        })
    }

    /// How much is spent on reinsertion after a builder.
    pub(crate) fn resolve_reinsertion(&self, builder: Builder) -> Result<Effort, BuildError> {
        let is_binary = !matches!(builder, Builder::Lbvh | Builder::Hlbvh);
        let effort = match self.quality {
            BuildQuality::Best => Effort { passes: 8, part: 0.05, least: 5e-4 },
            BuildQuality::Fast | BuildQuality::Balanced => {
                Effort { passes: 3, part: 0.01, least: 5e-3 }
            }
        };
        match self.reinsertion {
            Some(passes) if passes != 0 && !is_binary => Err(BuildError::NoBinaryTree { builder }),
            Some(passes) => Ok(Effort { passes: passes as usize, ..effort }),
            None if is_binary && self.quality != BuildQuality::Fast => Ok(effort),
            None => Ok(Effort { passes: 0, ..effort }),
        }
    }

    /// References for each triangle, at most.
    pub(crate) fn resolve_budget(&self) -> f32 {
        const MOST: f32 = 16.0;
        let budget = self.reference_budget.unwrap_or(1.5);
        if budget > 1.0 { budget.min(MOST) } else { 1.0 }
    }
}

/// What a build made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildStats {
    /// Triangles and procedural primitives of a BLAS or instances of a TLAS that rays can meet.
    pub primitives: usize,
    /// Those that are never met: not finite, too large, empty, zero area, no inverse.
    pub inactive: usize,
    /// Primitives in all leaves: more than `primitives` where spatial splits put some into several,
    /// or where instances have triangles and procedural primitives, for which there is a tree each.
    pub references: usize,
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
