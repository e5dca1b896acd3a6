//! Cameras: Eq. 26.2 of the chapter, with a thin lens or an orthographic projection.

use glam::Affine3A;

/// How directions map to pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A pinhole or a thin lens; vertical field of view in radians.
    Perspective {
        /// Full vertical angle, radians, in (0, π).
        fov: f32,
    },
    /// Parallel rays.
    Orthographic {
        /// Half the height of the view, world units. The width follows the picture's aspect ratio.
        half_height: f32,
    },
}

/// A camera in world space. It looks along −z of its transform with +y up (glTF's convention).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Camera to world; rigid.
    pub transform: Affine3A,
    /// Projection.
    pub projection: Projection,
    /// Diameter of the lens in world units; 0 is a pinhole.
    pub aperture: f32,
    /// Distance from the lens to the plane in focus along the viewing direction, world units.
    pub focus: f32,
}
