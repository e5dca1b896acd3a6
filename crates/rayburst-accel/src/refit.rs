//! Refitting: new vertices in an old tree.
//!
//! All boxes are recomputed from their children, bottom-up, as tight as they can be in the old tree
//! (Haines, Hoffman, Akenine-Möller, "Real-Time Rendering", 4th edition, chapter 26). The cost by the
//! surface area heuristic before and after tells when a rebuild pays.
//!
//! Changed: works on the wide nodes and leaves in place. The memory of a subtree is contiguous, so
//! subtrees are refitted in parallel; sums are added in the order of the tree, whatever the threads.

use glam::Vec4;
use rayburst_math::Aabb;
use rayburst_simd::Triangles4;
use rayon::prelude::*;

use crate::{
    Blas, BuildError, TriangleMesh,
    build::{primitives::check_indices, triangle_keys::hittable},
    layout::{
        arena::Line,
        bvh8::{NODE_LINES, Node8, Reference},
        morton8::{Bounds, transpose},
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

impl Blas {
    /// Moves the triangles to new places: the geometries must have as many triangles as those that
    /// the structure was built from, and should have the same vertices for each. Geometries keep
    /// the opacity of the build.
    ///
    /// A triangle that can no longer be hit (not finite, too large, zero area) is missed until
    /// another refit brings it back. One that could not be hit when the structure was *built* is not
    /// in it, so it is an error, after which the structure is as before, if it can be hit now.
    pub fn refit(&mut self, geometries: &[TriangleMesh<'_>]) -> Result<RefitReport, BuildError> {
        self.check_topology(geometries)?;
        let count = self.geometry_count();
        let (tree, starts, _) = self.parts();
        let mut refit = Refit { geometries, starts: &starts[..count], geometry: 0 };
        let done = refit.node(tree.lines_mut(), 0, 0);
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
        let mut node: Node8 = bytemuck::cast_slice(&lines[..NODE_LINES])[0];
        let inner = |child: Reference| child != Reference::NONE && !child.is_leaf();
        let slots: [usize; 8] = std::array::from_fn(|slot| slot);
        let mut own_lines = lines.len();
        for child in node.children.into_iter().filter(|&child| inner(child)) {
            own_lines = own_lines.min((child.value() / 2) as usize - at);
        }
        let (own, mut rest) = lines.split_at_mut(own_lines);
        let mut done = Done { bounds: Bounds::EMPTY, area: 0.0, changed: 0, hidden: 0 };
        let mut below = [const { None }; 8];
        if level < PARALLEL_LEVELS {
            let mut subtrees = Vec::with_capacity(8);
            let mut slots: Vec<usize> =
                slots.into_iter().filter(|&slot| inner(node.children[slot])).collect();
            slots.sort_unstable_by_key(|&slot| node.children[slot].value());
            for (i, &slot) in slots.iter().enumerate() {
                let start = (node.children[slot].value() / 2) as usize;
                let end = slots.get(i + 1).map(|&s| (node.children[s].value() / 2) as usize);
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
        }
        let rest_at = at + own_lines;
        let words: &mut [u32] = bytemuck::cast_slice_mut(own);
        for slot in slots {
            let child = node.children[slot];
            if child == Reference::NONE {
                continue;
            }
            let bounds = if child.is_leaf() {
                let first = (child.value() as usize - 2 * at) * 8;
                let words = &mut words[first..first + size_of::<Triangles4>() / 4];
                let (bounds, hidden) = self.leaf(words);
                done.area += f64::from(bounds.half_area().max(0.0));
                done.hidden += hidden;
                bounds
            } else {
                let result = below[slot].take().unwrap_or_else(|| {
                    // Nodes further on in the memory are not touched.
                    let start = (child.value() / 2) as usize;
                    self.node(&mut rest[start - rest_at..], start, level + 1)
                });
                done.area += result.area;
                done.changed += result.changed;
                done.hidden += result.hidden;
                result.bounds
            };
            let mut changed = false;
            for axis in 0..3 {
                for (side, plane) in [bounds.lower[axis], bounds.upper[axis]].iter().enumerate() {
                    let old = &mut node.boxes.planes[2 * axis + side][slot];
                    changed |= *old != *plane;
                    *old = *plane;
                }
            }
            done.changed += usize::from(changed);
            done.bounds.grow(bounds.lower, bounds.upper);
        }
        done.area += f64::from(done.bounds.half_area().max(0.0));
        own[..NODE_LINES].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&node)));
        done
    }

    /// Writes a leaf's triangles anew; returns its box and how many of them cannot be hit.
    #[inline(always)]
    fn leaf(&mut self, words: &mut [u32]) -> (Bounds, usize) {
        let old: &mut Triangles4 = &mut bytemuck::cast_slice_mut(words)[0];
        let mut corners = [[Vec4::NAN; BLOCK]; 3];
        let ids: [TriangleId; BLOCK] = std::array::from_fn(|lane| TriangleId::of_lane(old, lane));
        let (mut bounds, mut hidden) = (Bounds::EMPTY, 0);
        for lane in 0..BLOCK {
            if ids[lane] == TriangleId::NONE {
                break;
            }
            let triangle = ids[lane].triangle();
            let is_in = |geometry: usize| {
                self.starts[geometry] <= triangle
                    && self.starts.get(geometry + 1).is_none_or(|&next| triangle < next)
            };
            if !is_in(self.geometry) {
                self.geometry = self.starts.partition_point(|&start| start <= triangle) - 1;
            }
            let mesh = &self.geometries[self.geometry];
            let primitive = (triangle - self.starts[self.geometry]) as usize;
            match hittable(mesh.triangle(primitive)) {
                Some(own) => {
                    let [a, b, c] = own;
                    bounds.grow(a.min(b).min(c), a.max(b).max(c));
                    for (lanes, corner) in corners.iter_mut().zip(own) {
                        lanes[lane] = corner;
                    }
                }
                None => hidden += 1,
            }
        }
        *old = transpose(&corners, ids);
        (bounds, hidden)
    }
}
