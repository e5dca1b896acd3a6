//! What options leave out of triangles, in every mode; first hits, and filters that end a search.

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, AllHits, Counters, Cull, Instance, IsaLevel, Skip, Tlas, TraceMode, TraceOptions,
};
use rayburst_math::{Hit, Ray};

use crate::{
    meshes::{Mesh, Random, ray_at, soup, with_isa},
    mixed::{Ends, Part, Probe, Rules, World, blas, passes, random_boxes},
    oracle::check_closest,
};

const ANY: TraceOptions = TraceOptions::DEFAULT;

/// All but the mode: every way to skip, cull and force, with some masks.
fn all_options() -> Vec<TraceOptions> {
    let mut all = vec![];
    for cull in Cull::ALL {
        for force_opaque in [None, Some(false), Some(true)] {
            for bits in 0..8 {
                let has = |bit: u32| bits & bit != 0;
                let skip = Skip {
                    opaque: has(1),
                    non_opaque: has(2),
                    triangles: has(4),
                    procedural: false,
                };
                let mask = [0xFF, 0x0F, 0x80][all.len() % 3];
                all.push(TraceOptions { mask, cull, force_opaque, skip, ..ANY });
            }
        }
    }
    all
}

/// Compares all queries of a structure with what is left of all hits.
macro_rules! check {
    ($structure:expr, $rays:expr, $options:expr, $all:expr, $opacity:expr) => {{
        let (structure, rays, all): (_, &[Ray], &AllHits) = ($structure, $rays, $all);
        let filter = Probe::new(passes, Ends::Never);
        let mut left = vec![];
        for i in 0..rays.len() {
            let mut hits = all.of(i).to_vec();
            hits.retain(|hit| match $opacity(hit) {
                Some(opaque) => opaque || passes(hit),
                None => false,
            });
            left.push(hits);
        }
        let nearest: Vec<Hit> =
            left.iter().map(|hits| hits.first().copied().unwrap_or(Hit::MISS)).collect();
        for mode in TraceMode::ALL {
            let options = &TraceOptions { mode, ..$options };
            let mut hits = vec![Hit::MISS; rays.len()];
            structure.closest_hits(rays, &mut hits, options, &filter);
            assert_eq!(hits, nearest, "{options:?}");
            let mut any = vec![true; rays.len()];
            structure.any_hits(rays, &mut any, options, &filter);
            assert!(any.iter().zip(&nearest).all(|(&any, hit)| any == hit.is_hit()));
            if options.skip.triangles {
                let mut counts = vec![Counters { nodes: 9, ..Counters::default() }; rays.len()];
                structure.closest_hits_counted(rays, &mut hits, &mut counts, options, &AcceptAll);
                assert!(hits.iter().zip(&counts).all(|(hit, c)| !hit.is_hit() && c.nodes == 0));
            }
        }
        let options = &$options;
        let listed = structure.all_hits_batch(rays, options, &filter);
        let few = structure.nearest_hits_batch(rays, 2, options, &filter);
        let mut found = vec![Hit::MISS];
        for (i, ray) in rays.iter().enumerate() {
            assert_eq!(listed.of(i), left[i], "{options:?}");
            assert_eq!(few.of(i), &left[i][..left[i].len().min(2)]);
            structure.nearest_hits(ray, 1, options, &filter, &mut found);
            assert_eq!(found, left[i][..left[i].len().min(1)]);
            assert_eq!(structure.closest_hit(ray, options, &filter), nearest[i], "{options:?}");
            assert_eq!(structure.any_hit(ray, options, &filter), nearest[i].is_hit());
            let first = structure.first_hit(ray, options, &filter);
            let is_one = left[i].contains(&first) || (left[i].is_empty() && first == Hit::MISS);
            assert!(is_one, "{first:?} is none of {:?}", left[i]);
        }
        nearest.iter().filter(|hit| hit.is_hit()).count()
    }};
}

fn rays(seed: u64, count: usize) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let mut rays: Vec<_> = (0..count).map(|_| ray_at(&mut random, Vec3::ZERO, 1.0)).collect();
    // Some that go the same way, for bundles.
    let bundle = (0..128).map(|i| {
        let (x, y) = (i % 16, i / 16);
        Ray::new(Vec3::new(0.1, 0.2, -4.0), Vec3::new(0.02 * x as f32, 0.03 * y as f32, 1.0))
    });
    rays.extend(bundle);
    rays.push(Ray { t_max: f32::NAN, ..rays[0] });
    rays
}

#[test]
fn every_mode_leaves_out_the_same_of_instances() {
    let world = World::new(270, random_boxes);
    let rays = rays(271, 100);
    for isa in IsaLevel::available() {
        let tlas = world.tlas(&with_isa(isa));
        let all = tlas.all_hits_batch(&rays, &ANY, &AcceptAll);
        let mut count = 0;
        for options in all_options() {
            let rules = Rules::of_options(&options);
            let opacity = |hit: &Hit| {
                let instance = &world.instances[hit.instance as usize];
                let part = &world.parts[instance.blas as usize][hit.geometry as usize];
                rules.triangle(instance, part, hit)
            };
            count += check!(&tlas, &rays, options, &all, opacity);
        }
        assert!(count > 3000, "{count}");
    }
}

