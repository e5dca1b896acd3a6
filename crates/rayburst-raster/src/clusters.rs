//! Meshes cut into clusters: a few triangles that are near each other, with their own vertices and a box.
//!
//! Triangles are sorted along a Morton curve through their centres (Morton, "A computer oriented geodetic
//! data base", 1966); each run of [`CLUSTER`] is a cluster. What is outside of the picture or hidden is
//! skipped cluster by cluster, before a vertex is touched.

use glam::{Affine3A, UVec3, Vec3, Vec4};
use rayburst_math::Aabb;
use rayburst_simd::Isa;

/// Triangles of a cluster.
pub(crate) const CLUSTER: usize = 64;
/// Vertices that a cluster may have.
pub(crate) const CLUSTER_VERTICES: usize = 3 * CLUSTER;
/// Triangles with larger coordinates are inactive, as for rays.
const MAX_COORDINATE: f32 = (1u64 << 60) as f32;
/// In place of a slot: the triangle is inactive.
const INACTIVE: u32 = u32::MAX;

/// A mesh prepared for the rasteriser, to be kept as long as its vertices stay where they are. Triangles with
/// a coordinate that is not finite or beyond 2⁶⁰, or with an index out of range, are inactive: never seen.
#[derive(Clone, Debug, Default)]
pub struct Clusters {
    pub(crate) clusters: Vec<Cluster>,
    pub(crate) vertices: Vec<Vec4>,
    /// The mesh's vertex that each of `vertices` copies.
    sources: Vec<u32>,
    pub(crate) triangles: Vec<ClusterTriangle>,
    /// Where each primitive is in `triangles`.
    slots: Vec<u32>,
    bounds: Aabb,
}

/// Some triangles near each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cluster {
    /// The box: its centre and half its size.
    pub(crate) centre: Vec3,
    pub(crate) half: Vec3,
    pub(crate) first_vertex: u32,
    pub(crate) vertex_count: u32,
    pub(crate) triangle_count: u32,
}

/// A triangle: the cluster's vertices at its corners, and which of the mesh it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClusterTriangle {
    pub(crate) corners: [u8; 4],
    pub(crate) primitive: u32,
}

impl Clusters {
    /// Cuts a mesh into clusters; `transform` (DXR's per-geometry transform) is applied to positions first.
    pub fn new(positions: &[Vec3], indices: &[[u32; 3]], transform: Option<Affine3A>) -> Self {
        let place = |p: Vec3| transform.map_or(p, |t| t.transform_point3(p));
        let positions: Vec<Vec3> = positions.iter().map(|&p| place(p)).collect();
        let usable: Vec<bool> = positions.iter().map(|p| is_usable(*p)).collect();
        let active = |corners: &[u32; 3]| {
            corners.iter().all(|&i| usable.get(i as usize).copied().unwrap_or(false))
        };
        let centre = |corners: &[u32; 3]| {
            corners.iter().map(|&i| positions[i as usize] * (1.0 / 3.0)).sum::<Vec3>()
        };
        let in_order = || indices.iter().zip(0u32..).filter(|(corners, _)| active(corners));
        let centres = Aabb::of_points(in_order().map(|(corners, _)| centre(corners)));
        let scale = 1023.0 / centres.extent().max_element().max(f32::MIN_POSITIVE);
        let mut order: Vec<(u32, u32)> = in_order()
            .map(|(corners, primitive)| {
                (morton((centre(corners) - centres.lower) * scale), primitive)
            })
            .collect();
        order.sort_unstable();

        let mut this = Self { slots: vec![INACTIVE; indices.len()], ..Self::default() };
        this.triangles.reserve(order.len());
        // The cluster that last used a vertex, and where the vertex is in it.
        let mut used = vec![(0u32, 0u8); positions.len()];
        for (run, number) in order.chunks(CLUSTER).zip(1u32..) {
            let first_vertex = this.vertices.len();
            for &(_, primitive) in run {
                let mut corners = [0; 4];
                for (corner, &index) in corners.iter_mut().zip(&indices[primitive as usize]) {
                    let (cluster, place) = &mut used[index as usize];
                    if *cluster != number {
                        (*cluster, *place) = (number, (this.vertices.len() - first_vertex) as u8);
                        this.vertices.push(positions[index as usize].extend(0.0));
                        this.sources.push(index);
                    }
                    *corner = *place;
                }
                this.slots[primitive as usize] = this.triangles.len() as u32;
                this.triangles.push(ClusterTriangle { corners, primitive });
            }
            this.clusters.push(Cluster {
                centre: Vec3::ZERO,
                half: Vec3::ZERO,
                first_vertex: first_vertex as u32,
                vertex_count: (this.vertices.len() - first_vertex) as u32,
                triangle_count: run.len() as u32,
            });
        }
        this.find_boxes();
        this
    }

    /// Moves the vertices and keeps the clusters, which should stay as compact as they were. Fails, and
    /// changes nothing, if there are not as many vertices, or one is not finite or beyond 2⁶⁰: then a new
    /// start is needed.
    #[must_use]
    pub fn refit(&mut self, positions: &[Vec3], transform: Option<Affine3A>) -> bool {
        let place = |p: Vec3| transform.map_or(p, |t| t.transform_point3(p));
        let found =
            |&source: &u32| positions.get(source as usize).is_some_and(|p| is_usable(place(*p)));
        if self.slots.contains(&INACTIVE) || !self.sources.iter().all(found) {
            return false;
        }
        for (vertex, &source) in self.vertices.iter_mut().zip(&self.sources) {
            *vertex = place(positions[source as usize]).extend(0.0);
        }
        self.find_boxes();
        true
    }

