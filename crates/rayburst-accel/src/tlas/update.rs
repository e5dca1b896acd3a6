//! Instances that move: new boxes in the old tree (DXR's update of a top-level structure).
//!
//! All boxes are recomputed from their children, bottom-up (Haines, Hoffman, Akenine-Möller,
//! "Real-Time Rendering", 4th edition, chapter 26); no BLAS is touched.

use super::{Tlas, placed_bounds, placements::Placements};
use crate::{
    Blas, BuildError, BuildOptions, BuildQuality, Instance, RefitReport, procedural::ProceduralTop,
    refit::boxes,
};

impl Tlas {
    /// Moves the instances: as many as at the build and of the same BLASes, with any other transforms,
    /// masks and flags. This is faster than a new build, but the tree is that of the build: the further
    /// instances move, the slower rays become, as the costs in the report tell.
    ///
    /// An instance that can no longer be hit (no inverse, not finite, too far away) is missed until
    /// another update brings it back. One that could not be hit when the structure was *built* is not
    /// in the tree, so it is an error if it can be hit now. Nothing is changed if there is an error.
    pub fn update(&mut self, instances: &[Instance]) -> Result<RefitReport, BuildError> {
        self.check_update(instances)?;
        // Few have procedural primitives, so that tree is built anew.
        let procedural = ProceduralTop::build(&self.blases, instances, &self.options())?;
        self.procedural = procedural.map(Box::new);
        let placed = &mut self.placed;
        let placements = Placements::new(&self.blases, instances, Blas::triangle_bounds, placed);
        let report = boxes::refit(&mut self.tree, |instance| placements.bounds(instance));
        self.instances.copy_from_slice(instances);
        self.sole = placements.sole();
        self.condition = placements.condition();
        self.reach = placements.reach(&report.bounds);
        let sah_before = std::mem::replace(&mut self.stats.sah_cost, report.sah_after);
        self.stats.primitives = placements.active();
        self.stats.references = placements.active();
        self.stats.inactive = instances.len() - placements.active();
        Ok(RefitReport { sah_before, ..report })
    }

    /// Options of a build while the structure is in use.
    fn options(&self) -> BuildOptions<'static> {
        BuildOptions { quality: BuildQuality::Fast, isa: Some(self.isa), ..BuildOptions::default() }
    }

    fn check_update(&self, instances: &[Instance]) -> Result<(), BuildError> {
        let (built, given) = (self.instances.len(), instances.len());
        if built != given {
            return Err(BuildError::InstancesDiffer { built, given });
        }
        let other = |(old, new): (&Instance, &Instance)| old.blas != new.blas;
        if let Some(index) = self.instances.iter().zip(instances).position(other) {
            return Err(BuildError::OtherBlas {
                instance: index as u32,
                built: self.instances[index].blas,
                given: instances[index].blas,
            });
        }
        if self.tree.shape.leaves == built {
            return Ok(());
        }
        let mut present = vec![false; built];
        self.tree.for_each_leaf(|instance| present[instance as usize] = true);
        let active = |index: usize| {
            let blases = &self.blases;
            !placed_bounds(&instances[index], blases, Blas::triangle_bounds).is_empty()
        };
        match (0..built).find(|&index| !present[index] && active(index)) {
            Some(index) => Err(BuildError::InstanceReappeared { instance: index as u32 }),
            None => Ok(()),
        }
    }
}
