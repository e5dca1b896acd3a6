//! What builders do with any input: defects, depth, memory, determinism.

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, Blas, BuildControl, BuildError, BuildOptions, BuildQuality, Builder, Curve,
    IsaLevel, MAX_COORDINATE, TraceOptions, TriangleMesh,
};
use rayburst_math::{Hit, Ray};

use crate::meshes::{Mesh, QUALITIES, Random, all_builds, ray_at, soup, sphere, with_quality};

const ANY: TraceOptions = TraceOptions::DEFAULT;

/// Builds in every way and validates; returns the default one.
fn build(mesh: &Mesh) -> Blas {
    for options in all_builds() {
        let blas = Blas::build(&[mesh.geometry()], &options).unwrap();
        let (stats, report) = (blas.stats(), blas.validate().unwrap());
        assert_eq!(stats.primitives + stats.inactive, mesh.indices.len());
        assert_eq!(
            (stats.nodes, stats.leaves, stats.depth),
            (report.nodes, report.leaves, report.depth)
        );
        assert_eq!((stats.primitives, stats.references), (report.primitives, report.references));
        assert!(stats.references as f64 <= 1.5 * stats.primitives as f64, "{stats:?}");
        // The sums are the same up to the order of additions.
        assert!((stats.sah_cost - report.sah_cost).abs() <= 1e-4 * report.sah_cost, "{stats:?}");
    }
    mesh.blas(IsaLevel::detect())
}

#[test]
fn nothing_and_almost_nothing() {
    let empty = Blas::build(&[], &BuildOptions::default()).unwrap();
    empty.validate().unwrap();
    assert!(empty.bounds().is_empty() && empty.geometry_count() == 0);
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(empty.closest_hit(&ray, &ANY, &AcceptAll), Hit::MISS);
    for count in 1..140 {
        let blas = build(&soup(count, count as usize, 0.5));
        assert_eq!(blas.stats().primitives, count as usize);
    }
}

#[test]
fn indices_out_of_range_are_named() {
    let positions = [Vec3::ZERO; 3];
    let good = TriangleMesh::new(&positions, &[[0, 1, 2]]);
    let bad = TriangleMesh::new(&positions, &[[0, 1, 2], [0, 1, 2], [0, 3, 7]]);
    let error = Blas::build(&[good, bad], &BuildOptions::default()).unwrap_err();
    assert_eq!(
        error,
        BuildError::IndexOutOfRange { geometry: 1, primitive: 2, index: 3, vertices: 3 }
    );
    assert!(error.to_string().contains("triangle 2 of geometry 1"));
}

#[test]
fn indices_out_of_range_are_named_by_every_builder() {
    let positions = [Vec3::ZERO; 3];
    let bad = TriangleMesh::new(&positions, &[[0, 1, 2], [0, 1, 2], [0, 3, 7]]);
    for options in all_builds() {
        assert_eq!(
            Blas::build(&[bad, bad], &options).unwrap_err(),
            BuildError::IndexOutOfRange { geometry: 0, primitive: 2, index: 3, vertices: 3 }
        );
    }
}

#[test]
fn no_spacing_makes_a_deep_tree() {
    // Gaps that grow: each neighbour is nearer to the one before than to the one behind.
    let mut mesh = Mesh::default();
    for i in 0..20_000 {
        let p = Vec3::new((i * i) as f32, 0.0, 0.0);
        mesh.push([p, p + Vec3::Y, p + Vec3::Z]);
    }
    assert!(build(&mesh).stats().depth <= 64);
}

#[test]
fn a_build_is_cancelled_whatever_the_builder() {
    let mesh = soup(56, 30_000, 0.02);
    let control = BuildControl::new();
    for options in all_builds() {
        let watched = BuildOptions { control: Some(&control), ..options };
        Blas::build(&[mesh.geometry()], &watched).unwrap();
        assert_eq!(control.progress(), 1.0);
    }
    control.cancel();
    for options in all_builds() {
        let watched = BuildOptions { control: Some(&control), ..options };
        let error = Blas::build(&[mesh.geometry()], &watched).unwrap_err();
        assert_eq!(error, BuildError::Cancelled);
    }
}

#[test]
fn a_hundred_thousand_equal_codes_make_a_bounded_tree() {
    let mut mesh = Mesh::default();
    for i in 0..100_000 {
        let p = Vec3::splat(1e-9 * (i % 7) as f32);
        mesh.push([p, p + Vec3::X, p + Vec3::Y]);
    }
    // Two vertices of no triangle spread the grid.
    mesh.positions.extend([Vec3::splat(-1e15), Vec3::splat(1e15)]);
    build(&mesh);
}

