//! Intervals, lengths of directions, ties, culling, masks, filters, counters, invalid rays.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use glam::{Affine3A, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, Counters, Cull, Instance, IsaLevel, Tlas, TraceOptions,
    TriangleMesh,
};
use rayburst_math::{Hit, HitKind, Ray};

use crate::meshes::{Mesh, Random, filter, ray_at, soup, with_isa};

const ANY: TraceOptions = TraceOptions::DEFAULT;

/// Unit triangles facing +z at the given heights, in order.
fn stack_of(heights: &[f32]) -> Mesh {
    let mut mesh = Mesh::default();
    for &z in heights {
        mesh.push([Vec3::new(0.0, 0.0, z), Vec3::new(1.0, 0.0, z), Vec3::new(0.0, 1.0, z)]);
    }
    mesh
}

fn down_from(z: f32) -> Ray {
    Ray::new(Vec3::new(0.25, 0.25, z), -Vec3::Z)
}

fn closest(blas: &Blas, ray: &Ray) -> Hit {
    let hit = blas.closest_hit(ray, &ANY, &AcceptAll);
    assert_eq!(blas.any_hit(ray, &ANY, &AcceptAll), hit.is_hit(), "{ray:?}");
    hit
}

#[test]
fn both_ends_of_the_interval_are_inclusive() {
    for isa in IsaLevel::available() {
        let blas = stack_of(&[0.0, 1.0, 2.0]).blas(isa);
        let hit = |t_min, t_max| {
            let ray = Ray { t_min, t_max, ..down_from(3.0) };
            closest(&blas, &ray).t
        };
        assert_eq!(hit(0.0, f32::INFINITY), 1.0);
        assert_eq!(hit(1.0, f32::INFINITY), 1.0);
        assert_eq!(hit(1.0f32.next_up(), f32::INFINITY), 2.0);
        assert_eq!(hit(2.5, 3.0), 3.0);
        assert_eq!(hit(2.5, 3.0f32.next_down()), f32::INFINITY);
        assert_eq!(hit(3.0, 3.0), 3.0);
        assert_eq!(hit(-f32::INFINITY, f32::INFINITY), 1.0);
    }
}

#[test]
fn negative_distances_are_found_behind_the_origin() {
    for isa in IsaLevel::available() {
        let blas = stack_of(&[0.0, 1.0, 5.0, 9.0]).blas(isa);
        let hit = |t_min, t_max| closest(&blas, &Ray { t_min, t_max, ..down_from(3.0) });
        assert_eq!(hit(-10.0, 10.0).t, -6.0);
        assert_eq!(hit(-5.0, 10.0).t, -2.0);
        assert_eq!(hit(f32::NEG_INFINITY, -3.0).t, -6.0);
        assert_eq!(hit(-1.0, 1.5), Hit::MISS);
        let mut all = vec![];
        let ray = Ray { t_min: -10.0, ..down_from(3.0) };
        blas.all_hits(&ray, &ANY, &AcceptAll, &mut all);
        assert_eq!(all.iter().map(|h| h.t).collect::<Vec<_>>(), [-6.0, -2.0, 2.0, 3.0]);
    }
}

#[test]
fn the_direction_may_have_any_length() {
    for isa in IsaLevel::available() {
        let blas = stack_of(&[0.0, 1.0]).blas(isa);
        for power in [-149, -140, -126, -60, -1, 0, 1, 60, 120, 127] {
            let length = 2f64.powi(power) as f32;
            let ray = Ray { direction: -Vec3::Z * length, ..down_from(3.0) };
            let t = (2.0 / f64::from(length)) as f32;
            let hit = closest(&blas, &ray);
            assert_eq!(hit.t, t, "2^{power}");
            // Distances that `f32` cannot express are no hits.
            assert_eq!(hit.is_hit(), t.is_finite(), "2^{power}");
        }
    }
}

#[test]
fn invalid_rays_are_misses() {
    let blas = stack_of(&[0.0]).blas(IsaLevel::detect());
    let good = down_from(1.0);
    assert!(closest(&blas, &good).is_hit());
    let nan = Vec3::splat(f32::NAN);
    for ray in [
        Ray { origin: nan, ..good },
        Ray { direction: nan, ..good },
        Ray { direction: Vec3::ZERO, ..good },
        Ray { direction: Vec3::splat(f32::INFINITY), ..good },
        Ray { origin: Vec3::new(0.0, 0.0, f32::INFINITY), ..good },
        Ray { t_min: f32::NAN, ..good },
        Ray { t_max: f32::NAN, ..good },
        Ray { t_min: 2.0, t_max: 1.0, ..good },
        Ray { origin: Vec3::splat(1e38), ..good },
    ] {
        assert_eq!(closest(&blas, &ray), Hit::MISS, "{ray:?}");
        let mut hits = vec![Hit::MISS];
        blas.all_hits(&ray, &ANY, &AcceptAll, &mut hits);
        assert!(hits.is_empty());
    }
}

