//! The tree over the instances that have procedural primitives.

use std::sync::Arc;

use rayburst_math::{Aabb, Ray};

use crate::{
    Blas, BuildError, BuildOptions, BuildStats, BvhDefect, Instance, ValidationReport,
    build::boxes::BoxLeaves,
    layout::{
        bvh8::{Bvh8, Leaves},
        view::TreeView,
    },
    tlas::{placed_bounds, placements::Placements, slack},
    traverse::prepare::PreparedRay,
    validate,
};

/// The tree over instances with procedural primitives, in the world.
#[derive(Clone, Debug)]
pub(crate) struct ProceduralTop {
    tree: Bvh8,
    /// The greatest κ of these instances.
    condition: f32,
    /// The greatest coordinate of an instance's translation or of the bounds.
    reach: f32,
    /// How many instances it holds, and how many of them have no triangles that can be hit.
    count: usize,
    alone: usize,
}

impl ProceduralTop {
    /// Builds over those of the instances that have procedural primitives; `None` if no BLAS has.
    pub(crate) fn build(
        blases: &[Arc<Blas>],
        instances: &[Instance],
        options: &BuildOptions<'_>,
    ) -> Result<Option<Self>, BuildError> {
        if blases.iter().all(|blas| blas.procedural().is_none()) {
            return Ok(None);
        }
        let (bounds_of, mut placed) = (Blas::procedural_bounds, vec![]);
        let placements = Placements::new(blases, instances, bounds_of, &mut placed);
        let tree = placements.tree(options)?;
        let (condition, reach) = (placements.condition(), placements.reach(&tree.bounds));
        let is_alone = |(instance, index): &(&Instance, u32)| {
            !placements.bounds(*index).is_empty()
                && placed_bounds(instance, blases, Blas::triangle_bounds).is_empty()
        };
        let alone = instances.iter().zip(0..).filter(is_alone).count();
        Ok(Some(Self { tree, condition, reach, count: placements.active(), alone }))
    }

    /// The box around all of them, in the world.
    pub(crate) fn bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// What both trees of a TLAS consist of, given that of the other one; [`Self::bytes`] are in there.
    pub(crate) fn add_to(&self, other: BuildStats) -> BuildStats {
        let shape = &self.tree.shape;
        BuildStats {
            primitives: other.primitives + self.alone,
            inactive: other.inactive - self.alone,
            references: other.references + self.count,
            nodes: other.nodes + shape.nodes,
            leaves: other.leaves + shape.leaves,
            depth: other.depth.max(shape.depth),
            sah_cost: other.sah_cost + shape.sah_cost,
            ..other
        }
    }

    /// Proves the tree; returns the report on both trees, given that on the other one.
    pub(crate) fn validate(
        &self,
        blases: &[Arc<Blas>],
        instances: &[Instance],
        other: ValidationReport,
    ) -> Result<ValidationReport, BvhDefect> {
        let total = instances.len() as u32;
        let report =
            validate::tree(&self.tree, total, self.count, BoxLeaves::HALF_LINES, |value| {
                let instance = &instances[value as usize];
                let bounds = placed_bounds(instance, blases, Blas::procedural_bounds);
                vec![(value, bounds)]
            })?;
        let primitives = other.primitives + self.alone;
        Ok(ValidationReport { primitives, ..other.and(&report) })
    }

    /// Bytes taken.
    pub(crate) fn bytes(&self) -> usize {
        self.tree.bytes()
    }

    /// What traversal sees; leaves' values are indices of instances.
    #[inline(always)]
    pub(crate) fn view(&self) -> TreeView {
        self.tree.view()
    }

    /// A valid ray prepared for the boxes.
    #[inline(always)]
    pub(crate) fn prepare(&self, ray: &Ray) -> Option<PreparedRay> {
        PreparedRay::new(ray, &self.tree.bounds, slack(ray, self.condition, self.reach))
    }
}
