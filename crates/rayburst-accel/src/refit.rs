//! Refitting: new vertices in an old tree.
//!
//! All boxes are recomputed from their children, bottom-up, as tight as they can be in the old tree
//! (Haines, Hoffman, Akenine-Möller, "Real-Time Rendering", 4th edition, chapter 26). The cost by the
//! surface area heuristic before and after tells when a rebuild pays.
//!
//! Changed: works on the wide nodes and leaves in place. The memory of a subtree is contiguous, so
//! subtrees are refitted in parallel; sums are added in the order of the tree, whatever the threads.
//! Of trees whose nodes above clusters are apart, first the clusters are refitted, then the nodes above
//! in reverse order.

use glam::{Vec3, Vec4};
use rayburst_math::Aabb;
use rayburst_simd::Triangles4;
use rayon::prelude::*;

use crate::{
    Blas, BuildError, MAX_COORDINATE, TriangleMesh,
    build::{
        primitives::check_indices,
        triangle_keys::{AREA_ERROR, hittable},
    },
    layout::{
        arena::Line,
        bvh8::{NODE_LINES, Node8, Reference},
        curve_leaves::{Bounds, transpose},
        triangles::{BLOCK, TriangleId},
    },
};

/// What a refit did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitReport {
    /// The box around all triangles that can be hit.
    pub bounds: Aabb,
    /// Cost by the surface area heuristic before, as in [`crate::BuildStats::sah_cost`].
    pub sah_before: f32,
    /// The same after.
    pub sah_after: f32,
    /// Boxes of nodes and leaves that are not what they were.
    pub boxes_changed: usize,
}

/// How many levels from the root are worked on by several tasks.
const PARALLEL_LEVELS: usize = 3;
/// Clusters that are refitted by one task.
const CLUSTERS: usize = 256;

