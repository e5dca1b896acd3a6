//! The modes of tracing give the same bits, whatever the structure, the options and the filter.

use std::sync::Arc;

use glam::{Affine3A, Quat, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, CandidateFilter, Counters, Cull, FilterFn, Instance,
    InstanceFlags, IsaLevel, Layout, Tlas, TraceMode, TraceOptions,
};
use rayburst_math::{Hit, Ray};

use crate::{
    instances,
    meshes::{
        Mesh, QUALITIES, Random, degenerate, filter, grid_box, needles, ray_at, soup, sphere,
    },
};

/// Answers of a batch: nearest hits, and whether there are any.
type Answers = (Vec<Hit>, Vec<bool>);

trait Trace {
    fn trace(&self, rays: &[Ray], options: &TraceOptions, filter: &impl CandidateFilter)
    -> Answers;

    /// One call a ray.
    fn call(&self, rays: &[Ray], options: &TraceOptions) -> Answers;
}

macro_rules! trace {
    ($structure:ty) => {
        impl Trace for $structure {
            fn trace(
                &self,
                rays: &[Ray],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> Answers {
                let mut hits = vec![Hit::MISS; rays.len()];
                let mut occluded = vec![false; rays.len()];
                self.closest_hits(rays, &mut hits, options, filter);
                self.any_hits(rays, &mut occluded, options, filter);
                let mut counted = vec![Hit::MISS; rays.len()];
                let mut counts = vec![Counters::default(); rays.len()];
                self.closest_hits_counted(rays, &mut counted, &mut counts, options, filter);
                assert_eq!(hits, counted);
                assert!(counts.iter().zip(&hits).all(|(c, h)| c.nodes > 0 || !h.is_hit()));
                (hits, occluded)
            }

            fn call(&self, rays: &[Ray], options: &TraceOptions) -> Answers {
                let closest = |ray| self.closest_hit(ray, options, &AcceptAll);
                let any = |ray| self.any_hit(ray, options, &AcceptAll);
                (rays.iter().map(closest).collect(), rays.iter().map(any).collect())
            }
        }
    };
}

trace!(Blas);
trace!(Tlas);

/// Rays of all kinds: ordinary, backwards in time, short, long, invalid, on surfaces.
fn rays(seed: u64, count: usize, mesh: &Mesh) -> Vec<Ray> {
    let mut random = Random::new(seed);
    (0..count)
        .map(|i| {
            let ray = ray_at(&mut random, Vec3::ZERO, 1.2);
            match i % 16 {
                0 => Ray { t_min: -2.0, ..ray },
                1 => Ray { t_max: random.unit(), ..ray },
                2 => Ray { direction: ray.direction * 1e-40, t_max: f32::INFINITY, ..ray },
                3 => Ray { direction: ray.direction * 1e30, ..ray },
                4 => Ray { direction: Vec3::ZERO, ..ray },
                5 => Ray { origin: Vec3::splat(f32::NAN), ..ray },
                6 => Ray { direction: Vec3::new(0.0, ray.direction.y, 0.0), ..ray },
                7 => {
                    let [a, b, c] = mesh.triangle(random.below(mesh.indices.len()));
                    Ray { origin: (a + b + c) / 3.0, ..ray }
                }
                8 => Ray { t_max: 0.0, ..ray },
                9 => {
                    // At a corner, where several triangles are equally near.
                    let [corner, ..] = mesh.triangle(random.below(mesh.indices.len()));
                    Ray::new(ray.origin, corner - ray.origin)
                }
                _ => ray,
            }
        })
        .collect()
}

/// Rays in groups that go the same way: from a point, to a point, and side by side; some exactly to
/// corners and edges, along axes, in planes of boxes, with intervals that end at a triangle.
fn coherent_rays(seed: u64, groups: usize, mesh: &Mesh) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let mut rays = vec![];
    for group in 0..groups {
        let apex = 2.0 * random.vector();
        let corners = mesh.triangle(random.below(mesh.indices.len()));
        let towards = corners[0] - apex;
        let spread = [0.02, 0.1, 0.4][random.below(3)];
        let axis = [Vec3::X, Vec3::NEG_Y, Vec3::Z][random.below(3)];
        for i in 0..64 {
            let bend = spread * random.vector();
            let middle = corners[i % 3].lerp(corners[(i + 1) % 3], 0.5 * (i % 3) as f32);
            let ray = match group % 8 {
                0 => Ray::new(apex, towards.normalize_or(axis) + bend),
                1 => Ray::new(apex + bend, towards - bend),
                2 => Ray::new(apex + bend, towards),
                // At corners and middles of edges.
                3 => Ray::new(apex, middle - apex),
                // Along an axis from points in the mesh's planes, and on its corners.
                4 => Ray::new(middle - 3.0 * axis + spread * axis.cross(bend), axis),
                5 => Ray::new(mesh.triangle(i % mesh.indices.len())[0] - 2.0 * axis, axis),
                // From points on surfaces, to the light.
                6 => Ray::with_interval(middle + bend, apex - middle - bend, 1e-4, 1.0),
                _ => Ray::with_interval(apex, middle - apex + 0.01 * bend, 0.0, 1.0),
            };
            // Some that belong in no bundle.
            rays.push(match i % 23 {
                11 if group % 3 == 0 => Ray { t_min: -1.0, ..ray },
                17 if group % 3 == 1 => Ray { direction: -ray.direction, ..ray },
                19 if group % 3 == 2 => Ray { origin: Vec3::splat(f32::NAN), ..ray },
                _ => ray,
            });
        }
    }
    rays
}

