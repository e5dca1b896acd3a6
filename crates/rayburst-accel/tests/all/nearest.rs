//! The k nearest hits are the first k of all hits, bit for bit.

use std::{
    collections::BTreeSet,
    sync::{Arc, Mutex},
};

use glam::{Affine3A, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, CandidateFilter, Cull, Instance, IsaLevel, Tlas, TraceOptions,
    TriangleMesh,
};
use rayburst_math::{Hit, Ray};

use crate::{
    instances,
    meshes::{
        Mesh, QUALITIES, Random, all_builds, degenerate, filter, grid_box, needles, ray_at, soup,
        sphere, with_isa,
    },
    oracle::crossings,
};

const COUNTS: [usize; 7] = [0, 1, 2, 3, 8, 50, usize::MAX];

/// Rays through a mesh in [−1, 1]³, some backwards, short, invalid, and at corners and edges.
fn rays(seed: u64, count: usize, mesh: &Mesh) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let ray = |i: usize| {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        let corners = mesh.triangle(random.below(mesh.indices.len()));
        match i % 12 {
            0 => Ray { t_min: -2.0, ..ray },
            1 => Ray { t_max: random.unit(), ..ray },
            2 => Ray { origin: Vec3::splat(f32::NAN), ..ray },
            3 => Ray { direction: Vec3::new(f32::NAN, 1.0, 0.0), ..ray },
            4 => Ray { t_max: f32::NAN, ..ray },
            5 => Ray { direction: Vec3::ZERO, ..ray },
            6 => Ray { direction: ray.direction * 1e-40, ..ray },
            7 => Ray { direction: ray.direction * 1e30, ..ray },
            8 => Ray::new(ray.origin, corners[0] - ray.origin),
            9 => Ray::new(ray.origin, 0.5 * (corners[0] + corners[1]) - ray.origin),
            _ => ray,
        }
    };
    (0..count).map(ray).collect()
}

/// Compares lists of `structure` with all hits; returns how many hits there are.
macro_rules! check {
    ($structure:expr, $rays:expr, $options:expr, $filter:expr) => {{
        let (structure, rays, options) = ($structure, $rays, $options);
        let all = structure.all_hits_batch(rays, options, $filter);
        let mut hits = vec![Hit::MISS; 3];
        for k in COUNTS {
            let nearest = structure.nearest_hits_batch(rays, k, options, $filter);
            assert_eq!(nearest.offsets.len(), rays.len() + 1);
            for (i, ray) in rays.iter().enumerate() {
                let of = all.of(i);
                let expected: &[Hit] = &of[..k.min(of.len())];
                assert_eq!(bits(nearest.of(i)), bits(expected), "{k} of {ray:?}");
            }
        }
        // One ray by itself has the index 0.
        for ray in rays.iter().take(50) {
            structure.all_hits(ray, options, $filter, &mut hits);
            let of = hits.clone();
            structure.nearest_hits(ray, 3, options, $filter, &mut hits);
            assert_eq!(bits(&hits), bits(&of[..of.len().min(3)]), "{ray:?}");
        }
        all.hits.len()
    }};
}

fn bits(hits: &[Hit]) -> Vec<[u32; 8]> {
    hits.iter().map(|hit| bytemuck::cast(*hit)).collect()
}

fn check_all(blas: &Blas, rays: &[Ray]) -> usize {
    let sieve =
        filter(&|index: u32, _: &Ray, hit: &Hit| !(index + hit.primitive).is_multiple_of(3));
    let mut count = 0;
    for cull in Cull::ALL {
        let options = TraceOptions { cull, ..TraceOptions::default() };
        count += check!(blas, rays, &options, &AcceptAll);
        check!(blas, rays, &options, &sieve);
    }
    count
}

#[test]
fn they_are_the_first_of_all_hits_in_every_build() {
    let layers = (0..200).fold(Mesh::default(), |mut mesh, i| {
        // Forty at every height, and each twice.
        let z = (i % 5) as f32 * 0.25 - 0.5;
        let corners = [[-1.0, -1.0, z], [1.0, -1.0, z], [-1.0, 1.0, z]].map(Vec3::from);
        mesh.push(corners);
        mesh.push(corners);
        mesh
    });
    let meshes = [
        soup(101, 700, 0.3),
        soup(102, 60, 1.0).merged(&soup(103, 500, 0.05)),
        sphere(10),
        grid_box(4).merged(&grid_box(4)),
        needles(104, 300),
        degenerate(105, 200),
        layers,
    ];
    for mesh in &meshes {
        let rays = rays(106, 240, mesh);
        for build in all_builds() {
            for isa in IsaLevel::available() {
                let options = BuildOptions { isa: Some(isa), reference_budget: Some(4.0), ..build };
                // Two geometries, so that triangles of different ones are equally near.
                let (first, second) = mesh.indices.split_at(mesh.indices.len() / 3);
                let part = TriangleMesh { opaque: false, ..mesh.geometry() };
                let parts = [first, second].map(|indices| TriangleMesh { indices, ..part });
                let hits = check_all(&Blas::build(&parts, &options).unwrap(), &rays);
                assert!(hits > 50, "{hits}");
            }
        }
    }
}