#[test]
fn ties_go_to_the_smallest_indices() {
    // 300 triangles at the same place, in three geometries and three instances.
    let mesh = stack_of(&[1.0; 100]);
    for isa in IsaLevel::available() {
        let geometries = [TriangleMesh::new(&[], &[]), mesh.geometry(), mesh.geometry()];
        let blas = Blas::build(&geometries, &with_isa(isa)).unwrap();
        blas.validate().unwrap();
        let hit = closest(&blas, &down_from(3.0));
        assert_eq!((hit.instance, hit.geometry, hit.primitive), (0, 1, 0));
        let mut all = vec![];
        blas.all_hits(&down_from(3.0), &ANY, &AcceptAll, &mut all);
        let ids: Vec<_> = all.iter().map(|h| (h.geometry, h.primitive)).collect();
        let expected: Vec<_> = (1..3).flat_map(|g| (0..100).map(move |p| (g, p))).collect();
        assert_eq!(ids, expected);

        let instances: Vec<Instance> = [2.0, 0.0, 0.0, 0.0]
            .map(|z| Instance::new(0, Affine3A::from_translation(-Vec3::Z * z)))
            .to_vec();
        let tlas = Tlas::build(vec![Arc::new(blas)], &instances, &with_isa(isa)).unwrap();
        let hit = tlas.closest_hit(&down_from(3.0), &ANY, &AcceptAll);
        assert_eq!((hit.t, hit.instance, hit.geometry, hit.primitive), (2.0, 1, 1, 0));
    }
}

#[test]
fn faces_are_told_apart_and_culled() {
    for isa in IsaLevel::available() {
        let blas = Arc::new(stack_of(&[0.0]).blas(isa));
        let above = down_from(1.0);
        let below = Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z);
        assert_eq!(closest(&blas, &above).kind, HitKind::TRIANGLE_FRONT);
        assert_eq!(closest(&blas, &below).kind, HitKind::TRIANGLE_BACK);
        let is_hit = |ray: &Ray, cull| {
            let options = TraceOptions { cull, ..ANY };
            let mut all = vec![];
            blas.all_hits(ray, &options, &AcceptAll, &mut all);
            let hit = blas.closest_hit(ray, &options, &AcceptAll).is_hit();
            assert_eq!(hit, blas.any_hit(ray, &options, &AcceptAll));
            assert_eq!(hit, !all.is_empty());
            hit
        };
        assert!(!is_hit(&above, Cull::Front) && is_hit(&above, Cull::Back));
        assert!(is_hit(&below, Cull::Front) && !is_hit(&below, Cull::Back));

        let mut instance = Instance::new(0, Affine3A::IDENTITY);
        let mut kinds = |clockwise, cull_disable, cull| {
            instance.flags.front_clockwise = clockwise;
            instance.flags.cull_disable = cull_disable;
            let tlas = Tlas::build(vec![blas.clone()], &[instance], &with_isa(isa)).unwrap();
            tlas.closest_hit(&above, &TraceOptions { cull, ..ANY }, &AcceptAll).kind
        };
        assert_eq!(kinds(true, false, Cull::None), HitKind::TRIANGLE_BACK);
        assert_eq!(kinds(true, false, Cull::Back), HitKind::NONE);
        assert_eq!(kinds(true, false, Cull::Front), HitKind::TRIANGLE_BACK);
        assert_eq!(kinds(true, true, Cull::Back), HitKind::TRIANGLE_BACK);
    }
}

#[test]
fn masks_select_instances() {
    let blas = Arc::new(stack_of(&[0.0]).blas(IsaLevel::detect()));
    let instances = [(1.0, 0b01), (2.0, 0b10), (3.0, 0)].map(|(z, mask)| Instance {
        mask,
        ..Instance::new(0, Affine3A::from_translation(Vec3::Z * z))
    });
    let tlas = Tlas::build(vec![blas], &instances, &BuildOptions::default()).unwrap();
    let hit = |mask| {
        let options = TraceOptions { mask, ..ANY };
        let hit = tlas.closest_hit(&down_from(5.0), &options, &AcceptAll);
        assert_eq!(hit.is_hit(), tlas.any_hit(&down_from(5.0), &options, &AcceptAll));
        hit.instance
    };
    assert_eq!((hit(0xFF), hit(0b10), hit(0b01)), (1, 1, 0));
    assert_eq!((hit(0b100), hit(0)), (u32::MAX, u32::MAX));
}

