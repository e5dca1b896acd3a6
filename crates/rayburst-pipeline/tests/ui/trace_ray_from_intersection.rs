use rayburst_accel::RayFlags;
use rayburst_math::Ray;
use rayburst_pipeline::{HitGroup, ShaderTable};

fn main() {
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    let ray = Ray::new(glam::Vec3::ZERO, glam::Vec3::Z);
    let group = HitGroup::<u32, ()>::procedural("boxes", move |shader| {
        shader.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut 0);
    });
    table.hit(&group, ());
}
