//! Instances that move: new boxes in the old tree (DXR's update of a top-level structure).
//!
//! All boxes are recomputed from their children, bottom-up (Haines, Hoffman, Akenine-Möller,
//! "Real-Time Rendering", 4th edition, chapter 26); no BLAS is touched.

use glam::Vec3;
use rayburst_math::Aabb;
use rayon::prelude::*;

use super::{Tlas, placed_bounds, placements::Placements};
use crate::{
    Blas, BuildError, BuildOptions, BuildQuality, Instance, RefitReport,
    layout::bvh8::{Bvh8, NODE_LINES, Node8, Reference},
    procedural::ProceduralTop,
};

/// Nodes that one task works on, at least.
const TASK: usize = 1 << 9;

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
        let done = refit(&mut self.tree, |instance| placements.bounds(instance));
        let bounds = done.bounds;
        let root = f64::from(bounds.half_area()).max(f64::MIN_POSITIVE);
        let sah_after = if bounds.is_empty() { 0.0 } else { (done.area / root) as f32 };
        let boxes_changed = done.changed + usize::from(self.tree.bounds != bounds);
        self.tree.bounds = bounds;
        self.tree.shape.sah_cost = sah_after;
        self.instances.copy_from_slice(instances);
        self.sole = placements.sole();
        self.condition = placements.condition();
        self.reach = placements.reach(&bounds);
        let sah_before = std::mem::replace(&mut self.stats.sah_cost, sah_after);
        self.stats.primitives = placements.active();
        self.stats.references = placements.active();
        self.stats.inactive = instances.len() - placements.active();
        Ok(RefitReport { bounds, sah_before, sah_after, boxes_changed })
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

/// What a refit finds out.
struct Done {
    bounds: Aabb,
    /// Of all nodes and leaves.
    area: f64,
    changed: usize,
}

/// Makes all boxes of a tree of instances anew, given those of the instances.
fn refit(tree: &mut Bvh8, bounds_of: impl Fn(u32) -> Aabb + Sync) -> Done {
    let (lines, above) = tree.lines_mut();
    let nodes: &mut [Node8] = bytemuck::cast_slice_mut(lines);
    // What is below nodes first: most of it, and independent.
    let mut changed: usize = nodes
        .par_iter_mut()
        .with_min_len(TASK)
        .map(|node| set_children(node, |child| child.is_leaf().then(|| bounds_of(child.value()))))
        .sum();
    // Nodes follow those above them; those of clusters, which have leaves only, come earlier.
    let first_above = above.map_or(1, |line| line / NODE_LINES);
    let order = (1..first_above).chain((first_above..nodes.len()).rev()).chain([0]);
    let mut boxes = vec![Aabb::EMPTY; nodes.len()];
    let mut area = 0.0;
    for number in order {
        let node = &mut nodes[number];
        changed += set_children(node, |child| {
            (!child.is_leaf()).then(|| boxes[child.value() as usize / (2 * NODE_LINES)])
        });
        let (all, below) = sum(node);
        boxes[number] = all;
        area += below;
    }
    let bounds = boxes[0];
    Done { bounds, area: area + f64::from(bounds.half_area()), changed }
}

/// Sets the boxes of some children; returns how many are not what they were.
fn set_children(node: &mut Node8, bounds_of: impl Fn(Reference) -> Option<Aabb>) -> usize {
    let mut changed = 0;
    for slot in 0..8 {
        let child = node.children[slot];
        if child == Reference::NONE {
            continue;
        }
        let Some(Aabb { lower, upper }) = bounds_of(child) else { continue };
        let new = [lower.x, upper.x, lower.y, upper.y, lower.z, upper.z];
        let mut differs = false;
        for (row, new) in node.boxes.planes.iter_mut().zip(new) {
            differs |= row[slot] != new;
            row[slot] = new;
        }
        changed += usize::from(differs);
    }
    changed
}

/// The box around the children of a node, and half the areas of theirs.
fn sum(node: &Node8) -> (Aabb, f64) {
    let planes = &node.boxes.planes;
    let least = |row: usize| planes[row].iter().copied().fold(f32::INFINITY, f32::min);
    let greatest = |row: usize| planes[row].iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let all = Aabb {
        lower: Vec3::new(least(0), least(2), least(4)),
        upper: Vec3::new(greatest(1), greatest(3), greatest(5)),
    };
    let mut area = 0.0;
    for slot in 0..8 {
        // Empty boxes have negative edges.
        let edge = |axis: usize| (planes[2 * axis + 1][slot] - planes[2 * axis][slot]).max(0.0);
        let [x, y, z] = [edge(0), edge(1), edge(2)];
        area += f64::from(x * y + y * z + z * x);
    }
    (all, area)
}
