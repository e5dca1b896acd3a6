//! Refitting where triangles moved, and nowhere else.
//!
//! After Haines, Hoffman, Akenine-Möller, "Real-Time Rendering", 4th edition, chapter 26: the box of a
//! leaf whose triangles moved grows until it holds them, then that of its parent, and so on, as long as
//! a box does not hold its child. No box shrinks.
//!
//! Changed: only the lanes of the triangles that moved are written. After spatial splits each leaf of a
//! triangle grows to the whole of it.

use glam::Vec3;
use rayburst_math::Aabb;
use rayburst_simd::Triangles4;

use super::{RefitReport, block_mut, node_mut};
use crate::{
    Blas, BuildError, TriangleMesh,
    blas::NO_BLOCK,
    build::{primitives::check_triangle, triangle_keys::hittable},
    layout::{
        arena::Line,
        bvh8::{Bvh8, Node8, Reference},
        curve_leaves::Bounds,
        triangles::{BLOCK, TriangleId},
    },
};

/// The ways up a tree.
#[derive(Clone, Debug)]
pub(crate) struct Links {
    /// For the line where a node or a leaf starts, the line of the node above.
    parents: Vec<u32>,
    /// A triangle and a leaf of it, where it is in several: all but the one that is known anyway.
    others: Vec<(u32, u32)>,
}

impl Links {
    /// Of a tree, given the leaf that is known of each triangle, and the triangles of leaves.
    pub(crate) fn new<T: Iterator<Item = u32>>(
        tree: &Bvh8,
        known: &[u32],
        triangles: impl Fn(u32) -> T,
    ) -> Self {
        let mut parents = vec![0; tree.extent() / 2];
        let mut others = vec![];
        let mut stack = vec![Reference::ROOT];
        while let Some(node) = stack.pop() {
            for child in tree.node(node).children.into_iter().filter(|&c| c != Reference::NONE) {
                // Leaves are longer than a line, so no two start in the same.
                parents[child.value() as usize / 2] = node.value() / 2;
                if child.is_leaf() {
                    let leaf = child.value();
                    let elsewhere = |&triangle: &u32| known[triangle as usize] != leaf;
                    others.extend(triangles(leaf).filter(elsewhere).map(|t| (t, leaf)));
                } else {
                    stack.push(child);
                }
            }
        }
        others.sort_unstable();
        Self { parents, others }
    }

    /// The leaves of a triangle but the known one.
    fn others(&self, triangle: u32) -> impl Iterator<Item = u32> {
        let first = self.others.partition_point(|&(other, _)| other < triangle);
        let own = self.others[first..].iter().take_while(move |&&(other, _)| other == triangle);
        own.map(|&(_, leaf)| leaf)
    }
}

/// A triangle in a leaf to be written; leaves in the order of the memory.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    leaf: u32,
    triangle: u32,
    /// Whether it is the leaf that is known of the triangle, so that each is counted once.
    is_known: bool,
}

/// What changes in the counts.
#[derive(Default)]
struct Difference {
    area: f64,
    changed: usize,
    vanished: usize,
    returned: usize,
}

