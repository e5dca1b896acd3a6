//! What each shader type may do.

use glam::Vec3;
use rayburst_accel::RayFlags;
use rayburst_math::Ray;
use rayburst_pipeline::{HitGroup, RwBuffer, ShaderTable};

fn main() {
    let storage = RwBuffer::<u32>::new(4);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    let inner = table.callable(|shader, data: &mut f32| *data += shader.launch_index().x as f32);
    let callable = table.callable(move |shader, data: &mut f32| shader.call_shader(inner, data));
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    table.miss("miss", move |miss, payload: &mut u32| {
        miss.call_shader(callable, &mut 0.0);
        miss.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, payload);
    });
    let triangles = HitGroup::triangles("triangles")
        .any_hit(|hit, payload: &mut u32| {
            *payload += storage.atomic_add(0, 1);
            hit.ignore_hit()
        })
        .closest_hit(move |hit, payload| {
            hit.call_shader(callable, &mut 0.0);
            hit.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, payload);
        });
    table.hit(&triangles, ());
    let procedural = HitGroup::<u32, [f32; 8]>::procedural("procedural", |shader| {
        storage.atomic_add(1, shader.payload().copied().unwrap_or(0));
        shader.report_hit(1.0, 0, [0.0; 8]);
    });
    table.hit(&procedural, ());
    table.ray_generation(move |launch| {
        launch.call_shader(callable, &mut 0.0);
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut 0);
    });
    assert!(table.build(31).is_ok());
}
