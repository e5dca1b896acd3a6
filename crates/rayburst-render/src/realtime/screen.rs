//! Pixels and depths to points in front of the camera, and back.
//!
//! View space is the camera's frame: x right, y up, z into the scene. Screen-space passes walk along
//! lines of the picture, along which depth itself is not linear in perspective, but 1/z is.

use rayburst_image::Plane;
use rayburst_math::glam::{Vec2, Vec3};
use rayburst_scene::Projection;

use super::view::FrameView;
use crate::{RenderError, Result};

/// The projection of a view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Screen {
    eye: Vec3,
    /// Right, up, into the scene.
    frame: [Vec3; 3],
    half: Vec2,
    size: Vec2,
    /// From pixels to the plane at distance 1, x right and y up.
    scale: Vec2,
    /// What pixels show is as far off their centres, in pixels.
    jitter: Vec2,
    pub(super) perspective: bool,
}

impl Screen {
    pub(super) fn new(view: &FrameView) -> Self {
        let camera = view.camera();
        let perspective = matches!(camera.projection, Projection::Perspective { .. });
        let (half, size) = (view.half_extent(), view.extent());
        let scale = 2.0 * half / size.max(Vec2::ONE) * Vec2::new(1.0, -1.0);
        let (eye, frame, jitter) = (camera.eye(), camera.frame(), view.jitter());
        Self { eye, frame, half, size, scale, jitter, perspective }
    }

    /// A world direction in view space.
    #[inline]
    pub(super) fn turn(&self, direction: Vec3) -> Vec3 {
        Vec3::from_array(self.frame.map(|axis| axis.dot(direction)))
    }

    /// A world point in view space.
    #[inline]
    pub(super) fn view(&self, point: Vec3) -> Vec3 {
        self.turn(point - self.eye)
    }

    /// The point of view space that a place of the picture shows at a depth. Pixel centres are at
    /// +0.5.
    #[inline]
    pub(super) fn at(&self, pixel: Vec2, depth: f32) -> Vec3 {
        let p = (pixel + self.jitter - 0.5 * self.size) * self.scale;
        (if self.perspective { p * depth } else { p }).extend(depth)
    }

    /// Where the picture shows a point of view space, which must be in front of a perspective camera.
    #[inline]
    pub(super) fn pixel(&self, view: Vec3) -> Vec2 {
        let scale = if self.perspective { view.z } else { 1.0 };
        let p = view.truncate() * Vec2::new(1.0, -1.0) / (scale * self.half);
        0.5 * (p + Vec2::ONE) * self.size - self.jitter
    }

    /// Pixels that a length across the view covers at a depth.
    #[inline]
    pub(super) fn pixels(&self, length: f32, depth: f32) -> f32 {
        let scale = if self.perspective { depth } else { 1.0 };
        0.5 * self.size.y * length / (self.half.y * scale)
    }

    /// What is linear along lines of the picture and larger for nearer points: 1/z in perspective, −z
    /// without.
    #[inline]
    pub(super) fn nearness(&self, depth: f32) -> f32 {
        if self.perspective { 1.0 / depth } else { -depth }
    }

    /// The depth of a nearness.
    #[inline]
    pub(super) fn depth(&self, nearness: f32) -> f32 {
        if self.perspective { 1.0 / nearness } else { -nearness }
    }

    /// Where the picture shows something at this depth: not before the camera, not nowhere.
    #[inline]
    pub(super) fn is_surface(&self, depth: f32) -> bool {
        depth.is_finite() && (depth > 0.0 || !self.perspective)
    }
}

/// Fails if a plane's size is not the expected one.
pub(super) fn check_size(
    name: &'static str,
    (width, height): (u32, u32),
    expected: (u32, u32),
) -> Result<()> {
    if (width, height) == expected {
        return Ok(());
    }
    Err(RenderError::Setting {
        name,
        value: format!("{width}x{height}"),
        must_be: "of the same size as the planes beside it",
    })
}

/// Makes an output plane of the right size, if it is not.
pub(super) fn fit(plane: &mut Plane, (width, height): (u32, u32)) -> Result<()> {
    if plane.size() != (width, height) {
        *plane = Plane::new(width, height)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rayburst_scene::Camera;

    use super::*;

    #[test]
    fn pixels_show_what_their_rays_meet() {
        let eye = Vec3::new(1.0, 2.0, 3.0);
        let camera = Camera::look_at(eye, Vec3::new(-2.0, 0.5, 0.0), Vec3::Y, 0.8);
        let projection = Projection::Orthographic { half_height: 1.5 };
        for camera in [camera, Camera { projection, ..camera }] {
            for jitter in [Vec2::ZERO, Vec2::new(0.4, -0.3)] {
                let view = FrameView::new(camera, (37, 21), jitter);
                let screen = Screen::new(&view);
                for (x, y) in [(0, 0), (36, 20), (11, 4)] {
                    let point = view.ray(x, y).at(2.5);
                    let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let found = screen.at(centre, view.depth(point));
                    assert!((found - screen.view(point)).length() < 1e-5);
                    assert!((screen.pixel(screen.view(point)) - centre).length() < 1e-4);
                }
            }
        }
    }
}
