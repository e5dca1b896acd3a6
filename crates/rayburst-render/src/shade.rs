//! Your own `shade`: the chapter's trace(), shade() and rayTraceImage() with shade() left to you
//! (chapter 26.1, the pseudo-code after Fig. 26.2).
//!
//! [`ray_trace_image`] sends an eye ray through each pixel, [`Tracer::trace`] finds what a ray meets
//! and asks your closure for its radiance; the closure may trace further rays. It runs on all threads,
//! one ray at a time: for speed there are batches, for understanding there is this.

use rayburst_image::RgbImage;
use rayburst_math::{
    Hit, Ray,
    glam::{Vec2, Vec3},
};
use rayburst_scene::{Camera, FlatScene, Material, Surface};
use rayon::prelude::*;

/// What a ray met, or `None`, to radiance.
pub type Shade<'a> = dyn Fn(&Tracer<'_>, &Ray, Option<&Surface>) -> Vec3 + Sync + 'a;

/// Traces the rays of a [`Shade`] closure.
#[derive(Clone, Copy)]
pub struct Tracer<'a> {
    scene: &'a FlatScene,
    shade: &'a Shade<'a>,
    depth: u32,
    max_depth: u32,
}

impl<'a> Tracer<'a> {
    /// A tracer whose rays may be `max_depth` deep; the first one has depth 1.
    pub fn new(scene: &'a FlatScene, max_depth: u32, shade: &'a Shade<'a>) -> Self {
        Self { scene, shade, depth: 0, max_depth }
    }

    /// The radiance that comes along a ray: what the closure says of the nearest thing it meets.
    /// Black beyond the maximum depth.
    pub fn trace(&self, ray: &Ray) -> Vec3 {
        if self.depth >= self.max_depth {
            return Vec3::ZERO;
        }
        let hit = self.hit(ray);
        let surface = hit.is_hit().then(|| self.scene.surface(&hit));
        (self.shade)(&Tracer { depth: self.depth + 1, ..*self }, ray, surface.as_ref())
    }

    /// The nearest hit of a ray, without shading it.
    pub fn hit(&self, ray: &Ray) -> Hit {
        self.scene.closest_hit(ray, None)
    }

    /// Whether nothing lies between a surface and a point of space.
    pub fn sees(&self, surface: &Surface, point: Vec3) -> bool {
        let origin = surface.spawn(point - surface.position);
        let ray = Ray::with_interval(origin, point - origin, 0.0, 1.0);
        !self.scene.any_hit(&ray, None)
    }

    /// The material of a surface.
    pub fn material(&self, surface: &Surface) -> &'a Material {
        &self.scene.materials[surface.material as usize]
    }

    /// The scene.
    pub fn scene(&self) -> &'a FlatScene {
        self.scene
    }

    /// The depth of the ray that is being shaded; 1 for an eye ray.
    pub fn depth(&self) -> u32 {
        self.depth
    }
}

/// A picture of what `shade` says of each pixel's eye ray, which goes through the pixel's centre. Rays
/// may be `max_depth` deep, the eye ray being the first.
pub fn ray_trace_image(
    scene: &FlatScene,
    camera: &Camera,
    size: (u32, u32),
    max_depth: u32,
    shade: impl Fn(&Tracer<'_>, &Ray, Option<&Surface>) -> Vec3 + Sync,
) -> RgbImage {
    let tracer = Tracer::new(scene, max_depth, &shade);
    let (width, height) = size;
    let mut picture = RgbImage::new(width, height, Vec3::ZERO);
    picture.pixels.par_chunks_mut(width.max(1) as usize).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let (ray, _) = camera.ray(centre, (width, height), Vec2::splat(0.5));
            *pixel = tracer.trace(&ray);
        }
    });
    picture
}
