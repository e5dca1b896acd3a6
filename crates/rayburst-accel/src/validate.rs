//! Proof that a structure is what its builder meant.

use glam::Vec3;
use rayburst_math::Aabb;
use thiserror::Error;

use crate::{
    build::binned_sah::MAX_DEPTH,
    layout::{
        bvh8::{Bvh8, Node8, Reference},
        compressed::NODE_UNITS,
    },
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
    /// A part of a primitive that is in several leaves is in none of their boxes.
    #[error("the boxes of the leaves that hold primitive {0} do not cover it")]
    NotCovered(u32),
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
    /// Different primitives in them.
    pub primitives: usize,
    /// Primitives in them, those in several as often.
    pub references: usize,
    /// Inner nodes on the longest path.
    pub depth: usize,
    /// Cost by the surface area heuristic.
    pub sah_cost: f32,
}

impl ValidationReport {
    /// What a walk over two structures saw.
    pub(crate) fn and(self, other: &Self) -> Self {
        Self {
            nodes: self.nodes + other.nodes,
            leaves: self.leaves + other.leaves,
            primitives: self.primitives + other.primitives,
            references: self.references + other.references,
            depth: self.depth.max(other.depth),
            sah_cost: self.sah_cost + other.sah_cost,
        }
    }
}

/// Walks a tree in which each primitive is once, and its box is that of the leaf.
pub(crate) fn box_tree(
    tree: &Bvh8,
    total: u32,
    expected: usize,
    leaf_half_lines: usize,
) -> Result<ValidationReport, BvhDefect> {
    walk(tree, total, expected, leaf_half_lines, Boxes).map(|(report, _)| report)
}

/// Walks a tree in which each primitive is once; `primitives` of a leaf's value are their indices, less
/// than `total`, and exact boxes.
pub(crate) fn tree(
    tree: &Bvh8,
    total: u32,
    expected: usize,
    leaf_half_lines: usize,
    primitives: impl Fn(u32) -> Vec<(u32, Aabb)>,
) -> Result<ValidationReport, BvhDefect> {
    walk(tree, total, expected, leaf_half_lines, Once { primitives }).map(|(report, _)| report)
}

/// Walks a tree in which a triangle may be in several leaves; `triangles` of a leaf's value are their
/// indices, less than `total`, and corners.
pub(crate) fn split_tree(
    tree: &Bvh8,
    total: u32,
    expected: usize,
    leaf_half_lines: usize,
    triangles: impl Fn(u32) -> Vec<(u32, [Vec3; 3])>,
) -> Result<ValidationReport, BvhDefect> {
    let parts = Parts { triangles, parts: vec![] };
    let (report, Parts { mut parts, .. }) = walk(tree, total, expected, leaf_half_lines, parts)?;
    parts.sort_by_key(|part| part.triangle);
    for parts in parts.chunk_by(|a, b| a.triangle == b.triangle) {
        check_cover(parts)?;
    }
    Ok(report)
}

fn walk<L: Leaf>(
    tree: &Bvh8,
    total: u32,
    expected: usize,
    leaf_half_lines: usize,
    leaf: L,
) -> Result<(ValidationReport, L), BvhDefect> {
    let mut walk = Walk {
        tree,
        leaf_half_lines,
        leaf,
        seen: vec![false; total as usize],
        used: vec![false; tree.extent()],
        report: ValidationReport::default(),
        area: 0.0,
    };
    walk.claim(Reference::ROOT).map_err(|()| bad_reference(0, 0))?;
    let bounds = walk.node(Reference::ROOT, &tree.bounds, 1)?;
    if walk.report.primitives != expected {
        let missing = walk.seen.iter().position(|&seen| !seen).unwrap_or_default();
        return Err(BvhDefect::Missing(missing as u32));
    }
    if !encloses(tree, &tree.bounds, &bounds) {
        return Err(BvhDefect::NotEnclosing { node: 0, slot: 0 });
    }
    if walk.report.primitives != 0 {
        let root = f64::from(tree.bounds.half_area());
        walk.report.sah_cost = ((walk.area + root) / root.max(f64::MIN_POSITIVE)) as f32;
    }
    Ok((walk.report, walk.leaf))
}

