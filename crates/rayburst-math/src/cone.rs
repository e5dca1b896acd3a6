//! Ray cones: the footprint of a path, for texture filtering.
//!
//! Akenine-Möller, Nilsson, Andersson, Barré-Brisebois, Toth, Karras: "Texture Level of Detail
//! Strategies for Real-Time Ray Tracing", Ray Tracing Gems 2019, chapter 20.

/// A cone around a ray: its diameter at the ray's origin and how it opens.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayCone {
    /// Diameter at the ray's origin, in world units.
    pub width: f32,
    /// Full opening angle, radians; negative when the cone narrows.
    pub spread: f32,
}

impl RayCone {
    /// The cone of an eye ray through one pixel: zero width, the angle that one pixel covers.
    ///
    /// `fov` is the vertical field of view in radians, `height` the picture's height in pixels.
    #[inline]
    pub fn of_pixel(fov: f32, height: u32) -> Self {
        Self { width: 0.0, spread: (2.0 * (0.5 * fov).tan() / height.max(1) as f32).atan() }
    }

    /// Diameter after `distance` world units.
    #[inline]
    pub fn width_at(&self, distance: f32) -> f32 {
        (self.width + self.spread * distance).abs()
    }

    /// The cone of the next path segment: propagated over `distance` and widened by the surface's
    /// curvature or the roughness of the scattering, `extra_spread` radians.
    #[inline]
    pub fn propagate(&self, distance: f32, extra_spread: f32) -> Self {
        Self { width: self.width + self.spread * distance, spread: self.spread + extra_spread }
    }
}