#[test]
fn the_fast_build_numbers_triangles_through_geometries() {
    let meshes = [soup(61, 300, 0.2), Mesh::default(), soup(62, 1, 0.2), soup(63, 9000, 0.02)];
    let geometries = meshes.each_ref().map(Mesh::geometry);
    let options = |quality| BuildOptions { quality, ..BuildOptions::default() };
    let [fast, slow] = [BuildQuality::Fast, BuildQuality::Balanced]
        .map(|quality| Blas::build(&geometries, &options(quality)).unwrap());
    fast.validate().unwrap();
    let mut random = Random::new(64);
    let mut hits = 0;
    for _ in 0..2000 {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        let hit = fast.closest_hit(&ray, &ANY, &AcceptAll);
        assert_eq!(hit, slow.closest_hit(&ray, &ANY, &AcceptAll));
        hits += u32::from(hit.is_hit());
    }
    assert!(hits > 200);
}

#[test]
fn triangles_that_are_not_finite_or_have_no_area_are_inactive() {
    let mut mesh = sphere(8);
    let active = mesh.indices.len();
    let corner = Vec3::new(0.1, 0.2, 0.3);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2.0 * MAX_COORDINATE] {
        for axis in 0..3 {
            let mut wrong = corner;
            wrong[axis] = bad;
            mesh.push([corner, wrong, Vec3::ONE]);
        }
    }
    mesh.push([corner; 3]);
    mesh.push([corner, corner, Vec3::ONE]);
    mesh.push([Vec3::ZERO, Vec3::ONE, 2.0 * Vec3::ONE]);
    let blas = build(&mesh);
    assert_eq!((blas.stats().primitives, blas.stats().inactive), (active, 15));
    assert_eq!(blas.triangle(0, active as u32), None);
    assert_eq!(blas.triangle(0, 0), Some(mesh.triangle(0)));
    assert_eq!(blas.triangle(0, mesh.indices.len() as u32), None);
    assert_eq!(blas.triangle(1, 0), None);
    let mut random = Random::new(51);
    for _ in 0..500 {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        let hit = blas.closest_hit(&ray, &ANY, &AcceptAll);
        assert!(!hit.is_hit() || (hit.primitive as usize) < active);
    }
}

#[test]
fn coincident_triangles_make_a_shallow_tree() {
    let mut mesh = Mesh::default();
    for _ in 0..1000 {
        mesh.push([Vec3::ZERO, Vec3::X, Vec3::Y]);
    }
    let blas = build(&mesh);
    assert!(blas.stats().depth <= 8, "{:?}", blas.stats());
    let mut hits = vec![];
    blas.all_hits(&Ray::new(Vec3::new(0.2, 0.2, 1.0), -Vec3::Z), &ANY, &AcceptAll, &mut hits);
    assert!(hits.iter().map(|h| h.primitive).eq(0..1000));
}

#[test]
fn depth_is_bounded_for_exponentially_spaced_triangles() {
    // Each plane of the heuristic splits off one triangle or few.
    for base in [1.05f64, 1.5, 2.0] {
        let mut mesh = Mesh::default();
        let mut x = 1e-15f64;
        while x < 1e17 && mesh.indices.len() < 3000 {
            let p = Vec3::new(x as f32, 0.0, 0.0);
            let e = (x * 0.01) as f32;
            mesh.push([p, p + Vec3::Y * e, p + Vec3::Z * e]);
            x *= base;
        }
        let blas = build(&mesh);
        assert!(blas.stats().depth <= 64, "{base}: {:?}", blas.stats());
        for i in 0..mesh.indices.len() {
            let [a, b, c] = mesh.triangle(i);
            let target = (a + b + c) / 3.0;
            let ray = Ray::new(target - Vec3::X * a.x * 0.01, Vec3::X);
            assert_eq!(blas.closest_hit(&ray, &ANY, &AcceptAll).primitive as usize, i);
        }
    }
}

#[test]
fn what_rays_meet_does_not_depend_on_threads() {
    let mesh = soup(52, 150_000, 0.02);
    let trace = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let blas = pool.install(|| mesh.blas(IsaLevel::detect()));
        let mut random = Random::new(53);
        let rays: Vec<Ray> = (0..500).map(|_| ray_at(&mut random, Vec3::ZERO, 1.0)).collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counts = vec![Default::default(); rays.len()];
        blas.closest_hits_counted(&rays, &mut hits, &mut counts, &ANY, &AcceptAll);
        let mut stats = blas.stats();
        stats.seconds = 0.0;
        (stats, hits, counts)
    };
    let one = trace(1);
    assert_eq!(one, trace(2));
    assert_eq!(one, trace(7));
}

#[test]
fn better_quality_is_no_worse_and_memory_is_small() {
    let mesh = soup(54, 20_000, 0.05);
    let stats = |quality| Blas::build(&[mesh.geometry()], &with_quality(quality)).unwrap().stats();
    let [fast, balanced, best] = QUALITIES.map(stats);
    assert!(balanced.sah_cost <= 1.02 * fast.sah_cost, "{balanced:?} {fast:?}");
    assert!(best.sah_cost <= 1.02 * balanced.sah_cost, "{best:?} {balanced:?}");
    assert!(balanced.bytes <= 66 * 20_000, "{balanced:?}");
    // The heuristic above a curve is better than the curve, worse than the heuristic throughout.
    for curve in [Curve::Morton, Curve::Hilbert] {
        let of = |builder| {
            let options = BuildOptions { builder: Some(builder), curve, ..BuildOptions::default() };
            Blas::build(&[mesh.geometry()], &options).unwrap().stats()
        };
        let [lbvh, hlbvh, ploc] = [Builder::Lbvh, Builder::Hlbvh, Builder::Ploc].map(of);
        assert!(hlbvh.sah_cost < 0.97 * lbvh.sah_cost, "{hlbvh:?} {lbvh:?}");
        assert!(balanced.sah_cost < hlbvh.sah_cost, "{hlbvh:?} {balanced:?}");
        assert!(ploc.sah_cost < 0.97 * lbvh.sah_cost, "{ploc:?} {lbvh:?}");
    }
    // Eight-wide nodes are at least half full.
    assert!(balanced.nodes * 4 <= balanced.leaves + balanced.nodes, "{balanced:?}");
}