/// Whether a box holds what is below it. What can no longer be hit since a refit has an empty box,
/// unless boxes only grew.
fn encloses(tree: &Bvh8, bounds: &Aabb, below: &Aabb) -> bool {
    bounds.contains_box(below) && (tree.loose || bounds.is_empty() == below.is_empty())
}

/// What is in leaves.
trait Leaf {
    /// Checks the leaf of a value in a box; notes its primitives and returns a box that those above
    /// must enclose.
    fn check(
        &mut self,
        value: u32,
        bounds: &Aabb,
        seen: &mut [bool],
        report: &mut ValidationReport,
    ) -> Result<Aabb, BvhDefect>;
}

/// Leaves whose boxes enclose their primitives, each of which is in one leaf.
struct Once<P> {
    primitives: P,
}

impl<P: Fn(u32) -> Vec<(u32, Aabb)>> Leaf for Once<P> {
    fn check(
        &mut self,
        value: u32,
        _: &Aabb,
        seen: &mut [bool],
        report: &mut ValidationReport,
    ) -> Result<Aabb, BvhDefect> {
        let mut all = Aabb::EMPTY;
        for (primitive, bounds) in (self.primitives)(value) {
            let seen = seen.get_mut(primitive as usize).ok_or(BvhDefect::Foreign(primitive))?;
            if std::mem::replace(seen, true) {
                return Err(BvhDefect::Repeated(primitive));
            }
            if bounds.is_empty() {
                return Err(BvhDefect::Foreign(primitive));
            }
            report.primitives += 1;
            report.references += 1;
            all = all.union(bounds);
        }
        Ok(all)
    }
}

/// Leaves that are their boxes; an empty one is of a primitive that cannot be met since a refit.
struct Boxes;

impl Leaf for Boxes {
    fn check(
        &mut self,
        value: u32,
        bounds: &Aabb,
        seen: &mut [bool],
        report: &mut ValidationReport,
    ) -> Result<Aabb, BvhDefect> {
        if bounds.is_empty() {
            return Once { primitives: |_| vec![] }.check(value, bounds, seen, report);
        }
        Once { primitives: |value| vec![(value, *bounds)] }.check(value, bounds, seen, report)
    }
}

/// Leaves whose boxes enclose parts of their triangles.
struct Parts<T> {
    triangles: T,
    parts: Vec<Part>,
}

struct Part {
    triangle: u32,
    corners: [Vec3; 3],
    leaf: Aabb,
}

impl<T: Fn(u32) -> Vec<(u32, [Vec3; 3])>> Leaf for Parts<T> {
    fn check(
        &mut self,
        value: u32,
        leaf: &Aabb,
        seen: &mut [bool],
        report: &mut ValidationReport,
    ) -> Result<Aabb, BvhDefect> {
        let triangles = (self.triangles)(value);
        for (i, &(triangle, corners)) in triangles.iter().enumerate() {
            let seen = seen.get_mut(triangle as usize).ok_or(BvhDefect::Foreign(triangle))?;
            if triangles[..i].iter().any(|&(other, _)| other == triangle) {
                return Err(BvhDefect::Repeated(triangle));
            }
            if Aabb::of_points(corners).intersection(*leaf).is_empty() {
                return Err(BvhDefect::Foreign(triangle));
            }
            report.primitives += usize::from(!std::mem::replace(seen, true));
            report.references += 1;
            self.parts.push(Part { triangle, corners, leaf: *leaf });
        }
        Ok(*leaf)
    }
}