/// Compares all modes, in batches of many lengths, with rays one by one; returns the hits.
fn check(structure: &impl Trace, rays: &[Ray]) -> usize {
    let sieve =
        filter(&|index: u32, _: &Ray, hit: &Hit| !(index + hit.primitive).is_multiple_of(3));
    let mut hit_count = 0;
    for cull in [Cull::None, Cull::Front, Cull::Back] {
        let options = |mode| TraceOptions { cull, mode, ..TraceOptions::default() };
        let single = options(TraceMode::Single);
        let plain = structure.trace(rays, &single, &AcceptAll);
        assert_eq!(structure.call(rays, &single), plain);
        let sieved = structure.trace(rays, &single, &sieve);
        assert!(plain.0.iter().zip(&plain.1).all(|(hit, &any)| hit.is_hit() == any));
        assert!(sieved.0.iter().zip(&sieved.1).all(|(hit, &any)| hit.is_hit() == any));
        hit_count += plain.1.iter().filter(|&&any| any).count();
        for mode in TraceMode::ALL {
            assert_eq!(structure.trace(rays, &options(mode), &AcceptAll), plain, "{mode:?}");
            assert_eq!(structure.trace(rays, &options(mode), &sieve), sieved, "{mode:?}");
            let mut at = 0;
            for length in [0, 1, 2, 5, 31, 64, 100] {
                let part = at..at + length;
                let (hits, any) = structure.trace(&rays[part.clone()], &options(mode), &AcceptAll);
                assert_eq!(
                    (hits.as_slice(), any.as_slice()),
                    (&plain.0[part.clone()], &plain.1[part])
                );
                at += length;
            }
        }
    }
    hit_count
}

#[test]
fn modes_agree_on_meshes_of_every_kind_and_build() {
    let meshes = [
        soup(71, 900, 0.15),
        sphere(12),
        grid_box(6),
        needles(72, 300),
        degenerate(73, 300),
        soup(74, 3, 0.5),
        soup(75, 400, 0.1).map(|p| 1e-6 * p + Vec3::splat(0.3)),
    ];
    for mesh in &meshes {
        let rays = [rays(76, 1600, mesh), coherent_rays(80, 40, mesh)].concat();
        for isa in IsaLevel::available() {
            for quality in QUALITIES {
                for layout in Layout::ALL {
                    let isa = Some(isa);
                    let options = BuildOptions { quality, layout, isa, ..BuildOptions::default() };
                    let geometry =
                        rayburst_accel::TriangleMesh { opaque: false, ..mesh.geometry() };
                    check(&Blas::build(&[geometry], &options).unwrap(), &rays);
                }
            }
        }
    }
}

#[test]
fn modes_agree_among_instances() {
    for isa in IsaLevel::available() {
        let (tlas, flat, _) = instances::scene(isa);
        let hits = check(&tlas, &[rays(77, 1600, &flat), coherent_rays(81, 40, &flat)].concat());
        assert!(hits > 1000, "{hits}");
    }
}

#[test]
fn modes_agree_in_one_instance() {
    let mesh = soup(82, 500, 0.2);
    let turned = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.5, -0.5, 1.0),
        Quat::from_rotation_y(0.7),
        Vec3::new(0.1, 0.2, 0.3),
    );
    let flat = mesh.clone().map(|p| turned.transform_point3(p));
    let rays = coherent_rays(83, 40, &flat);
    for isa in IsaLevel::available() {
        for (front_clockwise, layout) in
            [(false, Layout::Wide), (true, Layout::Wide), (false, Layout::Compressed)]
        {
            let flags = InstanceFlags { front_clockwise, ..InstanceFlags::default() };
            let instances = [
                Instance { flags, ..Instance::new(0, turned) },
                // Never hit: what is left is one instance.
                Instance::new(0, Affine3A::ZERO),
            ];
            let options = BuildOptions { layout, isa: Some(isa), ..BuildOptions::default() };
            let geometry = rayburst_accel::TriangleMesh { opaque: false, ..mesh.geometry() };
            let blas = Arc::new(Blas::build(&[geometry], &options).unwrap());
            let hits = check(&Tlas::build(vec![blas], &instances, &options).unwrap(), &rays);
            assert!(hits > 1000, "{hits}");
        }
    }
}

