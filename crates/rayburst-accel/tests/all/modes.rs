//! The modes of tracing give the same bits, whatever the structure, the options and the filter.

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, CandidateFilter, Counters, Cull, FilterFn, IsaLevel, Tlas,
    TraceMode, TraceOptions,
};
use rayburst_math::{Hit, Ray};

use crate::{
    instances,
    meshes::{Mesh, QUALITIES, Random, degenerate, grid_box, needles, ray_at, soup, sphere},
};

const MODES: [TraceMode; 3] = [TraceMode::Single, TraceMode::Interleaved, TraceMode::Auto];

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

/// Compares all modes, in batches of many lengths, with rays one by one; returns the hits.
fn check(structure: &impl Trace, rays: &[Ray]) -> usize {
    let sieve =
        FilterFn(|index: u32, _: &Ray, hit: &Hit| !(index + hit.primitive).is_multiple_of(3));
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
        for mode in MODES {
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
        let rays = rays(76, 1600, mesh);
        for isa in IsaLevel::available() {
            for quality in QUALITIES {
                let options = BuildOptions { quality, isa: Some(isa), ..BuildOptions::default() };
                let geometry = rayburst_accel::TriangleMesh { opaque: false, ..mesh.geometry() };
                check(&Blas::build(&[geometry], &options).unwrap(), &rays);
            }
        }
    }
}

#[test]
fn modes_agree_among_instances() {
    for isa in IsaLevel::available() {
        let (tlas, flat, _) = instances::scene(isa);
        let hits = check(&tlas, &rays(77, 1600, &flat));
        assert!(hits > 1000, "{hits}");
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
