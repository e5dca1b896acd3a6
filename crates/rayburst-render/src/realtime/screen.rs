//! Pixels and depths to points in front of the camera, and back.
//!
//! View space is the camera's frame: x right, y up, z into the scene. Screen-space passes walk along
//! lines of the picture, along which depth itself is not linear in perspective, but 1/z is.

use rayburst_image::Plane;
use rayburst_math::glam::{Vec2, Vec3};
use rayburst_scene::{Camera, Projection};

use crate::{RenderError, Result};

/// A camera and the size of its picture. A lens is ignored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Screen {
    eye: Vec3,
    /// Right, up, into the scene.
    frame: [Vec3; 3],
    half: Vec2,
    size: Vec2,
    /// From pixels to the plane at distance 1, x right and y up.
    scale: Vec2,
    pub(super) perspective: bool,
}

impl Screen {
    pub(super) fn new(camera: &Camera, (width, height): (u32, u32)) -> Self {
        let (half_height, perspective) = match camera.projection {
            Projection::Perspective { fov } => ((0.5 * fov).tan(), true),
            Projection::Orthographic { half_height } => (half_height, false),
        };
        let size = Vec2::new(width as f32, height as f32);
        let half = Vec2::new(half_height * size.x / size.y.max(1.0), half_height);
        let scale = 2.0 * half / size.max(Vec2::ONE) * Vec2::new(1.0, -1.0);
        Self { eye: camera.eye(), frame: camera.frame(), half, size, scale, perspective }
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
        let p = (pixel - 0.5 * self.size) * self.scale;
        (if self.perspective { p * depth } else { p }).extend(depth)
    }

    /// Where the picture shows a point of view space, which must be in front of a perspective camera.
    #[inline]
    pub(super) fn pixel(&self, view: Vec3) -> Vec2 {
        let scale = if self.perspective { view.z } else { 1.0 };
        let p = view.truncate() * Vec2::new(1.0, -1.0) / (scale * self.half);
        0.5 * (p + Vec2::ONE) * self.size
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
