//! The tree over the instances that have procedural primitives.

use std::sync::Arc;

use glam::Vec3;
use rayburst_math::{Aabb, Ray};

use super::BoxLeaves;
use crate::{
    Blas, BuildError, Instance,
    build::{
        binned_sah::{BinnedSah, MAX_DEPTH},
        monitor::Monitor,
        primitives::PrimitiveRef,
    },
    layout::bvh8::Bvh8,
    tlas::{place, slack},
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
    /// Builds over those of the instances that have procedural primitives; `None` if none has.
    pub(crate) fn build(
        blases: &[Arc<Blas>],
        instances: &[Instance],
    ) -> Result<Option<Self>, BuildError> {
        if blases.iter().all(|blas| blas.procedural().is_none()) {
            return Ok(None);
        }
        let (mut condition, mut reach, mut refs) = (1.0f32, 0.0f32, vec![]);
        for (instance, index) in instances.iter().zip(0..) {
            let placement = match blases.get(instance.blas as usize) {
                Some(blas) => place(instance, &blas.procedural_bounds()),
                None => continue,
            };
            if placement.bounds.is_empty() {
                continue;
            }
            condition = condition.max(placement.condition);
            reach = reach.max(Vec3::from(instance.transform.translation).abs().max_element());
            refs.push(PrimitiveRef::new(&placement.bounds, index));
        }
        let monitor = Monitor::default();
        let binary = BinnedSah { bins: 16, leaf_size: 1, max_depth: MAX_DEPTH, monitor };
        let tree = Bvh8::collapse(&binary.build(refs)?, &BoxLeaves)?;
        if !tree.bounds.is_empty() {
            let corner = tree.bounds.lower.abs().max(tree.bounds.upper.abs());
            reach = reach.max(corner.max_element());
        }
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
