//! Brute force over all triangles in `f64`, with the error that `f32` may make.

use glam::{DVec3, Vec3};
use rayburst_math::{Hit, Ray};

use crate::meshes::Mesh;

/// Where the supporting plane of a triangle is met.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    pub triangle: usize,
    pub t: f64,
    /// Least barycentric coordinate: negative outside.
    pub inside: f64,
    /// By how much `inside` may be off in `f32`.
    pub inside_error: f64,
    /// By how much `t` may be off in `f32`.
    pub t_error: f64,
}

impl Crossing {
    pub fn is_surely_hit(&self, ray: &Ray) -> bool {
        self.inside > self.inside_error
            && self.t - self.t_error > f64::from(ray.t_min)
            && self.t + self.t_error < f64::from(ray.t_max)
    }

    pub fn may_be_hit(&self, ray: &Ray) -> bool {
        self.inside >= -self.inside_error
            && self.t + self.t_error >= f64::from(ray.t_min)
            && self.t - self.t_error <= f64::from(ray.t_max)
    }
}

/// How a ray meets a triangle's plane; `None` if it runs along it.
pub fn crossing(index: usize, corners: [Vec3; 3], ray: &Ray) -> Option<Crossing> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let kz = d.abs().max_position();
    let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
    let corners = corners.map(|p| {
        let p = p.as_dvec3() - o;
        let z = p[kz];
        DVec3::new(p[kx] - d[kx] / d[kz] * z, p[ky] - d[ky] / d[kz] * z, z)
    });
    let [a, b, c] = corners;
    let edge = |p: DVec3, q: DVec3| p.x * q.y - p.y * q.x;
    let (u, v, w) = (edge(b, c), edge(c, a), edge(a, b));
    let det = edge(b - a, c - a);
    if det == 0.0 {
        return None;
    }
    let t = (u * a.z + v * b.z + w * c.z) / (det * d[kz]);
    let reach = corners.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let around = corners.iter().map(|p| p.z.abs()).fold(reach, f64::max);
    let size = (b - a).abs().max((c - a).abs()).max((c - b).abs());
    let epsilon = f64::from(f32::EPSILON);
    // Corners move sideways by a few roundings of their distance; the edge functions themselves
    // round products as large as the corners' offsets from the ray.
    let lateral = 4.0 * epsilon * around;
    let offset = corners.iter().map(|p| p.truncate().abs().max_element()).fold(0.0, f64::max);
    let area_error =
        8.0 * lateral * (size.truncate().max_element() + lateral) + 2.0 * epsilon * offset * offset;
    let inside_error = area_error / det.abs();
    let t_error = ((size.z * inside_error).min(size.z) + 8.0 * epsilon * around) / d[kz].abs();
    Some(Crossing {
        triangle: index,
        t,
        inside: (u / det).min(v / det).min(w / det),
        inside_error,
        t_error: if inside_error > 0.1 { f64::INFINITY } else { t_error },
    })
}

/// All crossings of a ray with a mesh that may be hits.
pub fn crossings(mesh: &Mesh, ray: &Ray) -> Vec<Crossing> {
    (0..mesh.indices.len())
        .filter_map(|index| crossing(index, mesh.triangle(index), ray))
        .filter(|crossing| crossing.may_be_hit(ray))
        .collect()
}

/// Whether a closest hit is what brute force finds, up to the error of `f32`.
pub fn check_closest(mesh: &Mesh, ray: &Ray, hit: &Hit) -> Result<(), String> {
    let candidates = crossings(mesh, ray);
    let describe = |what: &str| format!("{what}: {ray:?} {hit:?}\n{candidates:?}");
    let reached = if hit.is_hit() {
        let Some(own) = candidates.iter().find(|c| c.triangle == hit.primitive as usize) else {
            return Err(describe("a triangle that is not hit"));
        };
        if (f64::from(hit.t) - own.t).abs() > own.t_error {
            return Err(describe("a wrong distance"));
        }
        f64::from(hit.t)
    } else {
        f64::INFINITY
    };
    if let Some(missed) =
        candidates.iter().find(|c| c.is_surely_hit(ray) && c.t + c.t_error < reached)
    {
        return Err(describe(&format!("missed triangle {}", missed.triangle)));
    }
    Ok(())
}
