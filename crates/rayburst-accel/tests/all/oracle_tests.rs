//! Every mesh, every instruction set, every query, against brute force.

use glam::Vec3;
use rayburst_accel::{AcceptAll, Blas, BuildOptions, IsaLevel, TraceOptions};
use rayburst_math::{Hit, Ray};

use crate::{
    meshes::{Mesh, Random, all_builds, degenerate, grid_box, needles, ray_at, soup, sphere},
    oracle::{check_closest, crossings},
};

fn meshes() -> Vec<(&'static str, Mesh, Vec3, f32)> {
    let far = Vec3::new(1e6, -1e6, 1e6);
    let zero = Vec3::ZERO;
    vec![
        ("one", soup(1, 1, 1.0), zero, 1.0),
        ("five", soup(2, 5, 0.5), zero, 1.0),
        ("soup", soup(3, 2000, 0.2), zero, 1.0),
        ("fine soup", soup(4, 5000, 0.02), zero, 1.0),
        ("sphere", sphere(16), zero, 1.0),
        ("boxes", grid_box(4).merged(&grid_box(3).map(|p| 0.5 * p)), zero, 1.0),
        ("needles", needles(5, 1000), zero, 1.0),
        ("degenerate", degenerate(6, 1000), zero, 1.0),
        ("far", soup(7, 1000, 0.3).map(|p| 100.0 * p + far), far, 100.0),
        ("tiny", soup(8, 1000, 0.3).map(|p| 1e-6 * p), zero, 1e-6),
        ("minute", soup(9, 300, 0.3).map(|p| 1e-20 * p), zero, 1e-20),
        ("huge", soup(10, 300, 0.3).map(|p| 1e15 * p), zero, 1e15),
        ("flat", soup(11, 500, 0.2).map(|p| p * Vec3::new(1.0, 0.0, 1.0)), zero, 1.0),
    ]
}

#[test]
fn closest_hits_are_those_of_brute_force() {
    for (name, mesh, centre, radius) in meshes() {
        for isa in IsaLevel::available() {
            let blas = mesh.blas(isa);
            blas.validate().unwrap_or_else(|defect| panic!("{name}: {defect}"));
            let mut random = Random::new(17);
            for _ in 0..600 {
                let ray = ray_at(&mut random, centre, radius);
                let hit = blas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
                check_closest(&mesh, &ray, &hit)
                    .unwrap_or_else(|error| panic!("{name}, {}: {error}", isa.name()));
            }
        }
    }
}

#[test]
fn every_build_hits_what_brute_force_hits() {
    for (name, mesh, centre, radius) in meshes() {
        let mut random = Random::new(27);
        let rays: Vec<Ray> = (0..500).map(|_| ray_at(&mut random, centre, radius)).collect();
        for build in all_builds() {
            let mut first: Option<Vec<Hit>> = None;
            for isa in IsaLevel::available() {
                let options = BuildOptions { isa: Some(isa), ..build };
                let blas = Blas::build(&[mesh.geometry()], &options).unwrap();
                let failed = |error: &dyn std::fmt::Display| -> ! {
                    panic!("{name}, {build:?}, {}: {error}", isa.name())
                };
                blas.validate().unwrap_or_else(|defect| failed(&defect));
                let mut hits = vec![Hit::MISS; rays.len()];
                blas.closest_hits(&rays, &mut hits, &TraceOptions::default(), &AcceptAll);
                match &first {
                    Some(first) => assert_eq!(first, &hits, "{name}, {build:?}, {}", isa.name()),
                    None => {
                        for (ray, hit) in rays.iter().zip(&hits) {
                            check_closest(&mesh, ray, hit).unwrap_or_else(|error| failed(&error));
                        }
                        first = Some(hits);
                    }
                }
            }
        }
    }
}

#[test]
fn all_hits_are_those_of_brute_force_sorted() {
    for (name, mesh, centre, radius) in meshes() {
        for isa in IsaLevel::available() {
            let blas = mesh.blas(isa);
            let mut random = Random::new(18);
            let mut hits = vec![];
            for _ in 0..200 {
                let ray = ray_at(&mut random, centre, radius);
                blas.all_hits(&ray, &TraceOptions::default(), &AcceptAll, &mut hits);
                assert!(hits.windows(2).all(|pair| pair[0].precedes(&pair[1])), "{name}: {hits:?}");
                let possible = crossings(&mesh, &ray);
                for crossing in possible.iter().filter(|c| c.is_surely_hit(&ray)) {
                    let found = hits.iter().any(|h| h.primitive as usize == crossing.triangle);
                    assert!(found, "{name}, {}: {ray:?} misses {crossing:?}", isa.name());
                }
                for hit in &hits {
                    let allowed = possible.iter().any(|c| c.triangle == hit.primitive as usize);
                    assert!(allowed, "{name}, {}: {ray:?} {hit:?}", isa.name());
                }
                let closest = blas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
                assert_eq!(closest, hits.first().copied().unwrap_or(Hit::MISS), "{name}");
            }
        }
    }
}

#[test]
fn queries_batches_and_instruction_sets_agree_bit_for_bit() {
    for (name, mesh, centre, radius) in meshes() {
        let mut random = Random::new(19);
        let rays: Vec<Ray> = (0..1000)
            .map(|i| {
                let mut ray = ray_at(&mut random, centre, radius);
                if i % 3 == 0 {
                    ray.t_min = -1.0;
                    ray.t_max = 0.5;
                }
                ray
            })
            .collect();
        let options = TraceOptions::default();
        let mut first: Option<Vec<Hit>> = None;
        for isa in IsaLevel::available() {
            let blas = mesh.blas(isa);
            let mut hits = vec![Hit::MISS; rays.len()];
            let mut any = vec![false; rays.len()];
            blas.closest_hits(&rays, &mut hits, &options, &AcceptAll);
            blas.any_hits(&rays, &mut any, &options, &AcceptAll);
            let all = blas.all_hits_batch(&rays, &options, &AcceptAll);
            for (i, ray) in rays.iter().enumerate() {
                assert_eq!(hits[i], blas.closest_hit(ray, &options, &AcceptAll), "{name}");
                assert_eq!(any[i], hits[i].is_hit(), "{name}: {ray:?}");
                assert_eq!(any[i], blas.any_hit(ray, &options, &AcceptAll), "{name}");
                assert_eq!(all.of(i).first().copied().unwrap_or(Hit::MISS), hits[i], "{name}");
            }
            let first = first.get_or_insert_with(|| hits.clone());
            assert_eq!(first, &hits, "{name}: {} differs from scalar", isa.name());
        }
    }
}