#[test]
fn they_are_those_of_brute_force() {
    let mesh = soup(107, 500, 0.5);
    let mut random = Random::new(108);
    for isa in IsaLevel::available() {
        let blas = mesh.blas(isa);
        let mut hits = vec![];
        for _ in 0..300 {
            let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
            blas.nearest_hits(&ray, 4, &TraceOptions::default(), &AcceptAll, &mut hits);
            assert!(hits.windows(2).all(|pair| pair[0].precedes(&pair[1])), "{hits:?}");
            let possible = crossings(&mesh, &ray);
            let reached = if hits.len() < 4 { f64::INFINITY } else { f64::from(hits[3].t) };
            let found = |triangle| hits.iter().any(|hit| hit.primitive as usize == triangle);
            for c in possible.iter().filter(|c| c.is_surely_hit(&ray)) {
                assert!(found(c.triangle) || c.t + c.t_error >= reached, "{ray:?} misses {c:?}");
            }
            for hit in &hits {
                assert!(possible.iter().any(|c| c.triangle == hit.primitive as usize), "{hit:?}");
            }
        }
    }
}

#[test]
fn instances_are_listed_too() {
    let sieve = filter(&|index: u32, _: &Ray, hit: &Hit| (index ^ hit.instance).is_multiple_of(2));
    for isa in IsaLevel::available() {
        let (tlas, flat, _) = instances::scene(isa);
        let rays = rays(109, 400, &flat);
        assert!(check!(&tlas, &rays, &TraceOptions::default(), &AcceptAll) > 1000);
        let mesh = soup(110, 300, 0.3);
        let geometry = TriangleMesh { opaque: false, ..mesh.geometry() };
        let blas = Arc::new(Blas::build(&[geometry], &with_isa(isa)).unwrap());
        // The same three times, so that every hit is a tie, and one alone.
        for count in [3, 1] {
            let turned = Affine3A::from_scale(Vec3::new(1.0, -2.0, 0.5));
            let instances = vec![Instance::new(0, turned); count];
            let tlas = Tlas::build(vec![blas.clone()], &instances, &with_isa(isa)).unwrap();
            let options = TraceOptions { cull: Cull::Back, ..TraceOptions::default() };
            assert!(check!(&tlas, &rays, &options, &AcceptAll) > 100 * count);
            assert!(check!(&tlas, &rays, &options, &sieve) > 50 * count);
            assert_eq!(check!(&tlas, &rays, &TraceOptions { mask: 0, ..options }, &AcceptAll), 0);
        }
    }
}

#[test]
fn the_filter_is_asked_only_for_what_would_be_listed() {
    // Long triangles, so that spatial splits put each into many leaves.
    let mesh = needles(111, 400);
    for quality in QUALITIES {
        let options = BuildOptions { quality, reference_budget: Some(8.0), ..Default::default() };
        let geometry = TriangleMesh { opaque: false, ..mesh.geometry() };
        let blas = Blas::build(&[geometry], &options).unwrap();
        let mut random = Random::new(112);
        for _ in 0..200 {
            let target = mesh.triangle(random.below(mesh.indices.len()))[1];
            let ray = Ray::new(Vec3::splat(3.0), target - Vec3::splat(3.0));
            let accepted = Mutex::new(BTreeSet::new());
            let accept = |_: u32, _: &Ray, hit: &Hit| {
                // Never again for what is listed.
                assert!(accepted.lock().unwrap().insert(hit.primitive));
                true
            };
            let accept = filter(&accept);
            let mut hits = vec![];
            ask(&blas, &ray, usize::MAX, &accept, &mut hits);
            assert_eq!(accepted.lock().unwrap().len(), hits.len());
            let never = filter(&|_: u32, _: &Ray, _: &Hit| panic!("asked for nothing"));
            ask(&blas, &ray, 0, &never, &mut hits);
            assert!(hits.is_empty());
        }
    }
}

fn ask(blas: &Blas, ray: &Ray, k: usize, filter: &impl CandidateFilter, hits: &mut Vec<Hit>) {
    blas.nearest_hits(ray, k, &TraceOptions::default(), filter, hits);
}
