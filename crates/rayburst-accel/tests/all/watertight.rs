//! No ray leaves a closed mesh, wherever it is aimed.

use glam::Vec3;
use rayburst_accel::{AcceptAll, IsaLevel, TraceOptions};
use rayburst_math::Ray;

use crate::meshes::{Mesh, Random, grid_box, sphere};

/// Rays from inside at vertices, at points of edges, and anywhere.
fn rays_from_inside(mesh: &Mesh, origins: &[Vec3], seed: u64, count: usize) -> Vec<Ray> {
    let mut random = Random::new(seed);
    (0..count)
        .map(|i| {
            let origin = origins[random.below(origins.len())];
            let [a, b, c] = mesh.triangle(random.below(mesh.indices.len()));
            let target = match i % 4 {
                0 => a,
                1 => a + (b - a) * 0.5,
                2 => a + (c - a) * random.unit(),
                _ => a + (b - a) * (0.5 * random.unit()) + (c - a) * (0.5 * random.unit()),
            };
            Ray::new(origin, target - origin)
        })
        .collect()
}

fn assert_closed(name: &str, mesh: &Mesh, origins: &[Vec3]) {
    for isa in IsaLevel::available() {
        let blas = mesh.blas(isa);
        blas.validate().unwrap();
        let rays = rays_from_inside(mesh, origins, 23, 20_000);
        let mut hits = vec![rayburst_math::Hit::MISS; rays.len()];
        let mut any = vec![false; rays.len()];
        blas.closest_hits(&rays, &mut hits, &TraceOptions::default(), &AcceptAll);
        blas.any_hits(&rays, &mut any, &TraceOptions::default(), &AcceptAll);
        for (i, ray) in rays.iter().enumerate() {
            assert!(hits[i].is_hit() && any[i], "{name}, {}: {ray:?} leaks", isa.name());
        }
    }
}

#[test]
fn a_sphere_is_closed() {
    let mesh = sphere(40);
    assert_closed("sphere", &mesh, &[Vec3::ZERO, Vec3::new(0.3, -0.5, 0.2), Vec3::Y * 0.99]);
}

#[test]
fn an_axis_aligned_box_is_closed_along_its_axes() {
    let mesh = grid_box(8);
    // Rays from grid points run exactly along the planes of edges.
    let origins = [Vec3::ZERO, Vec3::splat(0.25), Vec3::new(0.5, 0.0, -0.75)];
    assert_closed("box", &mesh, &origins);
    for isa in IsaLevel::available() {
        let blas = mesh.blas(isa);
        for origin in origins {
            for direction in [Vec3::X, Vec3::Y, Vec3::Z] {
                for direction in [direction, -direction] {
                    let ray = Ray::new(origin, direction);
                    let hit = blas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
                    let exit = 1.0 - (origin * direction).element_sum();
                    assert_eq!(hit.t, exit, "{ray:?}");
                }
            }
        }
    }
}

#[test]
fn closed_meshes_stay_closed_far_away_tiny_and_huge() {
    let offset = Vec3::new(1e6, 2e6, -3e6);
    let lattice = |p: Vec3| (p * 64.0).round() + offset;
    assert_closed("far", &sphere(12).map(lattice), &[offset, offset + Vec3::X * 13.0]);
    for scale in [1e-6, 1e-18, 1e-30, 1e9, 1e17] {
        let scaled = |p: Vec3| p * scale;
        let origins = [Vec3::ZERO, Vec3::new(0.3, -0.5, 0.2) * scale];
        assert_closed(&format!("sphere × {scale}"), &sphere(16).map(scaled), &origins);
        assert_closed(&format!("box × {scale}"), &grid_box(4).map(scaled), &origins);
    }
}

#[test]
fn a_closed_mesh_of_needles_is_closed() {
    let stretch = |p: Vec3| p * Vec3::new(1000.0, 1.0, 0.01);
    let origins = [Vec3::ZERO, Vec3::new(-700.0, 0.1, 0.002)];
    assert_closed("stretched sphere", &sphere(24).map(stretch), &origins);
    let skew = |p: Vec3| Vec3::new(p.x + 30.0 * p.y, p.y + 20.0 * p.z, p.z);
    assert_closed("skewed box", &grid_box(5).map(skew), &[Vec3::ZERO]);
}

#[test]
fn a_closed_mesh_is_hit_from_far_outside() {
    let mesh = sphere(24);
    let blas = mesh.blas(IsaLevel::detect());
    let mut random = Random::new(29);
    for distance in [10.0, 1e3, 1e5] {
        for _ in 0..2000 {
            let origin = distance * (random.vector() + Vec3::splat(2.0));
            // The silhouette is uncertain by the rounding of the origin's distance.
            let target = 0.9 * random.vector() / 3f32.sqrt();
            let ray = Ray::new(origin, target - origin);
            let mut hits = vec![];
            blas.all_hits(&ray, &TraceOptions::default(), &AcceptAll, &mut hits);
            assert!(hits.len() >= 2, "{ray:?}: {hits:?}");
        }
    }
}
