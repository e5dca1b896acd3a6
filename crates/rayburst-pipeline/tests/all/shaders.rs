//! Hit groups whose shaders are methods of a type.

use std::sync::Arc;

use glam::{Affine3A, UVec2, Vec3};
use rayburst_accel::{
    Blas, BuildOptions, Geometry, Instance, ProceduralBoxes, RayFlags, Tlas, TriangleMesh,
};
use rayburst_math::{Aabb, Ray};
use rayburst_pipeline::{
    AnyHit, AnyHitResult, Barycentrics, ClosestHit, HitGroup, Intersection, ProceduralShaders,
    RwTexture, ShaderTable, TriangleShaders,
};

/// Counts what runs, and lets rays pass where `u` is small.
struct Leaf;

#[derive(Clone, Copy, Default, Debug, PartialEq)]
struct Runs {
    closest: u32,
    any: u32,
    record: u32,
    depth: f32,
}

impl TriangleShaders for Leaf {
    type Payload = Runs;
    type Record = u32;
    const HAS_ANY_HIT: bool = true;

    fn closest_hit(&self, hit: &ClosestHit<'_, Barycentrics, u32>, runs: &mut Runs) {
        runs.closest += 1;
        (runs.record, runs.depth) = (*hit.record(), hit.t());
    }

    fn any_hit(&self, hit: &AnyHit<'_, Barycentrics, u32>, runs: &mut Runs) -> AnyHitResult {
        runs.any += 1;
        if hit.attributes().u < 0.3 { hit.ignore_hit() } else { hit.accept_hit() }
    }
}

/// A slab across the box at the middle of its depth.
struct Slab {
    depth: f32,
}

impl ProceduralShaders for Slab {
    type Payload = Runs;
    type Attributes = [f32; 8];
    type Record = u32;

    fn intersection(&self, ray: &mut Intersection<'_, '_, Runs, [f32; 8], u32>) {
        let object = ray.object_ray();
        let t = (self.depth - object.origin.z) / object.direction.z;
        let seen = ray.payload().is_some_and(|runs| runs.closest == 0);
        assert!(seen && ray.report_hit(t, 5, [t; 8]));
    }

    fn closest_hit(&self, hit: &ClosestHit<'_, [f32; 8], u32>, runs: &mut Runs) {
        assert_eq!((hit.hit_kind(), hit.attributes()), (5, [hit.t(); 8]));
        runs.closest += 1;
        (runs.record, runs.depth) = (*hit.record(), hit.t());
    }
}

#[test]
fn methods_run_like_closures() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let mesh = TriangleMesh { opaque: false, ..TriangleMesh::new(&corners, &[[0, 1, 2]]) };
    let boxes = [Aabb { lower: Vec3::new(0.0, 0.0, -2.0), upper: Vec3::new(1.0, 1.0, -1.0) }];
    let geometries = [Geometry::from(mesh), ProceduralBoxes::new(&boxes).into()];
    let blas = Blas::of_geometries(&geometries, &BuildOptions::default()).unwrap();
    let instances = [Instance::new(0, Affine3A::IDENTITY)];
    let tlas = Tlas::build(vec![Arc::new(blas)], &instances, &BuildOptions::default()).unwrap();

    let runs = RwTexture::<[u32; 4]>::new(3, 1);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<Runs>("ray", 0, 1, 0);
    table.no_miss();
    table.hit(&HitGroup::of_triangles("leaf", Leaf), 7);
    table.hit(&HitGroup::of_procedural("slab", Slab { depth: -1.5 }), 8);
    let generate = table.ray_generation(|launch| {
        let x = launch.launch_index().x;
        let origin = Vec3::new([0.5, 0.1, 3.0][x as usize], 0.2, 1.0);
        let mut payload = Runs::default();
        launch.trace_ray(
            ray_type,
            RayFlags::empty(),
            0xFF,
            &Ray::new(origin, -Vec3::Z),
            &mut payload,
        );
        let Runs { closest, any, record, depth } = payload;
        runs.store(UVec2::new(x, 0), [closest, any, record, depth.to_bits()]);
    });
    table.build(1).unwrap().dispatch_rays(&tlas, generate, 3, 1, 1).unwrap();
    let expected = [[1, 1, 7, 1f32.to_bits()], [1, 1, 8, 2.5f32.to_bits()], [0, 0, 0, 0]];
    assert_eq!(runs.to_vec(), expected);
}
