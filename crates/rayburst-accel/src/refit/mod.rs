//! Refitting: new vertices in an old tree.
//!
//! All boxes are recomputed from their children, bottom-up, as tight as they can be in the old tree
//! (Haines, Hoffman, Akenine-Möller, "Real-Time Rendering", 4th edition, chapter 26). The cost by the
//! surface area heuristic before and after tells when a rebuild pays.
//!
//! Changed: works on the wide nodes and leaves in place ([`whole`]), in the order of the memory, many
//! leaves at a time ([`leaves`]). Where few triangles moved, boxes may grow instead ([`changed`]).
//! Procedural primitives have trees whose leaves are boxes ([`procedural`], [`boxes`]).

pub(crate) mod boxes;
pub(crate) mod changed;
mod leaves;
pub(crate) mod procedural;
mod whole;

use rayburst_math::Aabb;
use rayburst_simd::Triangles4;

use self::{leaves::Source, whole::Whole};
use crate::{
    Blas, BuildError, TriangleMesh,
    build::{primitives::check_indices, triangle_keys::hittable},
    layout::{
        arena::Line,
        bvh8::{NODE_LINES, Node8},
        curve_leaves::LEAF_WORDS,
    },
};

/// What a refit did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitReport {
    /// The box around all that was refitted and can be hit.
    pub bounds: Aabb,
    /// Cost by the surface area heuristic before, as in [`crate::BuildStats::sah_cost`].
    pub sah_before: f32,
    /// The same after.
    pub sah_after: f32,
    /// Boxes of nodes and leaves that are not what they were.
    pub boxes_changed: usize,
}

/// The node that starts at a line.
#[inline(always)]
fn node_mut(lines: &mut [Line], line: usize) -> &mut Node8 {
    &mut bytemuck::cast_slice_mut(&mut lines[line..line + NODE_LINES])[0]
}

/// The block of a leaf that starts at a half line.
#[inline(always)]
fn block_mut(lines: &mut [Line], half_line: usize) -> &mut Triangles4 {
    let words: &mut [u32] = bytemuck::cast_slice_mut(lines);
    &mut bytemuck::cast_slice_mut(&mut words[8 * half_line..][..LEAF_WORDS])[0]
}

impl Blas {
    /// Moves the triangles to new places: the geometries must have as many triangles as those that
    /// the structure was built from, and should have the same vertices for each. Geometries keep
    /// the opacity of the build. Procedural geometries stay as they are: for each a mesh without
    /// triangles must be given, and reports are of the triangles alone; see [`Blas::refit_procedural`]
    /// and [`Blas::refit_geometries`].
    ///
    /// A triangle that can no longer be hit (not finite, too large, zero area) is missed until
    /// another refit brings it back. One that could not be hit when the structure was *built* is not
    /// in it, so it is an error, after which the structure is as before, if it can be hit now.
    pub fn refit(&mut self, geometries: &[TriangleMesh<'_>]) -> Result<RefitReport, BuildError> {
        self.check_layout()?;
        self.check_topology(geometries)?;
        let (count, isa) = (self.geometry_count(), self.isa());
        let (tree, starts, _) = self.parts();
        let whole = Whole { source: Source { geometries, starts: &starts[..count] }, isa };
        let (bounds, done) = whole.refit(tree);
        let bounds = if bounds.is_empty() { Aabb::EMPTY } else { bounds.aabb() };
        let root = f64::from(bounds.half_area()).max(f64::MIN_POSITIVE);
        let sah_after = if bounds.is_empty() { 0.0 } else { (done.area / root) as f32 };
        let boxes_changed = done.changed + usize::from(tree.bounds != bounds);
        tree.bounds = bounds;
        tree.loose = false;
        tree.shape.sah_cost = sah_after;
        let total = starts[count] as usize;
        let absent = self.absent().len();
        let hidden = if done.hidden == 0 { 0 } else { self.count_hidden() };
        let (_, _, stats) = self.parts();
        let sah_before = std::mem::replace(&mut stats.sah_cost, sah_after);
        stats.primitives = total - absent - hidden;
        stats.inactive = absent + hidden;
        Ok(RefitReport { bounds, sah_before, sah_after, boxes_changed })
    }

    /// Compressed structures cannot be refitted.
    fn check_layout(&self) -> Result<(), BuildError> {
        if self.tree.is_compressed() { Err(BuildError::CompressedRefit) } else { Ok(()) }
    }

    fn check_topology(&self, geometries: &[TriangleMesh<'_>]) -> Result<(), BuildError> {
        self.check_counts(geometries)?;
        for (geometry, mesh) in geometries.iter().enumerate() {
            check_indices(self.isa(), geometry, mesh)?;
        }
        for &triangle in self.absent() {
            let (geometry, primitive) = self.locate(triangle);
            if hittable(geometries[geometry as usize].triangle(primitive as usize)).is_some() {
                return Err(BuildError::Reappeared { geometry, primitive });
            }
        }
        Ok(())
    }

    /// Whether there are as many geometries as at the build.
    fn check_count(&self, given: usize) -> Result<(), BuildError> {
        let built = self.geometry_count();
        if given == built { Ok(()) } else { Err(BuildError::GeometriesDiffer { built, given }) }
    }

    /// Whether there are as many geometries and triangles as at the build.
    fn check_counts(&self, geometries: &[TriangleMesh<'_>]) -> Result<(), BuildError> {
        self.check_count(geometries.len())?;
        for (geometry, mesh) in geometries.iter().enumerate() {
            let built = self.triangle_count(geometry);
            if mesh.indices.len() != built {
                let (geometry, given) = (geometry as u32, mesh.indices.len());
                return Err(BuildError::TrianglesDiffer { geometry, built, given });
            }
        }
        Ok(())
    }
}
