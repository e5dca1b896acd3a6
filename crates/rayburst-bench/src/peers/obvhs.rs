//! The crate `obvhs`: its compressed wide BVH, `obvhs:cwbvh`, by its medium preset.
//!
//! The crate chooses its vector code when it is compiled, so it runs with the baseline instructions of
//! the target. The crate `bvh` is no peer: its traversal knows neither an end of the ray nor the
//! nearest hit so far, and it normalises directions, so no loop around it does the same work.

use std::time::Duration;

use glam::Vec3A;
use obvhs::{
    BvhBuildParams,
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::{Ray as ObvhsRay, RayHit},
    rt_triangle::RtTriangle,
    triangle::Triangle,
};
use rayburst_math::{Hit, HitKind, Ray};

use crate::{Engine, FlatMesh, Query};

/// The name in rows.
pub const NAME: &str = "obvhs:cwbvh";

/// A built structure.
pub struct Obvhs {
    tree: CwBvh,
    /// In the order of the leaves, as the crate advises.
    triangles: Vec<RtTriangle>,
}

impl Obvhs {
    /// Builds over a mesh.
    pub fn build(mesh: &FlatMesh) -> Self {
        let triangles: Vec<Triangle> = mesh
            .indices
            .iter()
            .map(|corners| {
                let [v0, v1, v2] = corners.map(|i| Vec3A::from(mesh.positions[i as usize]));
                Triangle { v0, v1, v2 }
            })
            .collect();
        let mut time = Duration::ZERO;
        let tree = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut time);
        let order = tree.primitive_indices.iter();
        let triangles = order.map(|&i| RtTriangle::from(&triangles[i as usize])).collect();
        Self { tree, triangles }
    }

    fn closest(&self, ray: &Ray) -> Hit {
        let ray = converted(ray);
        let mut found = RayHit::none();
        let test = |ray: &ObvhsRay, index: usize| self.triangles[index].intersect(ray);
        if !self.tree.ray_traverse(ray, &mut found, test) {
            return Hit::MISS;
        }
        let index = found.primitive_id as usize;
        let [u, v] = self.triangles[index].compute_barycentric(&ray).to_array();
        Hit {
            t: found.t,
            u,
            v,
            primitive: self.tree.primitive_indices[index],
            geometry: 0,
            instance: 0,
            kind: HitKind::TRIANGLE_FRONT,
            reserved: 0,
        }
    }

    fn any(&self, ray: &Ray) -> bool {
        let test = |ray: &ObvhsRay, index: usize| self.triangles[index].intersect(ray);
        !self.tree.ray_traverse_miss(converted(ray), test)
    }
}

fn converted(ray: &Ray) -> ObvhsRay {
    ObvhsRay::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

impl Engine for Obvhs {
    fn name(&self) -> String {
        NAME.into()
    }

    fn is_peer(&self) -> bool {
        true
    }

    fn takes_single_rays(&self) -> bool {
        true
    }

    fn trace(&self, query: Query, rays: &[Ray], hits: &mut [Hit], occluded: &mut [bool]) {
        match query {
            Query::Closest => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = self.closest(ray);
                }
            }
            Query::Any => {
                for (ray, occluded) in rays.iter().zip(occluded) {
                    *occluded = self.any(ray);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rayburst_accel::{AcceptAll, Blas, BuildOptions, TraceOptions, TriangleMesh};
    use rayburst_math::hash::Rng;
    use rayburst_testkit::meshes;

    use super::*;

    #[test]
    fn it_finds_the_same_hits() {
        let mesh = meshes::all().into_iter().find(|m| m.inside.is_some()).unwrap();
        let bounds = mesh.bounds();
        let flat = FlatMesh { positions: mesh.positions, indices: mesh.indices, light: None };
        let triangles = [TriangleMesh::new(&flat.positions, &flat.indices)];
        let blas = Blas::build(&triangles, &BuildOptions::default()).unwrap();
        let obvhs = Obvhs::build(&flat);
        let mut rng = Rng::new(9);
        let (mut different, mut hits) = (0, 0);
        let count = 5000;
        for i in 0..count {
            let origin = bounds.centre() + 2.0 * bounds.extent() * (rng.vec3() - 0.5);
            let target = bounds.lower + bounds.extent() * rng.vec3();
            let t_max = if i % 3 == 0 { 0.5 } else { f32::INFINITY };
            let ray = Ray::with_interval(origin, target - origin, 0.0, t_max);
            let expected = blas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
            let hit = obvhs.closest(&ray);
            assert_eq!(obvhs.any(&ray), hit.is_hit());
            hits += usize::from(hit.is_hit());
            let near = (hit.t - expected.t).abs() <= 1e-3 * expected.t.abs()
                && (hit.u - expected.u).abs().max((hit.v - expected.v).abs()) < 0.01
                && hit.primitive == expected.primitive;
            let same = if hit.is_hit() { near } else { !expected.is_hit() };
            different += usize::from(!same);
        }
        assert!(hits > count / 10 && different <= count / 200, "{hits} {different}");
    }
}
