//! One triangle: the smallest program with shaders.

use std::sync::Arc;

use rayburst::prelude::*;

mod common;

use common::{Eye, Result, arguments, picture, save};

// ANCHOR: structure
/// A structure of two levels: one triangle, placed once.
fn triangle() -> Result<Tlas> {
    let corners = [Vec3::new(-1.0, -0.7, 0.0), Vec3::new(1.0, -0.7, 0.0), Vec3::new(0.0, 1.0, 0.0)];
    let mesh = TriangleMesh::new(&corners, &[[0, 1, 2]]);
    let blas = Blas::build(&[mesh], &BuildOptions::default())?;
    let instances = [Instance::new(0, Affine3A::IDENTITY)];
    Ok(Tlas::build(vec![Arc::new(blas)], &instances, &BuildOptions::default())?)
}
// ANCHOR_END: structure

/// The triangle as seen by so many rays a pixel.
pub(crate) fn render(size: (u32, u32), samples: u32) -> Result<RgbImage> {
    let tlas = triangle()?;
    let eye = Eye::look_at(Vec3::new(0.0, 0.1, 3.4), Vec3::new(0.0, 0.1, 0.0), 40.0);
    let texels = RwTexture::<Vec3>::new(size.0, size.1);

    // ANCHOR: shaders
    let mut table = ShaderTable::new();
    let eye_ray = table.ray_type::<Vec3>("eye", 0, 1, 0);

    table.miss("backdrop", |miss, color: &mut Vec3| {
        let up = 0.5 + miss.world_ray().direction.y;
        *color = Vec3::new(0.02, 0.03, 0.06).lerp(Vec3::new(0.16, 0.22, 0.34), up);
    });

    let group = HitGroup::triangles("triangle").closest_hit(|hit, color: &mut Vec3| {
        let Barycentrics { u, v } = hit.attributes();
        *color = Vec3::new(1.0 - u - v, u, v);
    });
    table.hit(&group, ());
    // ANCHOR_END: shaders

    // ANCHOR: generate
    let generate = table.ray_generation(|launch| {
        let mut sum = Vec3::ZERO;
        for sample in 0..samples {
            let (ray, _) = eye.ray(launch.launch_index(), launch.launch_dimensions(), sample);
            let mut color = Vec3::ZERO;
            launch.trace_ray(eye_ray, RayFlags::empty(), 0xFF, &ray, &mut color);
            sum += color;
        }
        texels.store(launch.launch_index().truncate(), sum / samples as f32);
    });
    // ANCHOR_END: generate

    // ANCHOR: dispatch
    table.build(1)?.dispatch_rays(&tlas, generate, size.0, size.1, 1)?;
    // ANCHOR_END: dispatch
    Ok(picture(&texels, size))
}

fn main() -> Result<()> {
    let (path, size) = arguments("hello_triangle", (640, 480))?;
    save(&render(size, 16)?, path)
}