impl Blas {
    /// Moves the triangles to new places: the geometries must have as many triangles as those that
    /// the structure was built from, and should have the same vertices for each. Geometries keep
    /// the opacity of the build.
    ///
    /// A triangle that can no longer be hit (not finite, too large, zero area) is missed until
    /// another refit brings it back. One that could not be hit when the structure was *built* is not
    /// in it, so it is an error, after which the structure is as before, if it can be hit now.
    pub fn refit(&mut self, geometries: &[TriangleMesh<'_>]) -> Result<RefitReport, BuildError> {
        if self.tree.is_compressed() {
            return Err(BuildError::CompressedRefit);
        }
        self.check_topology(geometries)?;
        let count = self.geometry_count();
        let (tree, starts, _) = self.parts();
        let mut refit = Refit { geometries, starts: &starts[..count], geometry: 0 };
        let done = match tree.lines_mut() {
            (lines, None) => refit.node(lines, 0, 0),
            (lines, Some(above)) => refit.clusters(lines, above),
        };
        let bounds = if done.bounds.lower.x <= done.bounds.upper.x {
            done.bounds.aabb()
        } else {
            Aabb::EMPTY
        };
        let root = f64::from(bounds.half_area()).max(f64::MIN_POSITIVE);
        let sah_after = if bounds.is_empty() { 0.0 } else { (done.area / root) as f32 };
        let boxes_changed = done.changed + usize::from(tree.bounds != bounds);
        tree.bounds = bounds;
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

    fn check_topology(&self, geometries: &[TriangleMesh<'_>]) -> Result<(), BuildError> {
        if geometries.len() != self.geometry_count() {
            return Err(BuildError::GeometriesDiffer {
                built: self.geometry_count(),
                given: geometries.len(),
            });
        }
        for (geometry, mesh) in geometries.iter().enumerate() {
            let built = self.triangle_count(geometry);
            if mesh.indices.len() != built {
                let (geometry, given) = (geometry as u32, mesh.indices.len());
                return Err(BuildError::TrianglesDiffer { geometry, built, given });
            }
            check_indices(geometry, mesh)?;
        }
        for &triangle in self.absent() {
            let (geometry, primitive) = self.locate(triangle);
            if hittable(geometries[geometry as usize].triangle(primitive as usize)).is_some() {
                return Err(BuildError::Reappeared { geometry, primitive });
            }
        }
        Ok(())
    }
}

/// What the refit of a subtree gives.
struct Done {
    bounds: Bounds,
    /// Of all nodes and leaves.
    area: f64,
    changed: usize,
    /// Lanes whose triangle cannot be hit.
    hidden: usize,
}

impl Done {
    /// Adds what is below a child, except for the box, which it returns.
    fn add(&mut self, child: Self) -> Bounds {
        self.area += child.area;
        self.changed += child.changed;
        self.hidden += child.hidden;
        child.bounds
    }
}

/// Sets a child's box and adds it to the node's.
#[inline(always)]
fn set_box(node: &mut Node8, slot: usize, bounds: &Bounds, done: &mut Done) {
    let mut changed = false;
    for axis in 0..3 {
        for (side, plane) in [bounds.lower[axis], bounds.upper[axis]].into_iter().enumerate() {
            let old = &mut node.boxes.planes[2 * axis + side][slot];
            changed |= *old != plane;
            *old = plane;
        }
    }
    done.changed += usize::from(changed);
    done.bounds.grow(bounds.lower, bounds.upper);
}

#[derive(Clone, Copy)]
struct Refit<'a> {
    geometries: &'a [TriangleMesh<'a>],
    starts: &'a [u32],
    /// The geometry of the last triangle.
    geometry: usize,
}

impl Refit<'_> {
    /// Refits the subtree of a node that starts `at` lines from the start of the structure, given its
    /// lines.
    fn node(&mut self, lines: &mut [Line], at: usize, level: usize) -> Done {
        if level == PARALLEL_LEVELS {
            return self.subtree(lines, at);
        }
        let mut node: Node8 = bytemuck::cast_slice(&lines[..NODE_LINES])[0];
        let inner = |child: Reference| child != Reference::NONE && !child.is_leaf();
        let mut own_lines = lines.len();
        for child in node.children.into_iter().filter(|&child| inner(child)) {
            own_lines = own_lines.min((child.value() / 2) as usize - at);
        }
        let (own, mut rest) = lines.split_at_mut(own_lines);
        let mut done = Done { bounds: Bounds::EMPTY, area: 0.0, changed: 0, hidden: 0 };
        let mut below = [const { None }; 8];
        let mut subtrees = Vec::with_capacity(8);
        let mut order: Vec<usize> = (0..8).filter(|&slot| inner(node.children[slot])).collect();
        order.sort_unstable_by_key(|&slot| node.children[slot].value());
        for (i, &slot) in order.iter().enumerate() {
            let start = (node.children[slot].value() / 2) as usize;
            let end = order.get(i + 1).map(|&next| (node.children[next].value() / 2) as usize);
            let size = end.map_or(rest.len(), |end| end - start);
            let (subtree, others) = rest.split_at_mut(size);
            subtrees.push((slot, start, subtree));
            rest = others;
        }
        let this = *self;
        let results: Vec<(usize, Done)> = subtrees
            .into_par_iter()
            .map(|(slot, start, lines)| (slot, { this }.node(lines, start, level + 1)))
            .collect();
        for (slot, result) in results {
            below[slot] = Some(result);
        }
        let words: &mut [u32] = bytemuck::cast_slice_mut(own);
        for slot in 0..8 {
            let child = node.children[slot];
            let bounds = if child == Reference::NONE {
                continue;
            } else if child.is_leaf() {
                self.leaf_of(words, at, child, &mut done)
            } else if let Some(result) = below[slot].take() {
                done.add(result)
            } else {
                continue;
            };
            set_box(&mut node, slot, &bounds, &mut done);
        }
        done.area += f64::from(done.bounds.half_area().max(0.0));
        own[..NODE_LINES].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&node)));
        done
    }

    /// Refits all clusters, then all nodes above, which start at some line, parents first.
    fn clusters(&mut self, lines: &mut [Line], above: usize) -> Done {
        let (others, own) = lines.split_at_mut(above);
        let (root, clusters) = others.split_at_mut(NODE_LINES);
        let nodes: &mut [Node8] = bytemuck::cast_slice_mut(own);
        let root: &mut Node8 = &mut bytemuck::cast_slice_mut(root)[0];
        let line = |child: Reference| (child.value() / 2) as usize;
        let is_item = |child: Reference| child != Reference::NONE && line(child) < above;
        // Clusters in the order of the memory; the root counts as the last node.
        let mut items: Vec<(Reference, u32)> = Vec::new();
        for (number, node) in nodes.iter().chain(std::iter::once(&*root)).enumerate() {
            let children = node.children.into_iter().zip(8 * number as u32..);
            items.extend(children.filter(|&(child, _)| is_item(child)));
        }
        items.par_sort_unstable_by_key(|&(child, _)| child.value());
        let mut tasks = Vec::with_capacity(items.len() / CLUSTERS + 1);
        let mut rest = clusters;
        for items in items.chunks(CLUSTERS).rev() {
            let first = line(items[0].0);
            let (before, own) = rest.split_at_mut(first - NODE_LINES);
            tasks.push((items, first, own));
            rest = before;
        }
        let count = nodes.len();
        let this = *self;
        let results: Vec<(Done, Vec<Bounds>)> = tasks
            .into_par_iter()
            .map(|(items, first, lines)| { this }.items(items, first, lines))
            .collect();
        let mut done = Done { bounds: Bounds::EMPTY, area: 0.0, changed: 0, hidden: 0 };
        let mut slots = vec![Bounds::EMPTY; 8 * (count + 1)];
        for (items, (result, bounds)) in items.chunks(CLUSTERS).rev().zip(results) {
            done.add(result);
            for (&(_, slot), bounds) in items.iter().zip(bounds) {
                slots[slot as usize] = bounds;
            }
        }
        let mut boxes = vec![Bounds::EMPTY; count];
        for (number, node) in
            nodes.iter_mut().enumerate().rev().chain(std::iter::once((count, root)))
        {
            done.bounds = Bounds::EMPTY;
            for slot in 0..8 {
                let child = node.children[slot];
                if child != Reference::NONE {
                    let bounds = if is_item(child) {
                        slots[8 * number + slot]
                    } else {
                        boxes[(line(child) - above) / NODE_LINES]
                    };
                    set_box(node, slot, &bounds, &mut done);
                }
            }
            done.area += f64::from(done.bounds.half_area().max(0.0));
            if let Some(own) = boxes.get_mut(number) {
                *own = done.bounds;
            }
        }
        done
    }

    /// Refits clusters, given the lines from that of the first on; returns their boxes, too.
    fn items(
        &mut self,
        items: &[(Reference, u32)],
        first: usize,
        lines: &mut [Line],
    ) -> (Done, Vec<Bounds>) {
        let mut done = Done { bounds: Bounds::EMPTY, area: 0.0, changed: 0, hidden: 0 };
        let mut boxes = Vec::with_capacity(items.len());
        for &(child, _) in items {
            boxes.push(if child.is_leaf() {
                self.leaf_of(bytemuck::cast_slice_mut(lines), first, child, &mut done)
            } else {
                let start = (child.value() / 2) as usize;
                let result = self.subtree(&mut lines[start - first..], start);
                done.add(result)
            });
        }
        (done, boxes)
    }

    /// Refits the subtree of a node on one thread.
    fn subtree(&mut self, lines: &mut [Line], at: usize) -> Done {
        let mut done = Done { bounds: Bounds::EMPTY, area: 0.0, changed: 0, hidden: 0 };
        let children = bytemuck::cast_slice::<Line, Node8>(&lines[..NODE_LINES])[0].children;
        for (slot, child) in children.into_iter().enumerate() {
            let bounds = if child == Reference::NONE {
                continue;
            } else if child.is_leaf() {
                self.leaf_of(bytemuck::cast_slice_mut(lines), at, child, &mut done)
            } else {
                let start = (child.value() / 2) as usize;
                let result = self.subtree(&mut lines[start - at..], start);
                done.add(result)
            };
            let node = &mut bytemuck::cast_slice_mut::<Line, Node8>(&mut lines[..NODE_LINES])[0];
            set_box(node, slot, &bounds, &mut done);
        }
        done.area += f64::from(done.bounds.half_area().max(0.0));
        done
    }

    /// Refits a leaf of the node that starts `at` lines from the start, given the words from there.
    #[inline(always)]
    fn leaf_of(
        &mut self,
        words: &mut [u32],
        at: usize,
        leaf: Reference,
        done: &mut Done,
    ) -> Bounds {
        let first = (leaf.value() as usize - 2 * at) * 8;
        let (bounds, hidden) = self.leaf(&mut words[first..first + size_of::<Triangles4>() / 4]);
        done.area += f64::from(bounds.half_area().max(0.0));
        done.hidden += hidden;
        bounds
    }

    /// Writes a leaf's triangles anew; returns its box and how many of them cannot be hit.
    #[inline(always)]
    fn leaf(&mut self, words: &mut [u32]) -> (Bounds, usize) {
        let block: &mut Triangles4 = &mut bytemuck::cast_slice_mut(words)[0];
        let mut corners = [[Vec4::NAN; BLOCK]; 3];
        let mut bounds = Bounds::EMPTY;
        let ids: [TriangleId; BLOCK] = std::array::from_fn(|lane| TriangleId::of_lane(block, lane));
        let mut used = 0;
        for lane in 0..BLOCK {
            if ids[lane] == TriangleId::NONE {
                break;
            }
            let [a, b, c] = self.corners(ids[lane].triangle()).map(|p| p.extend(0.0));
            bounds.grow(a.min(b).min(c), a.max(b).max(c));
            for (lanes, corner) in corners.iter_mut().zip([a, b, c]) {
                lanes[lane] = corner;
            }
            used += 1;
        }
        *block = transpose(&corners, ids);
        if surely_hittable(block) == (1 << used) - 1 {
            return (bounds, 0);
        }
        self.careful_leaf(block, &ids[..used])
    }

    /// A leaf some of whose triangles might not be hit.
    #[cold]
    fn careful_leaf(&mut self, block: &mut Triangles4, ids: &[TriangleId]) -> (Bounds, usize) {
        let (mut bounds, mut hidden) = (Bounds::EMPTY, 0);
        for (lane, id) in ids.iter().enumerate() {
            match hittable(self.corners(id.triangle())) {
                Some([a, b, c]) => bounds.grow(a.min(b).min(c), a.max(b).max(c)),
                None => {
                    hidden += 1;
                    block.vertices.iter_mut().flatten().for_each(|row| row[lane] = f32::NAN);
                }
            }
        }
        (bounds, hidden)
    }

    /// The corners of a triangle numbered through all geometries.
    #[inline(always)]
    fn corners(&mut self, triangle: u32) -> [Vec3; 3] {
        let is_in = |geometry: usize| {
            self.starts[geometry] <= triangle
                && self.starts.get(geometry + 1).is_none_or(|&next| triangle < next)
        };
        if !is_in(self.geometry) {
            self.geometry = self.starts.partition_point(|&start| start <= triangle) - 1;
        }
        let primitive = triangle - self.starts[self.geometry];
        self.geometries[self.geometry].triangle(primitive as usize)
    }
}

/// The lanes whose triangles can be hit for sure, as [`hittable`] decides; the others may be.
#[inline(always)]
fn surely_hittable(block: &Triangles4) -> u32 {
    let rows = block.vertices.map(|corner| corner.map(Vec4::from_array));
    let limit = Vec4::splat(MAX_COORDINATE);
    let [a, b, c] = rows;
    let largest = |x: [Vec4; 3]| x.map(|row| row.abs().cmple(limit));
    let [la, lb, lc] = [largest(a), largest(b), largest(c)];
    let inside = la[0] & la[1] & la[2] & lb[0] & lb[1] & lb[2] & lc[0] & lc[1] & lc[2];
    let p: [Vec4; 3] = std::array::from_fn(|axis| b[axis] - a[axis]);
    let q: [Vec4; 3] = std::array::from_fn(|axis| c[axis] - a[axis]);
    let has_area = |i: usize, j: usize| {
        let (first, second) = (p[i] * q[j], p[j] * q[i]);
        let error = (first.abs() + second.abs()) * AREA_ERROR.0 + Vec4::splat(AREA_ERROR.1);
        (first - second).abs().cmpgt(error)
    };
    (inside & (has_area(1, 2) | has_area(2, 0) | has_area(0, 1))).bitmask()
}