#[test]
fn every_mode_leaves_out_the_same_of_one_structure() {
    let parts = [
        Part::Triangles(soup(272, 60, 0.5), true),
        Part::Boxes(random_boxes(273, 10, 0.5), true),
        Part::Triangles(soup(274, 60, 0.5), false),
    ];
    let rays = rays(275, 100);
    let mut instance = Instance::new(0, glam::Affine3A::IDENTITY);
    for isa in IsaLevel::available() {
        let blas = std::sync::Arc::new(blas(&parts, &with_isa(isa)));
        let all = blas.all_hits_batch(&rays, &ANY, &AcceptAll);
        let mut count = 0;
        for (i, options) in all_options().into_iter().enumerate() {
            let options = TraceOptions { mask: 0xFF, ..options };
            let rules = Rules::of_options(&options);
            let plain = Instance::new(0, glam::Affine3A::IDENTITY);
            let opacity = |hit: &Hit| rules.triangle(&plain, &parts[hit.geometry as usize], hit);
            count += check!(&*blas, &rays, options, &all, opacity);
            // The same in the only instance that there is, which may override opacity.
            instance.flags.force_opaque = [None, Some(true), Some(false)][i % 3];
            let tlas = Tlas::build(vec![blas.clone()], &[instance], &with_isa(isa)).unwrap();
            let opacity = |hit: &Hit| rules.triangle(&instance, &parts[hit.geometry as usize], hit);
            check!(&tlas, &rays, options, &all, opacity);
        }
        assert!(count > 1500, "{count}");
    }
}

/// One translucent mesh.
fn glass(seed: u64) -> (Mesh, Vec<Part>) {
    let mesh = soup(seed, 300, 0.5);
    (mesh.clone(), vec![Part::Triangles(mesh, false)])
}

#[test]
fn what_is_left_is_what_brute_force_finds() {
    let (front, back) = (soup(280, 150, 0.5), soup(281, 150, 0.5));
    let parts = [Part::Triangles(front.clone(), true), Part::Triangles(back.clone(), false)];
    let rays = rays(282, 400);
    for isa in IsaLevel::available() {
        let blas = blas(&parts, &with_isa(isa));
        for mode in TraceMode::ALL {
            for (skips_opaque, mesh) in [(true, &back), (false, &front)] {
                let skip = Skip { opaque: skips_opaque, non_opaque: !skips_opaque, ..Skip::NONE };
                let mut hits = vec![Hit::MISS; rays.len()];
                blas.closest_hits(
                    &rays,
                    &mut hits,
                    &TraceOptions { mode, skip, ..ANY },
                    &AcceptAll,
                );
                for (ray, hit) in rays.iter().zip(&hits).filter(|(ray, _)| ray.is_valid()) {
                    assert!(!hit.is_hit() || hit.geometry == u32::from(skips_opaque));
                    check_closest(mesh, ray, hit).unwrap();
                }
                assert!(hits.iter().filter(|hit| hit.is_hit()).count() > 100);
            }
        }
    }
}

#[test]
fn filters_end_single_searches_and_not_batches() {
    let (_, parts) = glass(290);
    let rays = rays(291, 300);
    for isa in IsaLevel::available() {
        let blas = blas(&parts, &with_isa(isa));
        let all = blas.all_hits_batch(&rays, &ANY, &AcceptAll);
        let mut farther = 0;
        let single = Probe::new(|_| true, Ends::AtOnce);
        for (i, ray) in rays.iter().enumerate() {
            let all = all.of(i);
            let mut once = |hit: Hit| {
                assert_eq!(single.asked.take(), usize::from(!all.is_empty()));
                assert!(all.contains(&hit) || all.is_empty() && hit == Hit::MISS);
                farther += usize::from(all.first().is_some_and(|first| *first != hit));
            };
            once(blas.closest_hit(ray, &ANY, &single));
            once(blas.closest_hit(ray, &ANY, &&single));
            once(blas.first_hit(ray, &ANY, &single));
            assert_eq!(blas.any_hit(ray, &ANY, &single), !all.is_empty());
            single.asked.set(0);
            // Opaque geometry asks nobody: the nearest hit is found.
            let opaque = TraceOptions { force_opaque: Some(true), ..ANY };
            let hit = blas.closest_hit(ray, &opaque, &single);
            assert_eq!(hit, all.first().copied().unwrap_or(Hit::MISS));
        }
        assert!(farther > 10, "{farther}");
        let batch = Probe::new(|_| true, Ends::Unasked);
        for mode in TraceMode::ALL {
            let options = TraceOptions { mode, ..ANY };
            let mut hits = vec![Hit::MISS; rays.len()];
            blas.closest_hits(&rays, &mut hits, &options, &batch);
            for (i, hit) in hits.iter().enumerate() {
                assert_eq!(*hit, all.of(i).first().copied().unwrap_or(Hit::MISS));
            }
            let mut any = vec![false; rays.len()];
            blas.any_hits(&rays, &mut any, &options, &batch);
            assert!(any.iter().zip(&hits).all(|(&any, hit)| any == hit.is_hit()));
        }
        assert_eq!(blas.all_hits_batch(&rays, &ANY, &batch), all);
        let mut listed = vec![];
        blas.all_hits(&rays[0], &ANY, &batch, &mut listed);
        assert_eq!(listed, all.of(0));
    }
}
