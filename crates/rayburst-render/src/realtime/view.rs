//! What a frame's camera sees: rays of pixels, pixels of points.

use rayburst_math::{
    Ray, RayCone,
    glam::{Vec2, Vec3},
};
use rayburst_scene::{Camera, Projection, TextureLod};

use super::eye_rays::EyeRays;
use crate::RayFootprint;

/// A camera at one frame: with the size it is rendered at, and where in the pixels rays go through.
///
/// Frames see through a pinhole: a lens would smear what passes say of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameView {
    camera: Camera,
    size: (u32, u32),
    jitter: Vec2,
    rays: EyeRays,
    cone: RayCone,
}

impl FrameView {
    /// A view of `size` pixels; `jitter` in pixels moves the points that rays go through off the
    /// pixels' centres.
    pub fn new(camera: Camera, size: (u32, u32), jitter: Vec2) -> Self {
        let camera = Camera { aperture: 0.0, ..camera };
        let centre = 0.5 * Vec2::new(size.0 as f32, size.1 as f32);
        let (_, cone) = camera.ray(centre, size, Vec2::ZERO);
        Self { camera, size, jitter, rays: EyeRays::new(&camera, size, jitter), cone }
    }

    /// The camera, without a lens.
    #[inline]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Width and height in pixels.
    #[inline]
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Where rays go through, relative to the pixels' centres, in pixels.
    #[inline]
    pub fn jitter(&self) -> Vec2 {
        self.jitter
    }

    /// The cone of a pixel's ray, whose direction is given.
    #[inline]
    pub fn cone(&self, direction: Vec3) -> RayCone {
        match self.camera.projection {
            Projection::Perspective { .. } => {
                self.cone.off_axis(direction.dot(self.camera.frame()[2]))
            }
            Projection::Orthographic { .. } => self.cone,
        }
    }

    /// What a pixel sees at the eye.
    #[inline]
    pub fn footprint(&self, lod: TextureLod, (x, y): (u32, u32)) -> RayFootprint {
        let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + self.jitter;
        let cone = match lod {
            TextureLod::Cones => self.cone(self.rays.ray(x, y).direction),
            _ => self.cone,
        };
        RayFootprint::of_eye(lod, &self.camera, at, self.size, Vec2::ZERO, cone)
    }

    /// The ray through a pixel, its direction a unit vector.
    #[inline]
    pub fn ray(&self, x: u32, y: u32) -> Ray {
        self.rays.ray(x, y)
    }

    /// Distance of a point along the viewing direction.
    #[inline]
    pub fn depth(&self, world: Vec3) -> f32 {
        (world - self.camera.eye()).dot(self.camera.frame()[2])
    }

    /// Where the picture shows a point, in pixels, without the jitter; `None` behind the eye.
    #[inline]
    pub fn project(&self, world: Vec3) -> Option<Vec2> {
        self.camera.project(world, self.size).map(|(pixel, _)| pixel)
    }
}

#[cfg(test)]
mod tests {
    use rayburst_math::glam::Affine3A;

    use super::*;

    #[test]
    fn rays_are_the_cameras_and_points_come_back() {
        let eye = Vec3::new(3.0, 2.0, -1.0);
        let perspective = Camera::look_at(eye, Vec3::new(-1.0, 0.5, 2.0), Vec3::Y, 0.9);
        let orthographic = Camera {
            projection: Projection::Orthographic { half_height: 2.0 },
            transform: Affine3A::from_rotation_y(0.4) * perspective.transform,
            ..perspective
        };
        for camera in [perspective, orthographic] {
            for size in [(1, 1), (17, 5), (640, 360)] {
                let jitter = Vec2::new(0.2, -0.4);
                let view = FrameView::new(camera, size, jitter);
                for (x, y) in [(0, 0), (size.0 - 1, size.1 - 1), (size.0 / 2, size.1 / 3)] {
                    let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + jitter;
                    let (expected, cone) = camera.ray(pixel, size, Vec2::ZERO);
                    let ray = view.ray(x, y);
                    assert!((ray.origin - expected.origin).length() < 1e-5);
                    assert!((ray.direction - expected.direction).length() < 1e-5);
                    let ours = view.cone(ray.direction);
                    assert_eq!(ours.width, cone.width);
                    assert!((ours.spread - cone.spread).abs() <= 1e-5 * cone.spread);
                    let point = ray.at(4.0);
                    assert!((view.project(point).unwrap() - pixel).length() < 1e-3 * size.0 as f32);
                    assert!(view.depth(point) > 0.0);
                }
            }
        }
    }
}
