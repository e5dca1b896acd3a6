//! The naive search: a ray against every triangle, in `f64` (chapter 26.1: loop over all n
//! primitives, keep the nearest hit). The oracle of every structure, and far too slow for pictures.

use rayburst_accel::CandidateFilter;
use rayburst_math::{Hit, HitKind, Ray, glam::DVec3};
use rayburst_scene::FlatScene;

/// The nearest hit among all triangles of a scene that the filter accepts; it is asked for all.
pub fn trace_naive(scene: &FlatScene, ray: &Ray, filter: &impl CandidateFilter) -> Hit {
    let mut best = Hit::MISS;
    for (instance, record) in scene.instances.iter().enumerate() {
        for geometry in 0..record.geometry_count {
            let source = &scene.geometries[(record.first_geometry + geometry) as usize];
            for primitive in 0..source.primitive.indices.len() as u32 {
                let instance = instance as u32;
                let triangle = scene.world_triangle(instance, geometry, primitive);
                let Some((t, u, v, clockwise)) =
                    intersect(triangle.points.map(|p| p.as_dvec3()), ray)
                else {
                    continue;
                };
                let front = clockwise == (record.object_to_world.matrix3.determinant() < 0.0);
                let kind = if front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK };
                let hit = Hit { t, u, v, primitive, geometry, instance, kind, reserved: 0 };
                if hit.precedes(&best) && filter.accept(0, ray, &hit) {
                    best = hit;
                }
            }
        }
    }
    best
}

/// Distance, barycentric coordinates and winding of a ray's hit of a triangle, edges included.
fn intersect([a, b, c]: [DVec3; 3], ray: &Ray) -> Option<(f32, f32, f32, bool)> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let [a, b, c] = [a - origin, b - origin, c - origin];
    let volume = |p: DVec3, q: DVec3| direction.dot(q.cross(p));
    let (w, u, v) = (volume(b, c), volume(c, a), volume(a, b));
    let sum = w + u + v;
    if sum == 0.0 || !((w >= 0.0 && u >= 0.0 && v >= 0.0) || (w <= 0.0 && u <= 0.0 && v <= 0.0)) {
        return None;
    }
    let point = (w * a + u * b + v * c) / sum;
    let t = (point.dot(direction) / direction.length_squared()) as f32;
    let inside = ray.t_min <= t && t <= ray.t_max;
    inside.then_some((t, (u / sum) as f32, (v / sum) as f32, sum < 0.0))
}