#[test]
fn any_bits_as_positions_and_rays_are_harmless() {
    let mut random = Random::new(55);
    // Bits of any number, numbers of any exponent, and repeated ordinary ones.
    let mut number = |kind: usize| match kind % 3 {
        0 => f32::from_bits(random.bits() as u32),
        1 => (random.unit() - 0.5) * 2f32.powi((random.bits() % 250) as i32 - 125),
        _ => (random.bits() % 5) as f32 - 2.0,
    };
    for round in 0..60 {
        let mut vector = |i: usize| {
            let kind = if round % 4 == 3 { i } else { round };
            Vec3::new(number(kind), number(kind), number(kind))
        };
        let mut mesh = Mesh::default();
        for i in 0..200 {
            mesh.push([vector(i), vector(i), vector(i)]);
        }
        let rays: Vec<Ray> = (0..200).map(|i| Ray::new(vector(i), vector(i + 1))).collect();
        build(&mesh);
        let mut first: Option<Vec<Hit>> = None;
        for isa in IsaLevel::available() {
            let blas = mesh.blas(isa);
            let mut hits = vec![Hit::MISS; rays.len()];
            blas.closest_hits(&rays, &mut hits, &ANY, &AcceptAll);
            for (ray, hit) in rays.iter().zip(&hits) {
                assert_eq!(blas.any_hit(ray, &ANY, &AcceptAll), hit.is_hit(), "{ray:?}");
                assert!(!hit.is_hit() || (ray.t_min <= hit.t && hit.t <= ray.t_max), "{hit:?}");
                assert!(!hit.is_hit() || hit.t.is_finite() && ray.is_valid(), "{hit:?}");
            }
            assert_eq!(first.get_or_insert_with(|| hits.clone()), &hits, "{}", isa.name());
        }
    }
}

#[test]
fn the_cost_of_a_toy_tree_is_that_by_hand() {
    // Four times the halves of a unit square, at x = 0 and at x = 9: two leaves of half area 1 under a
    // root of half area 10 · 1.
    let mut mesh = Mesh::default();
    for i in 0..8 {
        let corner = Vec3::X * if i < 4 { 0.0 } else { 9.0 };
        let far = corner + Vec3::new(1.0, 1.0, 0.0);
        mesh.push([corner, corner + if i % 2 == 0 { Vec3::X } else { Vec3::Y }, far]);
    }
    for options in all_builds() {
        let blas = Blas::build(&[mesh.geometry()], &options).unwrap();
        let stats = blas.stats();
        assert_eq!((stats.nodes, stats.leaves, stats.depth), (1, 2, 1));
        assert!((stats.sah_cost - (1.0 + 2.0 * 0.1)).abs() < 1e-6, "{stats:?}");
        // One leaf alone, as large as its root.
        let mut one = mesh.clone();
        one.indices.truncate(4);
        let stats = Blas::build(&[one.geometry()], &options).unwrap().stats();
        assert_eq!((stats.leaves, stats.sah_cost), (1, 2.0));
    }
}

#[test]
fn reinsertion_takes_cost_off_binary_trees_and_is_refused_without_one() {
    // Large triangles among small ones, which a split from the top puts badly.
    let (mut mesh, large) = (soup(3, 5000, 0.02), soup(4, 500, 0.5));
    let first = mesh.positions.len() as u32;
    mesh.indices.extend(large.indices.iter().map(|corners| corners.map(|i| first + i)));
    mesh.positions.extend(&large.positions);
    for builder in Builder::ALL {
        let with = |passes| {
            let options = BuildOptions {
                quality: BuildQuality::Best,
                builder: Some(builder),
                reinsertion: Some(passes),
                ..BuildOptions::default()
            };
            Blas::build(&[mesh.geometry()], &options)
        };
        let plain = with(0).unwrap();
        if matches!(builder, Builder::Lbvh | Builder::Hlbvh) {
            assert_eq!(with(1).unwrap_err(), BuildError::NoBinaryTree { builder });
            continue;
        }
        let better = with(8).unwrap();
        better.validate().unwrap();
        let (before, after) = (plain.stats(), better.stats());
        assert_eq!((before.leaves, before.references), (after.leaves, after.references));
        assert!(after.sah_cost < before.sah_cost, "{builder:?}: {before:?} {after:?}");
    }
}