impl Blas {
    /// Moves some triangles, given by geometry and primitive, to new places; all others must be where
    /// they were. This is faster than [`Blas::refit`] where few move, but boxes only grow: the more
    /// often it is called, the slower rays become. A call of [`Blas::refit`] makes all boxes tight
    /// again.
    ///
    /// Geometries are as for [`Blas::refit`], and so are triangles that can no longer be hit, come back,
    /// or cannot; nothing is changed if there is an error. The box and the costs in the report are those
    /// of the grown boxes. The first call makes an index, of about eight bytes a triangle.
    pub fn refit_changed(
        &mut self,
        geometries: &[TriangleMesh<'_>],
        changed: &[(u32, u32)],
    ) -> Result<RefitReport, BuildError> {
        self.check_layout()?;
        self.check_counts(geometries)?;
        let (blocks, links) = self.take_links();
        let report = self.places(geometries, changed, &blocks, &links);
        let report = report.map(|places| self.grow(geometries, &places, &links));
        self.keep_links(blocks, links);
        report
    }

    /// Where some triangles are written, once all are known to be fit for it.
    fn places(
        &self,
        geometries: &[TriangleMesh<'_>],
        changed: &[(u32, u32)],
        blocks: &[u32],
        links: &Links,
    ) -> Result<Vec<Place>, BuildError> {
        let mut places = Vec::with_capacity(changed.len());
        for &(geometry, primitive) in changed {
            let triangle = self.number(geometry, primitive);
            let triangle = triangle.ok_or(BuildError::NoSuchTriangle { geometry, primitive })?;
            let mesh = &geometries[geometry as usize];
            check_triangle(geometry as usize, mesh, primitive as usize)?;
            let leaf = blocks[triangle as usize];
            if leaf != NO_BLOCK {
                places.push(Place { leaf, triangle, is_known: true });
                let others = links.others(triangle);
                places.extend(others.map(|leaf| Place { leaf, triangle, is_known: false }));
            } else if hittable(mesh.triangle(primitive as usize)).is_some() {
                return Err(BuildError::Reappeared { geometry, primitive });
            }
        }
        places.sort_unstable();
        places.dedup();
        Ok(places)
    }

    /// Writes triangles and makes boxes hold them.
    fn grow(
        &mut self,
        geometries: &[TriangleMesh<'_>],
        places: &[Place],
        links: &Links,
    ) -> RefitReport {
        let mut difference = Difference::default();
        let mut bounds = self.tree.bounds;
        let root_before = f64::from(bounds.half_area());
        for places in places.chunk_by(|a, b| a.leaf == b.leaf) {
            let mut moved = Bounds::EMPTY;
            for place in places {
                let (geometry, primitive) = self.locate(place.triangle);
                let corners = geometries[geometry as usize].triangle(primitive as usize);
                let corners = hittable(corners);
                if let Some([a, b, c]) = corners {
                    moved.grow(a.min(b).min(c), a.max(b).max(c));
                }
                let (lines, _) = self.tree.lines_mut();
                let was_there =
                    write(block_mut(lines, place.leaf as usize), place.triangle, corners);
                let is_there = corners.is_some();
                difference.vanished += usize::from(place.is_known && was_there && !is_there);
                difference.returned += usize::from(place.is_known && !was_there && is_there);
            }
            let moved = if moved.is_empty() { Aabb::EMPTY } else { moved.aabb() };
            let (lines, _) = self.tree.lines_mut();
            if grow_boxes(lines, places[0].leaf, &moved, links, &mut difference) {
                bounds = bounds.union(moved);
            }
        }
        let (tree, _, stats) = self.parts();
        let boxes_changed = difference.changed + usize::from(bounds != tree.bounds);
        let area = f64::from(stats.sah_cost) * root_before + difference.area;
        let root = f64::from(bounds.half_area());
        let sah_after = (area + root - root_before) / root.max(f64::MIN_POSITIVE);
        let sah_after = if bounds.is_empty() { 0.0 } else { sah_after as f32 };
        tree.bounds = bounds;
        tree.loose |= !places.is_empty();
        tree.shape.sah_cost = sah_after;
        stats.primitives = stats.primitives + difference.returned - difference.vanished;
        stats.inactive = stats.inactive + difference.vanished - difference.returned;
        let sah_before = std::mem::replace(&mut stats.sah_cost, sah_after);
        RefitReport { bounds, sah_before, sah_after, boxes_changed }
    }
}

/// Writes a triangle of a leaf, NaN if it cannot be hit; returns whether it could be hit before.
fn write(block: &mut Triangles4, triangle: u32, corners: Option<[glam::Vec4; 3]>) -> bool {
    let is_own = |&lane: &usize| TriangleId::of_lane(block, lane).triangle() == triangle;
    let Some(lane) = (0..BLOCK).find(is_own) else { return false };
    let was_there = !block.vertices[0][0][lane].is_nan();
    let corners = corners.map_or([Vec3::NAN; 3], |corners| corners.map(|p| p.truncate()));
    for (rows, corner) in block.vertices.iter_mut().zip(corners) {
        for axis in 0..3 {
            rows[axis][lane] = corner[axis];
        }
    }
    was_there
}

/// Makes the box of a leaf, and those above it, hold another; returns whether those of the root's
/// children had to grow.
fn grow_boxes(
    lines: &mut [Line],
    leaf: u32,
    moved: &Aabb,
    links: &Links,
    difference: &mut Difference,
) -> bool {
    let mut child = Reference::leaf(leaf);
    loop {
        let parent = links.parents[child.value() as usize / 2];
        let node = node_mut(lines, parent as usize);
        let Some(slot) = node.children.iter().position(|&other| other == child) else {
            return false;
        };
        let old = box_of(node, slot);
        if old.contains_box(moved) {
            return false;
        }
        let new = old.union(*moved);
        for axis in 0..3 {
            node.boxes.planes[2 * axis][slot] = new.lower[axis];
            node.boxes.planes[2 * axis + 1][slot] = new.upper[axis];
        }
        difference.changed += 1;
        difference.area += f64::from(new.half_area()) - f64::from(old.half_area());
        child = Reference::node(parent);
        if child == Reference::ROOT {
            return true;
        }
    }
}

fn box_of(node: &Node8, slot: usize) -> Aabb {
    let planes = node.boxes.planes.map(|row| row[slot]);
    Aabb {
        lower: Vec3::new(planes[0], planes[2], planes[4]),
        upper: Vec3::new(planes[1], planes[3], planes[5]),
    }
}