#[test]
fn a_filter_may_trace_rays_itself() {
    let mesh = soup(78, 400, 0.3);
    let geometry = rayburst_accel::TriangleMesh { opaque: false, ..mesh.geometry() };
    let blas = Blas::build(&[geometry], &BuildOptions::default()).unwrap();
    let rays = rays(79, 200, &mesh);
    let options = TraceOptions { mode: TraceMode::Interleaved, ..TraceOptions::default() };
    // Whether the way back from a hit is free: by a batch within the batch.
    let back = |_: u32, ray: &Ray, hit: &Hit| {
        let back = Ray::with_interval(ray.at(hit.t), -ray.direction, 1e-3, 10.0);
        let mut occluded = [false; 40];
        blas.any_hits(&[back; 40], &mut occluded, &options, &AcceptAll);
        occluded[39]
    };
    let nested = blas.trace(&rays, &options, &FilterFn(back));
    let single = TraceOptions { mode: TraceMode::Single, ..options };
    assert_eq!(nested, blas.trace(&rays, &single, &FilterFn(back)));
    assert!(nested.1.iter().any(|&any| any) && nested.1.iter().any(|&any| !any));
}

/// Counters of a mode, put where others were.
fn counters(blas: &Blas, rays: &[Ray], mode: TraceMode) -> Vec<Counters> {
    let mut counts = vec![Counters { nodes: 7, packet_nodes: 9, ..Default::default() }; rays.len()];
    let mut hits = vec![Hit::MISS; rays.len()];
    let options = TraceOptions { mode, ..TraceOptions::default() };
    blas.closest_hits_counted(rays, &mut hits, &mut counts, &options, &AcceptAll);
    counts
}

#[test]
fn counters_tell_bundles_and_rays_in_flight() {
    let blas = soup(84, 3000, 0.1).blas(IsaLevel::detect());
    let mut random = Random::new(85);
    let scattered: Vec<Ray> = (0..640).map(|_| ray_at(&mut random, Vec3::ZERO, 1.0)).collect();
    let apex = Vec3::new(0.1, 0.2, -4.0);
    let alike: Vec<Ray> = (0..640)
        .map(|i| Ray::new(apex, Vec3::new((i % 8) as f32 * 1e-3, (i / 8) as f32 * 1e-3, 1.0)))
        .collect();
    for rays in [&scattered, &alike] {
        for c in counters(&blas, rays, TraceMode::Single) {
            assert_eq!((c.packet_nodes, c.in_flight), (0, c.nodes + c.leaves));
            assert_eq!(c.packet_share(), 0.0);
        }
        for mode in [TraceMode::Interleaved, TraceMode::Stream] {
            let counts = counters(&blas, rays, mode);
            assert!(counts.iter().all(|c| c.packet_nodes == 0 && c.nodes > 0));
            let mean = counts.iter().map(Counters::mean_in_flight).sum::<f32>() / 640.0;
            assert!((10.0..=64.0).contains(&mean), "{mode:?}: {mean}");
        }
    }
    for mode in [TraceMode::Packet, TraceMode::Auto] {
        let counts = counters(&blas, &alike, mode);
        assert!(counts.iter().all(|c| c.packet_share() == 1.0), "{mode:?}");
        let mean = counts.iter().map(Counters::mean_in_flight).sum::<f32>() / 640.0;
        assert!((16.0..=64.0).contains(&mean), "{mode:?}: {mean}");
    }
    let counts = counters(&blas, &scattered, TraceMode::Auto);
    assert!(counts.iter().all(|c| c.packet_nodes == 0));
    assert_eq!(Counters::default().mean_in_flight(), 0.0);
}

#[test]
fn streams_of_several_pieces_are_answered_in_place() {
    // More rays than are sorted at a time, some of which have no place: they start nowhere.
    let mesh = soup(86, 200, 0.2);
    let rays = rays(87, 70_000, &mesh);
    for isa in IsaLevel::available() {
        let blas = mesh.blas(isa);
        let trace = |mode| {
            let options = TraceOptions { mode, ..TraceOptions::default() };
            let mut hits = vec![Hit::MISS; rays.len()];
            blas.closest_hits(&rays, &mut hits, &options, &AcceptAll);
            hits
        };
        assert_eq!(trace(TraceMode::Stream), trace(TraceMode::Interleaved));
    }
}
