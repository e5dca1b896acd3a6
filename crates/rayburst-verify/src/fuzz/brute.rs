//! Brute force that gives the very bits: the triangle test of plain Rust on every triangle, and of
//! the nearest the one with the smallest indices.
//!
//! The ray is scaled as `rayburst-accel` scales it: by the power of two that brings the longest
//! component of the direction to between one and two.

use rayburst_accel::{Blas, Cull, TriangleMesh};
use rayburst_math::{Hit, HitKind, Ray};
use rayburst_simd::{Isa, Scalar, ShearRay, TriangleHits, Triangles4};

use super::corners;

/// Origins beyond this are misses.
const MAX_ORIGIN: f32 = (1u128 << 90) as f32;

/// The nearest hits of rays; `blas` tells which triangles can be hit at all.
pub(super) fn closest(
    blas: &Blas,
    geometries: &[TriangleMesh<'_>],
    rays: &[Ray],
    cull: Cull,
) -> Vec<Hit> {
    let mut triangles = vec![];
    for (geometry, mesh) in geometries.iter().enumerate() {
        for primitive in 0..mesh.indices.len() {
            if blas.triangle(geometry as u32, primitive as u32).is_some() {
                triangles.push((geometry as u32, primitive as u32, block(mesh, primitive)));
            }
        }
    }
    rays.iter().map(|ray| nearest(&triangles, ray, cull)).collect()
}

/// A triangle in the first lane.
fn block(mesh: &TriangleMesh<'_>, primitive: usize) -> Triangles4 {
    let mut block = Triangles4 { vertices: [[[f32::NAN; 4]; 3]; 3], ids: [0; 4] };
    for (corner, p) in block.vertices.iter_mut().zip(corners(mesh, primitive)) {
        for axis in 0..3 {
            corner[axis][0] = p[axis];
        }
    }
    block
}

fn nearest(triangles: &[(u32, u32, Triangles4)], ray: &Ray, cull: Cull) -> Hit {
    if !ray.is_valid() || ray.origin.abs().max_element() > MAX_ORIGIN {
        return Hit::MISS;
    }
    // Subnormal directions are lifted first.
    let subnormal = ray.direction.abs().max_element() < f32::MIN_POSITIVE;
    let lift = if subnormal { 2f32.powi(64) } else { 1.0 };
    let direction = ray.direction * lift;
    let exponent = (direction.abs().max_element().to_bits() >> 23).clamp(1, 253) as i32 - 127;
    let scale = 2f32.powi(-exponent);
    let shear = ShearRay::new(&ray.origin.to_array(), &direction.to_array(), scale);
    let finite = |t: f32| t.clamp(-f32::MAX, f32::MAX);
    let internal = |t: f32| finite(finite(t) / scale / lift);
    // Several distances may be the same subnormal number.
    let subnormal = ray.t_max.abs() < f32::MIN_POSITIVE;
    let t_max = if subnormal { ray.t_max.next_up() } else { ray.t_max };
    let (t_min, t_max) = (internal(ray.t_min), internal(t_max));
    let mut best = Hit::MISS;
    for &(geometry, primitive, ref block) in triangles {
        let mut hits = TriangleHits::NONE;
        if Scalar.triangles4(block, &shear, t_min, t_max, &mut hits) & 1 == 0 {
            continue;
        }
        let front = hits.front & 1 != 0;
        if cull == Cull::Both || cull == (if front { Cull::Front } else { Cull::Back }) {
            continue;
        }
        let hit = Hit {
            t: (hits.t[0] + 0.0) * scale * lift,
            u: hits.u[0],
            v: hits.v[0],
            primitive,
            geometry,
            instance: 0,
            kind: if front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK },
            reserved: 0,
        };
        if ray.t_min <= hit.t && hit.t <= ray.t_max && (!best.is_hit() || hit.precedes(&best)) {
            best = hit;
        }
    }
    best
}