    fn find_boxes(&mut self) {
        self.bounds = Aabb::EMPTY;
        for cluster in &mut self.clusters {
            let first = cluster.first_vertex as usize;
            let (mut lower, mut upper) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
            for &vertex in &self.vertices[first..][..cluster.vertex_count as usize] {
                (lower, upper) = (lower.min(vertex), upper.max(vertex));
            }
            let bounds = Aabb { lower: lower.truncate(), upper: upper.truncate() };
            cluster.centre = 0.5 * bounds.lower + 0.5 * bounds.upper;
            // Both differences, as the centre is rounded.
            cluster.half = (bounds.upper - cluster.centre).max(cluster.centre - bounds.lower);
            self.bounds = self.bounds.union(bounds);
        }
    }

    /// Asks for a cluster's vertices and triangles.
    #[inline(always)]
    pub(crate) fn prefetch<I: Isa>(&self, isa: I, index: usize) {
        let Some(cluster) = self.clusters.get(index) else { return };
        let first = cluster.first_vertex as usize;
        let last = first + cluster.vertex_count as usize;
        // Four vertices a line of the cache, or eight triangles.
        let mut vertex = first;
        while vertex < last {
            isa.prefetch(&raw const self.vertices[vertex]);
            vertex += 4;
        }
        let mut triangle = index * CLUSTER;
        while triangle < self.triangles.len().min((index + 1) * CLUSTER) {
            isa.prefetch(&raw const self.triangles[triangle]);
            triangle += 8;
        }
    }

    /// The box around all active triangles; empty if there are none.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Triangles of the mesh, inactive ones included.
    pub fn primitive_count(&self) -> u32 {
        self.slots.len() as u32
    }

    /// The corners of a triangle; `None` if it is inactive or there is no such primitive.
    #[inline]
    pub fn triangle(&self, primitive: u32) -> Option<[Vec3; 3]> {
        let slot = *self.slots.get(primitive as usize)? as usize;
        let triangle = self.triangles.get(slot)?;
        let cluster = &self.clusters[slot / CLUSTER];
        let vertices = &self.vertices[cluster.first_vertex as usize..];
        let [a, b, c, _] = triangle.corners;
        Some([a, b, c].map(|corner| vertices[usize::from(corner)].truncate()))
    }
}

/// Whether triangles with this vertex can be seen.
fn is_usable(p: Vec3) -> bool {
    p.is_finite() && p.abs().max_element() <= MAX_COORDINATE
}

/// Interleaves the lowest ten bits of whole parts.
fn morton(p: Vec3) -> u32 {
    let spread = |x: u32| {
        let x = (x | x << 16) & 0x0300_00FF;
        let x = (x | x << 8) & 0x0300_F00F;
        let x = (x | x << 4) & 0x030C_30C3;
        (x | x << 2) & 0x0924_9249
    };
    let p: UVec3 = p.clamp(Vec3::ZERO, Vec3::splat(1023.0)).as_uvec3();
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

#[cfg(test)]
mod tests {
    use rayburst_testkit::meshes;

    use super::*;

    #[test]
    fn every_triangle_is_in_one_cluster_and_in_its_box() {
        for mesh in meshes::all() {
            let clusters = Clusters::new(&mesh.positions, &mesh.indices, None);
            assert_eq!(clusters.primitive_count() as usize, mesh.indices.len());
            for primitive in 0..mesh.indices.len() {
                let corners = mesh.indices[primitive].map(|i| mesh.positions[i as usize]);
                match clusters.triangle(primitive as u32) {
                    Some(found) => assert_eq!(found, corners),
                    None => assert!(!corners.iter().all(|&p| is_usable(p)), "{}", mesh.name),
                }
            }
            let mut seen = vec![false; mesh.indices.len()];
            for (number, cluster) in clusters.clusters.iter().enumerate() {
                let triangles = clusters.triangles[number * CLUSTER..].iter();
                for triangle in triangles.take(cluster.triangle_count as usize) {
                    assert!(!std::mem::replace(&mut seen[triangle.primitive as usize], true));
                    for p in clusters.triangle(triangle.primitive).unwrap() {
                        let off = (p - cluster.centre).abs();
                        assert!(off.cmple(cluster.half).all(), "{}", mesh.name);
                    }
                }
            }
        }
    }

    #[test]
    fn what_moves_is_what_would_be_made_anew() {
        let mesh = meshes::sphere(24, 12);
        let moved: Vec<Vec3> = mesh.positions.iter().map(|p| *p * 2.0 + p.yzx()).collect();
        let mut clusters = Clusters::new(&mesh.positions, &mesh.indices, None);
        assert!(clusters.refit(&moved, None));
        let anew = Clusters::new(&moved, &mesh.indices, None);
        assert_eq!(clusters.bounds(), anew.bounds());
        for primitive in 0..clusters.primitive_count() {
            assert_eq!(clusters.triangle(primitive), anew.triangle(primitive));
        }
        let before = clusters.bounds();
        assert!(!clusters.refit(&moved[1..], None));
        assert!(!clusters.refit(&vec![Vec3::NAN; moved.len()], None));
        assert_eq!(clusters.bounds(), before);
    }

    use glam::Vec3Swizzles;
}
