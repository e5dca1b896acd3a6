//! Procedural primitives whose boxes move, and geometries of both kinds.

use super::RefitReport;
use crate::{Blas, BuildError, Geometry, GeometryKind, ProceduralBoxes, TriangleMesh};

impl Blas {
    /// Moves the boxes of procedural primitives to new places: the geometries must have as many boxes as
    /// those that the structure was built from. Geometries keep the opacity of the build. Triangles stay as
    /// they are: for each of their geometries none must be given, and the report is of the boxes alone.
    ///
    /// A primitive that can no longer be met (its box empty, not finite, too large) is passed until another
    /// refit brings it back. One that could not be met when the structure was *built* is not in it, so it is
    /// an error if it can be met now. Nothing is changed if there is an error. The layout of the triangles
    /// does not matter.
    pub fn refit_procedural(
        &mut self,
        geometries: &[ProceduralBoxes<'_>],
    ) -> Result<RefitReport, BuildError> {
        self.check_boxes(geometries)?;
        Ok(self.move_boxes(geometries))
    }

    /// Moves everything, as [`Blas::refit`] does triangles and [`Blas::refit_procedural`] does boxes; each
    /// geometry must be of the kind that it was at the build. The costs in the report are the sums of those
    /// of both trees. Nothing is changed if there is an error.
    pub fn refit_geometries(
        &mut self,
        geometries: &[Geometry<'_>],
    ) -> Result<RefitReport, BuildError> {
        self.check_kinds(geometries)?;
        let (meshes, boxes) = split(geometries);
        self.check_boxes(&boxes)?;
        if geometries.iter().all(|geometry| geometry.info().kind == GeometryKind::Procedural) {
            return Ok(self.move_boxes(&boxes));
        }
        let report = self.refit(&meshes)?;
        if self.procedural().is_none() {
            return Ok(report);
        }
        let other = self.move_boxes(&boxes);
        Ok(RefitReport {
            bounds: report.bounds.union(other.bounds),
            sah_before: report.sah_before + other.sah_before,
            sah_after: report.sah_after + other.sah_after,
            boxes_changed: report.boxes_changed + other.boxes_changed,
        })
    }

    fn move_boxes(&mut self, geometries: &[ProceduralBoxes<'_>]) -> RefitReport {
        match self.procedural_mut() {
            Some(tree) => tree.refit(geometries),
            None => RefitReport {
                bounds: rayburst_math::Aabb::EMPTY,
                sah_before: 0.0,
                sah_after: 0.0,
                boxes_changed: 0,
            },
        }
    }

    /// Whether each geometry is of the kind that it was at the build.
    fn check_kinds(&self, geometries: &[Geometry<'_>]) -> Result<(), BuildError> {
        self.check_count(geometries.len())?;
        for ((built, given), geometry) in self.geometries().iter().zip(geometries).zip(0..) {
            let (built, given) = (built.kind, given.info().kind);
            if built != given {
                return Err(BuildError::KindsDiffer { geometry, built, given });
            }
        }
        Ok(())
    }

    /// Whether there are as many geometries and boxes as at the build, and none would have to be added.
    fn check_boxes(&self, geometries: &[ProceduralBoxes<'_>]) -> Result<(), BuildError> {
        self.check_count(geometries.len())?;
        for ((built, boxes), geometry) in self.geometries().iter().zip(geometries).zip(0..) {
            let built = match built.kind {
                GeometryKind::Procedural => built.primitives as usize,
                GeometryKind::Triangles => 0,
            };
            let given = boxes.boxes.len();
            if built != given {
                return Err(BuildError::BoxesDiffer { geometry, built, given });
            }
        }
        match self.procedural().and_then(|tree| tree.reappeared(geometries)) {
            Some((geometry, primitive)) => Err(BuildError::BoxReappeared { geometry, primitive }),
            None => Ok(()),
        }
    }
}

/// The triangles and the boxes of geometries; of the other kind there are none.
pub(crate) fn split<'a>(
    geometries: &[Geometry<'a>],
) -> (Vec<TriangleMesh<'a>>, Vec<ProceduralBoxes<'a>>) {
    let parts = geometries.iter().map(|geometry| match *geometry {
        Geometry::Triangles(mesh) => (mesh, ProceduralBoxes::new(&[])),
        Geometry::Procedural(boxes) => (TriangleMesh::new(&[], &[]), boxes),
    });
    parts.unzip()
}