/// Checks that the leaves of a triangle hold the same one, and points all over it.
fn check_cover(parts: &[Part]) -> Result<(), BvhDefect> {
    const STEPS: u32 = 12;
    let Part { triangle, corners, .. } = parts[0];
    if parts.iter().any(|part| part.corners != corners) {
        return Err(BvhDefect::Foreign(triangle));
    }
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let error = 4.0 * f64::EPSILON * a.abs().max(b.abs()).max(c.abs());
    for i in 0..=STEPS {
        for j in 0..=STEPS - i {
            let [u, v] = [i, j].map(|x| f64::from(x) / f64::from(STEPS));
            let point = a * (1.0 - u - v) + b * u + c * v;
            let held = parts.iter().any(|part| {
                (part.leaf.lower.as_dvec3() - error).cmple(point).all()
                    && point.cmple(part.leaf.upper.as_dvec3() + error).all()
            });
            if !held {
                return Err(BvhDefect::NotCovered(triangle));
            }
        }
    }
    Ok(())
}

const NODE_HALF_LINES: usize = size_of::<Node8>() / 32;

fn bad_reference(node: u32, slot: usize) -> BvhDefect {
    BvhDefect::BadReference { node, slot: slot as u32 }
}

struct Walk<'a, L> {
    tree: &'a Bvh8,
    leaf_half_lines: usize,
    leaf: L,
    seen: Vec<bool>,
    used: Vec<bool>,
    report: ValidationReport,
    /// Of all nodes and leaves but the root.
    area: f64,
}

impl<L: Leaf> Walk<'_, L> {
    /// Marks what a node or leaf takes as used; fails if it does not exist or already is.
    fn claim(&mut self, reference: Reference) -> Result<(), ()> {
        let value = reference.value();
        let (at, count) = match (self.tree.is_compressed(), reference.is_leaf()) {
            (true, true) => (value >> 2, (value & 3) as usize + 1),
            (true, false) => (value >> 2, NODE_UNITS),
            (false, true) => (value, self.leaf_half_lines),
            (false, false) if !value.is_multiple_of(2) => return Err(()),
            (false, false) => (value, NODE_HALF_LINES),
        };
        let lines = self.used.get_mut(at as usize..at as usize + count).ok_or(())?;
        if lines.contains(&true) {
            return Err(());
        }
        lines.fill(true);
        Ok(())
    }

    /// Checks a node and all below it, which counts `within` a box; returns the box around the
    /// primitives there.
    fn node(
        &mut self,
        reference: Reference,
        within: &Aabb,
        depth: usize,
    ) -> Result<Aabb, BvhDefect> {
        let at = reference.value();
        if depth > MAX_DEPTH {
            return Err(BvhDefect::TooDeep { depth, limit: MAX_DEPTH });
        }
        self.report.nodes += 1;
        self.report.depth = self.report.depth.max(depth);
        let node = self.tree.node(reference);
        let compressed = self.tree.is_compressed();
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
            // Quantised boxes may stick out of those above.
            let inside = if compressed { bounds.intersection(*within) } else { bounds };
            let below = if child.is_leaf() {
                self.leaf(at, slot, child, &inside)?
            } else {
                if self.claim(child).is_err() {
                    return Err(bad_reference(at, slot));
                }
                self.node(child, &inside, depth + 1)?
            };
            if !encloses(self.tree, &bounds, &below) {
                return Err(BvhDefect::NotEnclosing { node: at, slot: slot as u32 });
            }
            all = all.union(below);
        }
        Ok(all)
    }

    fn leaf(
        &mut self,
        node: u32,
        slot: usize,
        leaf: Reference,
        bounds: &Aabb,
    ) -> Result<Aabb, BvhDefect> {
        let value = leaf.value();
        let claimed = if self.leaf_half_lines == 0 {
            (value as usize) < self.seen.len()
        } else {
            self.claim(leaf).is_ok()
        };
        if !claimed {
            return Err(bad_reference(node, slot));
        }
        self.report.leaves += 1;
        self.leaf.check(value, bounds, &mut self.seen, &mut self.report)
    }
}
