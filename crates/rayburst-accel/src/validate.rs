//! Proof that a structure is what its builder meant.

use glam::Vec3;
use rayburst_math::Aabb;
use thiserror::Error;

use crate::{
    build::binned_sah::MAX_DEPTH,
    layout::bvh8::{Bvh8, Node8, Reference},
};

/// What is wrong with a structure.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BvhDefect {
    /// A primitive that can be hit is in no leaf.
    #[error("primitive {0} is in no leaf")]
    Missing(u32),
    /// A primitive is in several leaves.
    #[error("primitive {0} is in more than one leaf")]
    Repeated(u32),
    /// A primitive in a leaf is not one that can be hit, or differs from its source.
    #[error("the leaves hold primitive {0}, which is inactive, unknown or altered")]
    Foreign(u32),
    /// A box does not hold what is below it.
    #[error("child {slot} of node {node} does not enclose what is below it")]
    NotEnclosing {
        /// Which node.
        node: u32,
        /// Which of its children.
        slot: u32,
    },
    /// A reference leads out of the structure, or twice to the same place.
    #[error("child {slot} of node {node} leads nowhere, or where another child leads")]
    BadReference {
        /// Which node.
        node: u32,
        /// Which of its children.
        slot: u32,
    },
    /// The structure is deeper than the traversal's stack allows.
    #[error("the structure is {depth} levels deep, more than the {limit} that traversal allows")]
    TooDeep {
        /// How deep.
        depth: usize,
        /// How deep it may be.
        limit: usize,
    },
}

/// What a walk over a valid structure saw.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ValidationReport {
    /// Inner nodes.
    pub nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Primitives in them.
    pub primitives: usize,
    /// Inner nodes on the longest path.
    pub depth: usize,
    /// Cost by the surface area heuristic.
    pub sah_cost: f32,
}

/// Walks a tree; `primitives` of a leaf's value are their indices, less than `total`, and exact boxes.
pub(crate) fn tree(
    tree: &Bvh8,
    total: u32,
    expected: usize,
    leaf_half_lines: usize,
    primitives: impl Fn(u32) -> Vec<(u32, Aabb)>,
) -> Result<ValidationReport, BvhDefect> {
    let mut walk = Walk {
        tree,
        leaf_half_lines,
        primitives,
        seen: vec![false; total as usize],
        used: vec![false; tree.half_lines()],
        report: ValidationReport::default(),
        area: 0.0,
    };
    walk.claim(Reference::ROOT.value(), NODE_HALF_LINES).map_err(|()| bad_reference(0, 0))?;
    let bounds = walk.node(Reference::ROOT, 1)?;
    if walk.report.primitives != expected {
        let missing = walk.seen.iter().position(|&seen| !seen).unwrap_or_default();
        return Err(BvhDefect::Missing(missing as u32));
    }
    if !tree.bounds.contains_box(&bounds) || tree.bounds.is_empty() != bounds.is_empty() {
        return Err(BvhDefect::NotEnclosing { node: 0, slot: 0 });
    }
    if walk.report.primitives != 0 {
        let root = f64::from(bounds.half_area()).max(f64::MIN_POSITIVE);
        walk.report.sah_cost = ((walk.area + f64::from(bounds.half_area())) / root) as f32;
    }
    Ok(walk.report)
}

const NODE_HALF_LINES: usize = size_of::<Node8>() / 32;

fn bad_reference(node: u32, slot: usize) -> BvhDefect {
    BvhDefect::BadReference { node, slot: slot as u32 }
}

struct Walk<'a, P> {
    tree: &'a Bvh8,
    leaf_half_lines: usize,
    primitives: P,
    seen: Vec<bool>,
    used: Vec<bool>,
    report: ValidationReport,
    /// Of all nodes and leaves but the root.
    area: f64,
}

impl<P: Fn(u32) -> Vec<(u32, Aabb)>> Walk<'_, P> {
    /// Marks half lines as used; fails if they do not exist or already are.
    fn claim(&mut self, at: u32, count: usize) -> Result<(), ()> {
        let lines = self.used.get_mut(at as usize..at as usize + count).ok_or(())?;
        if lines.contains(&true) {
            return Err(());
        }
        lines.fill(true);
        Ok(())
    }

    /// Checks a node and all below it; returns the box around the primitives there.
    fn node(&mut self, reference: Reference, depth: usize) -> Result<Aabb, BvhDefect> {
        let at = reference.value();
        if depth > MAX_DEPTH {
            return Err(BvhDefect::TooDeep { depth, limit: MAX_DEPTH });
        }
        self.report.nodes += 1;
        self.report.depth = self.report.depth.max(depth);
        let node = *self.tree.node(reference);
        let mut all = Aabb::EMPTY;
        for slot in 0..8 {
            let child = node.children[slot];
            let planes = node.boxes.planes.map(|row| row[slot]);
            let bounds = Aabb {
                lower: Vec3::new(planes[0], planes[2], planes[4]),
                upper: Vec3::new(planes[1], planes[3], planes[5]),
            };
            if child == Reference::NONE {
                if bounds != Aabb::EMPTY {
                    return Err(bad_reference(at, slot));
                }
                continue;
            }
            self.area += f64::from(bounds.half_area());
            let below = if child.is_leaf() {
                self.leaf(at, slot, child)?
            } else {
                if !child.value().is_multiple_of(2)
                    || self.claim(child.value(), NODE_HALF_LINES).is_err()
                {
                    return Err(bad_reference(at, slot));
                }
                self.node(child, depth + 1)?
            };
            // What a refit cannot hit any more has an empty box.
            if below.is_empty() != bounds.is_empty() || !bounds.contains_box(&below) {
                return Err(BvhDefect::NotEnclosing { node: at, slot: slot as u32 });
            }
            all = all.union(below);
        }
        Ok(all)
    }

    fn leaf(&mut self, node: u32, slot: usize, leaf: Reference) -> Result<Aabb, BvhDefect> {
        let value = leaf.value();
        let claimed = if self.leaf_half_lines == 0 {
            (value as usize) < self.seen.len()
        } else {
            self.claim(value, self.leaf_half_lines).is_ok()
        };
        if !claimed {
            return Err(bad_reference(node, slot));
        }
        self.report.leaves += 1;
        let mut all = Aabb::EMPTY;
        for (primitive, bounds) in (self.primitives)(value) {
            let seen =
                self.seen.get_mut(primitive as usize).ok_or(BvhDefect::Foreign(primitive))?;
            if std::mem::replace(seen, true) {
                return Err(BvhDefect::Repeated(primitive));
            }
            if bounds.is_empty() {
                return Err(BvhDefect::Foreign(primitive));
            }
            self.report.primitives += 1;
            all = all.union(bounds);
        }
        Ok(all)
    }
}
