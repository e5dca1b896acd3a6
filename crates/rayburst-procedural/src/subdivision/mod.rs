//! Catmull-Clark subdivision surfaces.

mod cage;
mod intersect;
mod limit;
mod mesh;
mod patches;
mod tree;

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::segment::Segment;
use crate::{Shape, ShapeHit};
pub use cage::CageError;
use intersect::Found;
use patches::Patch;
use tree::Tree;

/// The limit surface of Catmull-Clark subdivision of a cage of polygons.
///
/// Edges of one face are sharp creases, and vertices of one face sharp corners, which the surface
/// meets; all else is smooth. The front is where the polygons wind counter-clockwise.
///
/// Where the surface is bicubic it is kept as exact patches, however large; near extraordinary vertices
/// (and polygons that are no quadrilaterals) faces are subdivided `depth` times, and the last faces, of
/// `2^-depth` of the size of the cage's, are patches that meet their neighbours and have the limit
/// points and limit normals at their corners (normals between them are blended). An extraordinary
/// corner of a face costs three patches a level, of 512 bytes each; nothing is made for rays.
///
/// Hits closer together than 10⁻⁸ of the box's diagonal, seen from the same side, are one; two that are
/// nearer to each other than 2⁻²⁶ of a patch, at a silhouette, may be none. Of a ray that lies in a flat
/// part some hits may be missing.
///
/// `uv` of a quadrilateral is the place in it, from its first vertex towards the second and the last.
/// Other polygons have one square a vertex: from that vertex towards the next one's edge and the edge
/// before.
#[derive(Clone, Debug)]
pub struct Subdivision {
    patches: Vec<Patch>,
    normals: Vec<[DVec3; 4]>,
    tree: Tree,
    bounds: Aabb,
    same: f64,
}

impl Subdivision {
    /// How often faces at extraordinary vertices are subdivided if nothing else is said.
    pub const DEPTH: u32 = 8;
    /// The most often.
    pub const MAX_DEPTH: u32 = 16;

    /// The surface of polygons: `sizes` is how many vertices each has, `indices` which ones, one polygon
    /// after another. `depth` counts as from 1 to [`Subdivision::MAX_DEPTH`].
    pub fn new(
        points: &[Vec3],
        sizes: &[u32],
        indices: &[u32],
        depth: u32,
    ) -> Result<Self, CageError> {
        let cage = cage::check(points, sizes, indices)?;
        let (patches, normals) = patches::build(cage, depth.clamp(1, Self::MAX_DEPTH));
        let tree = Tree::new(&patches);
        let (lower, upper) = tree.bounds();
        let bounds = Aabb { lower: lower.as_vec3(), upper: upper.as_vec3() };
        let same = 1e-8 * (upper - lower).length();
        Ok(Self { patches, normals, tree, bounds, same })
    }

    /// How many patches the surface has.
    pub fn patch_count(&self) -> usize {
        self.patches.len()
    }

    fn segment(&self, ray: &Ray) -> Option<Segment> {
        let (lower, upper) = self.tree.bounds();
        Segment::clip(ray, lower, upper)
    }

    fn hit(&self, segment: &Segment, found: &Found) -> ShapeHit {
        let patch = &self.patches[found.patch];
        let normal = patch.normal(&self.normals, found.u, found.v, segment.direction);
        segment.hit(found.s, normal, patch.face_uv(found.u, found.v))
    }
}

impl Shape for Subdivision {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        let Some(segment) = self.segment(ray) else { return };
        let mut after = f64::NEG_INFINITY;
        loop {
            let hits = self.tree.collect(&self.patches, &segment, after, self.same);
            for found in hits.as_slice() {
                if report(self.hit(&segment, found)).is_break() {
                    return;
                }
            }
            match hits.as_slice().last() {
                // There may be more than fitted.
                Some(last) if hits.is_full() => after = last.s + self.same,
                _ => return,
            }
        }
    }

    fn nearest(&self, ray: &Ray) -> Option<ShapeHit> {
        let segment = self.segment(ray)?;
        self.tree.nearest(&self.patches, &segment).map(|found| self.hit(&segment, &found))
    }
}
