//! 1.1 million random rays and 110 thousand rays aimed exactly at vertices and edges, against
//! brute force on eleven meshes, on every instruction set that this machine has.

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, BuildQuality, Counters, IsaLevel, Layout, TraceOptions,
    TriangleMesh,
};
use rayburst_math::{Hit, Ray, hash::Rng, warp};
use rayburst_testkit::{Oracle, TestMesh, meshes};
use rayon::prelude::*;

const RANDOM_RAYS: usize = 100_000;
const AIMED_RAYS: usize = 12_000;

/// Rays from around the mesh and from inside it; some intervals are bounded or begin behind.
fn random_rays(mesh: &TestMesh, count: usize) -> Vec<Ray> {
    let mut rng = Rng::new(0xA11);
    let bounds = mesh.bounds();
    let (centre, size) = (bounds.centre(), bounds.extent());
    (0..count)
        .map(|i| {
            let origin = centre + 1.5 * size * (rng.vec3() - 0.5);
            let target = bounds.lower + size * rng.vec3();
            let direction = match i % 4 {
                0 => target - origin,
                1 => warp::uniform_sphere(rng.vec2()),
                // Along an axis, where slab tests divide by zero.
                2 => [Vec3::X, Vec3::Y, -Vec3::Z][i / 4 % 3],
                _ => (target - origin) * 1e-3,
            };
            let reach = size.length() / direction.length();
            match i % 5 {
                0 => Ray::with_interval(origin, direction, -reach, reach),
                1 => Ray::with_interval(origin, direction, 0.1 * reach, 0.6 * reach),
                _ => Ray::new(origin, direction),
            }
        })
        .filter(Ray::is_valid)
        .collect()
}

/// Rays exactly at vertices and at points of edges, from inside a closed mesh where there is one.
fn aimed_rays(mesh: &TestMesh, count: usize) -> Vec<Ray> {
    let mut rng = Rng::new(0xA1D);
    let bounds = mesh.bounds();
    let size = bounds.extent();
    (0..count)
        .filter_map(|i| {
            let [a, b, _] = mesh.corners(rng.below(mesh.indices.len() as u32) as usize);
            let target = if i % 2 == 0 { a } else { a + (b - a) * rng.f32() };
            let origin = match mesh.inside {
                Some(inside) => inside + 0.02 * size * (rng.vec3() - 0.5),
                None => bounds.centre() + 2.0 * size * (rng.vec3() - 0.5),
            };
            let ray = Ray::new(origin, target - origin);
            ray.is_valid().then_some(ray)
        })
        .collect()
}

fn check(mesh: &TestMesh, blas: &Blas, oracle: &Oracle, rays: &[Ray], closed: bool) -> Vec<Hit> {
    let options = TraceOptions::default();
    let mut hits = vec![Hit::MISS; rays.len()];
    blas.closest_hits(rays, &mut hits, &options, &AcceptAll);
    let mut occluded = vec![false; rays.len()];
    blas.any_hits(rays, &mut occluded, &options, &AcceptAll);
    let mut counted = vec![Hit::MISS; rays.len()];
    let mut counts = vec![Counters::default(); rays.len()];
    blas.closest_hits_counted(rays, &mut counted, &mut counts, &options, &AcceptAll);
    assert_eq!(hits, counted, "{}: counting changes hits", mesh.name);
    (0..rays.len()).into_par_iter().for_each(|i| {
        let (ray, hit) = (&rays[i], &hits[i]);
        if let Err(wrong) = oracle.verdict(ray).check_hit(hit) {
            panic!("{}: {ray:?}: {hit:?}: {wrong}", mesh.name);
        }
        assert_eq!(occluded[i], hit.is_hit(), "{}: any hit of {ray:?}", mesh.name);
        assert_eq!(blas.closest_hit(ray, &options, &AcceptAll), *hit, "{}: {ray:?}", mesh.name);
        assert_eq!(blas.any_hit(ray, &options, &AcceptAll), hit.is_hit());
        assert!(!closed || hit.is_hit(), "{}: {ray:?} leaves a closed mesh", mesh.name);
    });
    hits
}

#[test]
fn every_structure_answers_as_brute_force_does() {
    let (mut random_total, mut aimed_total) = (0, 0);
    for mesh in meshes::all() {
        let oracle = Oracle::new(&mesh.positions, &mesh.indices);
        let (random, aimed) = (random_rays(&mesh, RANDOM_RAYS), aimed_rays(&mesh, AIMED_RAYS));
        random_total += random.len();
        aimed_total += aimed.len();
        let mut answers: Vec<(IsaLevel, Vec<Hit>)> = Vec::new();
        let builds = [
            (BuildQuality::Balanced, Layout::Wide),
            (BuildQuality::Best, Layout::Wide),
            (BuildQuality::Best, Layout::Compressed),
        ];
        for (isa, (quality, layout)) in
            IsaLevel::available().into_iter().flat_map(|isa| builds.map(|build| (isa, build)))
        {
            let options =
                BuildOptions { isa: Some(isa), quality, layout, ..BuildOptions::default() };
            let triangles = TriangleMesh::new(&mesh.positions, &mesh.indices);
            let blas = Blas::build(&[triangles], &options).expect("builds");
            blas.validate().expect("valid");
            let mut hits = check(&mesh, &blas, &oracle, &random, false);
            hits.extend(check(&mesh, &blas, &oracle, &aimed, mesh.inside.is_some()));
            answers.push((isa, hits));
        }
        for pair in answers.windows(2) {
            for (a, b) in pair[0].1.iter().zip(&pair[1].1) {
                assert_eq!(
                    (a.primitive, a.kind),
                    (b.primitive, b.kind),
                    "{}: {} and {} differ",
                    mesh.name,
                    pair[0].0.name(),
                    pair[1].0.name()
                );
            }
        }
    }
    assert!(random_total >= 1_000_000 && aimed_total >= 100_000, "{random_total} {aimed_total}");
}

#[test]
fn no_ray_leaves_a_closed_mesh_from_inside() {
    let mut rng = Rng::new(77);
    for mesh in meshes::all() {
        let Some(inside) = mesh.inside else { continue };
        let triangles = TriangleMesh::new(&mesh.positions, &mesh.indices);
        let blas = Blas::build(&[triangles], &BuildOptions::default()).expect("builds");
        let size = mesh.bounds().extent();
        let rays: Vec<Ray> = (0..250_000)
            .map(|_| {
                let origin = inside + 0.05 * size * (rng.vec3() - 0.5);
                Ray::new(origin, warp::uniform_sphere(rng.vec2()))
            })
            .collect();
        let mut occluded = vec![false; rays.len()];
        blas.any_hits(&rays, &mut occluded, &TraceOptions::default(), &AcceptAll);
        let leaks = occluded.iter().filter(|&&o| !o).count();
        assert_eq!(leaks, 0, "{}", mesh.name);
    }
}
