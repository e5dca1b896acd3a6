//! A recursive ray tracer that fits on a business card: Whitted's picture in one function.
//!
//! After Heckbert: "A Minimal Ray Tracer", Graphics Gems IV, 1994, whose program fits on one.

use rayburst::{
    prelude::*,
    scene::{Footprint, ShadingOptions, builtin},
};

mod common;

// ANCHOR: all
fn main() -> common::Result<()> {
    let (path, size) = common::arguments("business_card", (640, 480))?;
    let spheres = builtin::build("spheres")?;
    let scene = rayburst::flatten(&spheres)?;
    let camera = rayburst::default_camera(&spheres, &scene);
    let large = (4 * size.0, 4 * size.1);
    let radiance = ray_trace_image(&scene, &camera, large, 8, |tracer, ray, surface| {
        let Some(surface) = surface else { return scene.environment.radiance(ray.direction) };
        let point = scene.shading_point(
            surface,
            -ray.direction,
            Footprint::NONE,
            &ShadingOptions::default(),
        );
        let (mut color, wo) =
            (0.1 * 400.0 * point.base_color, point.frame.to_local(-ray.direction));
        for lamp in &scene.lights {
            let LightKind::Point { position } = lamp.kind else { continue };
            let to = position - surface.position;
            if tracer.sees(surface, position) {
                let (f, _) = point.evaluate(-ray.direction, to.normalize());
                color += f * lamp.intensity / to.length_squared();
            }
        }
        let branches = [point.bsdf.specular_reflection(wo), point.bsdf.specular_refraction(wo)];
        for branch in branches.into_iter().flatten() {
            let direction = point.frame.to_world(branch.wi);
            color += branch.weight * tracer.trace(&Ray::new(surface.spawn(direction), direction));
        }
        color
    });
    common::save(&common::develop(&common::shrink(&radiance, 4)), path)
}
// ANCHOR_END: all
