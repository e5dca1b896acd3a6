//! The tree over the instances that have procedural primitives.

use std::sync::Arc;

use glam::Vec3;
use rayburst_math::{Aabb, Ray};

use super::BoxLeaves;
use crate::{
    Blas, BuildError, BuildStats, BvhDefect, Instance, ValidationReport,
    build::{
        binned_sah::{BinnedSah, MAX_DEPTH},
        monitor::Monitor,
        primitives::PrimitiveRef,
    },
    layout::{
        bvh8::{Bvh8, Leaves},
        view::TreeView,
    },
    tlas::{Placement, place, slack},
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
    /// Builds over those of the instances that have procedural primitives; `None` if none has. Given is
    /// where their triangles are, too.
    pub(crate) fn build(
        blases: &[Arc<Blas>],
        instances: &[Instance],
        triangles: &[Placement],
    ) -> Result<Option<Self>, BuildError> {
        if blases.iter().all(|blas| blas.procedural().is_none()) {
            return Ok(None);
        }
        let (mut condition, mut reach, mut refs) = (1.0f32, 0.0f32, vec![]);
        let mut alone = 0;
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
            alone += usize::from(triangles[index as usize].bounds.is_empty());
        }
        let count = refs.len();
        let monitor = Monitor::default();
        let binary = BinnedSah { bins: 16, leaf_size: 1, max_depth: MAX_DEPTH, monitor };
        let tree = Bvh8::collapse(&binary.build(refs)?, &BoxLeaves)?;
        if !tree.bounds.is_empty() {
            let corner = tree.bounds.lower.abs().max(tree.bounds.upper.abs());
            reach = reach.max(corner.max_element());
        }
        Ok(Some(Self { tree, condition, reach, count, alone }))
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
                let bounds = blases[instance.blas as usize].procedural_bounds();
                vec![(value, place(instance, &bounds).bounds)]
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
