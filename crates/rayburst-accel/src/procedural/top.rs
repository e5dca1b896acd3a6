//! The tree over the instances that have procedural primitives.

use std::sync::Arc;

use rayburst_math::{Aabb, Ray};

use crate::{
    Blas, BuildError, BuildOptions, Instance,
    layout::bvh8::Bvh8,
    tlas::{placements::Placements, slack},
    traverse::prepare::PreparedRay,
};

/// The tree over instances with procedural primitives, in the world.
#[derive(Clone, Debug)]
pub(crate) struct ProceduralTop {
    pub(super) tree: Bvh8,
    /// The greatest κ of these instances.
    condition: f32,
    /// The greatest coordinate of an instance's translation or of the bounds.
    reach: f32,
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
        Ok(Some(Self { tree, condition, reach }))
    }

    /// The box around all of them, in the world.
    pub(crate) fn bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// Bytes taken.
    pub(crate) fn bytes(&self) -> usize {
        self.tree.bytes()
    }

    /// A valid ray prepared for the boxes.
    #[inline(always)]
    pub(super) fn prepare(&self, ray: &Ray) -> Option<PreparedRay> {
        PreparedRay::new(ray, &self.tree.bounds, slack(ray, self.condition, self.reach))
    }
}
