//! Procedural primitives: boxes, each with something in it that only the caller can intersect.
//!
//! They have trees of their own, beside those of triangles: a ray that meets only triangles pays nothing
//! for them, and kernels of triangles know nothing of them. A ray is done with triangles first, so that
//! its interval is short when intersection shaders, which cost more, are asked.

mod top;
mod visit;

use glam::Vec4;
use rayburst_math::Aabb;

pub(crate) use top::ProceduralTop;
pub use visit::ProceduralCandidate;

use crate::{
    BuildError, BuildOptions, BuildStats, BvhDefect, Geometry, ProceduralBoxes, RefitReport,
    ValidationReport,
    build::{
        boxes::{BoxLeaves, Boxes, twice_the_centre},
        monitor::Monitor,
        primitives::{MAX_PRIMITIVES, is_traceable},
    },
    layout::{
        bvh8::{Bvh8, Leaves},
        triangles::locate,
        view::TreeView,
    },
    refit::boxes,
    validate,
};

/// The tree of a BLAS over boxes.
#[derive(Clone, Debug)]
pub(crate) struct ProceduralTree {
    tree: Bvh8,
    /// The number of each geometry's first box, and after the last the number of all; geometries of
    /// triangles have none.
    starts: Vec<u32>,
    /// Whether each geometry is opaque.
    opaque: Vec<bool>,
    primitives: usize,
}

/// Whether a primitive in the box can be met.
fn is_active(bounds: &Aabb) -> bool {
    !bounds.is_empty() && is_traceable(bounds)
}

impl ProceduralTree {
    /// Builds over the boxes of some geometries; `None` if none of them is procedural.
    pub(crate) fn build(
        geometries: &[Geometry<'_>],
        options: &BuildOptions<'_>,
    ) -> Result<Option<Self>, BuildError> {
        if geometries.iter().all(|geometry| matches!(geometry, Geometry::Triangles(_))) {
            return Ok(None);
        }
        // Progress is that of the triangles' tree.
        let monitor = Monitor::new(options.control).silent();
        monitor.check()?;
        let (mut starts, mut boxes) = (vec![0], vec![]);
        for geometry in geometries {
            if let Geometry::Procedural(geometry) = geometry {
                let count = boxes.len() + geometry.boxes.len();
                if count > MAX_PRIMITIVES {
                    let (what, limit) = ("procedural primitives", MAX_PRIMITIVES);
                    return Err(BuildError::TooMany { what, count, limit });
                }
                let active = |b: &Aabb| if is_active(b) { *b } else { Aabb::EMPTY };
                boxes.extend(geometry.boxes.iter().map(active));
            }
            starts.push(boxes.len() as u32);
        }
        let (mut primitives, mut centres) = (0, [Vec4::INFINITY, Vec4::NEG_INFINITY]);
        for bounds in boxes.iter().filter(|bounds| !bounds.is_empty()) {
            let centre = twice_the_centre(bounds);
            centres = [centres[0].min(centre), centres[1].max(centre)];
            primitives += 1;
        }
        let (count, bounds_of) = (boxes.len(), |index| boxes[index as usize]);
        let tree =
            Boxes { count, active: primitives, centres, bounds_of }.tree(options, monitor)?;
        let opaque = geometries.iter().map(|geometry| geometry.info().opaque).collect();
        Ok(Some(Self { tree, starts, opaque, primitives }))
    }

    /// The first primitive that is not in the tree, but could be met in its box now.
    pub(crate) fn reappeared(&self, geometries: &[ProceduralBoxes<'_>]) -> Option<(u32, u32)> {
        let total = *self.starts.last().unwrap_or(&0);
        if self.tree.shape.leaves == total as usize {
            return None;
        }
        let mut present = vec![false; total as usize];
        self.tree.for_each_leaf(|number| present[number as usize] = true);
        let absent = (0..total).filter(|&number| !present[number as usize]);
        let mut absent = absent.map(|number| locate(&self.starts, number));
        absent.find(|&(geometry, primitive)| {
            is_active(&geometries[geometry as usize].boxes[primitive as usize])
        })
    }

    /// Moves the primitives; there must be as many as at the build, and none that [`Self::reappeared`].
    pub(crate) fn refit(&mut self, geometries: &[ProceduralBoxes<'_>]) -> RefitReport {
        let starts = &self.starts;
        let bounds_of = |number| {
            let (geometry, primitive) = locate(starts, number);
            let bounds = geometries[geometry as usize].boxes[primitive as usize];
            if is_active(&bounds) { bounds } else { Aabb::EMPTY }
        };
        let report = boxes::refit(&mut self.tree, bounds_of);
        self.primitives =
            geometries.iter().flat_map(|all| all.boxes).filter(|b| is_active(b)).count();
        report
    }

    /// The box around all primitives that can be met; empty if there are none.
    pub(crate) fn bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// What both trees of a BLAS consist of, given that of the other one.
    pub(crate) fn add_to(&self, other: BuildStats) -> BuildStats {
        let (shape, total) = (&self.tree.shape, *self.starts.last().unwrap_or(&0) as usize);
        let words = size_of_val(self.starts.as_slice()) + size_of_val(self.opaque.as_slice());
        BuildStats {
            primitives: other.primitives + self.primitives,
            inactive: other.inactive + total - self.primitives,
            references: other.references + shape.leaves,
            nodes: other.nodes + shape.nodes,
            leaves: other.leaves + shape.leaves,
            depth: other.depth.max(shape.depth),
            sah_cost: other.sah_cost + shape.sah_cost,
            bytes: other.bytes + self.tree.bytes() + words,
            ..other
        }
    }

    /// What traversal sees; leaves' values are numbers of boxes.
    #[inline(always)]
    pub(crate) fn view(&self) -> TreeView {
        self.tree.view()
    }

    /// The primitive in a box, numbered through all geometries.
    #[inline(always)]
    pub(crate) fn candidate(
        &self,
        number: u32,
        instance: u32,
        force_opaque: Option<bool>,
    ) -> ProceduralCandidate {
        let (geometry, primitive) = locate(&self.starts, number);
        let opaque = force_opaque.unwrap_or(self.opaque[geometry as usize]);
        ProceduralCandidate { instance, geometry, primitive, opaque }
    }

    /// Proves the tree; returns the report on both trees of a BLAS, given that on the other one.
    pub(crate) fn validate(&self, other: ValidationReport) -> Result<ValidationReport, BvhDefect> {
        let total = *self.starts.last().unwrap_or(&0);
        let report = validate::box_tree(&self.tree, total, self.primitives, BoxLeaves::HALF_LINES)?;
        Ok(other.and(&report))
    }
}