#[test]
fn only_translucent_geometry_asks_the_filter() {
    let (solid, glass) = (soup(31, 200, 0.3), soup(32, 200, 0.3));
    let translucent = TriangleMesh { opaque: false, ..glass.geometry() };
    for isa in IsaLevel::available() {
        let blas = Blas::build(&[solid.geometry(), translucent], &with_isa(isa)).unwrap();
        let rejects_odd = filter(&|_: u32, _: &Ray, hit: &Hit| {
            assert_eq!(hit.geometry, 1);
            hit.primitive.is_multiple_of(2)
        });
        let mut random = Random::new(33);
        let mut rejected = 0;
        for _ in 0..500 {
            let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
            let (mut all, mut kept) = (vec![], vec![]);
            blas.all_hits(&ray, &ANY, &AcceptAll, &mut all);
            blas.all_hits(&ray, &ANY, &rejects_odd, &mut kept);
            let passes = |h: &Hit| h.geometry == 0 || h.primitive.is_multiple_of(2);
            rejected += all.len() - kept.len();
            all.retain(passes);
            assert_eq!(all, kept);
            let nearest = blas.closest_hit(&ray, &ANY, &rejects_odd);
            assert_eq!(nearest, kept.first().copied().unwrap_or(Hit::MISS));
            assert_eq!(blas.any_hit(&ray, &ANY, &rejects_odd), nearest.is_hit());
        }
        assert!(rejected > 50);
    }
}

#[test]
fn filters_learn_the_ray_and_obey_the_instance() {
    let blas = Arc::new(
        Blas::build(
            &[TriangleMesh { opaque: false, ..stack_of(&[0.0]).geometry() }],
            &BuildOptions::default(),
        )
        .unwrap(),
    );
    let calls = AtomicUsize::new(0);
    let rays = [down_from(1.0), down_from(2.0)];
    let refuse = |index: u32, ray: &Ray, hit: &Hit| {
        calls.fetch_add(1, Ordering::Relaxed);
        assert_eq!(*ray, rays[index as usize]);
        assert_eq!((hit.instance, hit.t), (0, ray.origin.z));
        false
    };
    let refuse = filter(&refuse);
    let hits = |force_opaque| {
        let mut instance = Instance::new(0, Affine3A::from_scale(Vec3::splat(2.0)));
        instance.flags.force_opaque = force_opaque;
        let tlas = Tlas::build(vec![blas.clone()], &[instance], &BuildOptions::default()).unwrap();
        let mut any = [false; 2];
        tlas.any_hits(&rays, &mut any, &ANY, &refuse);
        any
    };
    assert_eq!(hits(None), [false; 2]);
    assert_eq!(calls.load(Ordering::Relaxed), 2);
    assert_eq!(hits(Some(true)), [true; 2]);
    assert_eq!(calls.load(Ordering::Relaxed), 2);
    assert_eq!(hits(Some(false)), [false; 2]);
    assert_eq!(calls.load(Ordering::Relaxed), 4);
}

#[test]
fn counting_changes_no_answer_and_counts() {
    let blas = soup(35, 1000, 0.1).blas(IsaLevel::detect());
    let mut random = Random::new(36);
    let rays: Vec<Ray> = (0..200).map(|_| ray_at(&mut random, Vec3::ZERO, 1.0)).collect();
    let mut plain = vec![Hit::MISS; rays.len()];
    let (mut counted, mut counts) = (plain.clone(), vec![Counters::default(); rays.len()]);
    blas.closest_hits(&rays, &mut plain, &ANY, &AcceptAll);
    blas.closest_hits_counted(&rays, &mut counted, &mut counts, &ANY, &AcceptAll);
    assert_eq!(plain, counted);
    assert!(counts.iter().all(|c| c.nodes >= 1 && c.instances == 0));
    assert!(counts.iter().all(|c| c.triangles >= c.leaves && c.triangles <= 4 * c.leaves));
    assert!(plain.iter().zip(&counts).all(|(hit, c)| !hit.is_hit() || c.triangles > 0));
    // Far fewer than brute force.
    assert!(counts.iter().map(|c| c.triangles as usize).sum::<usize>() < 200 * 100);
    let mut any = vec![false; rays.len()];
    blas.any_hits_counted(&rays, &mut any, &mut counts, &ANY, &AcceptAll);
    assert!(plain.iter().zip(&any).all(|(hit, &any)| hit.is_hit() == any));
}
