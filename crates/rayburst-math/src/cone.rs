//! Ray cones: the footprint of a path in two numbers, for texture filtering.
//!
//! Akenine-Möller, Nilsson, Andersson, Barré-Brisebois, Toth, Karras: "Texture Level of Detail
//! Strategies for Real-Time Ray Tracing", Ray Tracing Gems 2019, chapter 20; Akenine-Möller, Crassin,
//! Boksansky, Belcour, Panteleev, Wright: "Improved Shader and Texture Level of Detail Using Ray
//! Cones", JCGT 2021.
//!
//! A round cone stands for the beam of a pixel, which curved mirrors and slanted interfaces make
//! astigmatic. Its width and spread follow the geometric mean of the beam's two principal planes, by
//! Coddington's equations for each, so that the area of the footprint is right where the beam itself is
//! not round.

use glam::Vec3;

use crate::Frame;

/// A cone around a ray: its diameter at the ray's origin and how it opens.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayCone {
    /// Diameter at the ray's origin, in world units.
    pub width: f32,
    /// Full opening angle, radians; negative when the cone narrows.
    pub spread: f32,
}

/// Least cosine of incidence that footprints are stretched by, and that interfaces are seen under.
pub const GRAZING: f32 = 1.0 / 64.0;

impl RayCone {
    /// The cone of an eye ray through the middle of a picture: zero width, the angle that one pixel
    /// covers.
    ///
    /// `fov` is the vertical field of view in radians, `height` the picture's height in pixels.
    #[inline]
    pub fn of_pixel(fov: f32, height: u32) -> Self {
        Self { width: 0.0, spread: (2.0 * (0.5 * fov).tan() / height.max(1) as f32).atan() }
    }

    /// The cone of an eye ray away from the middle, from that of the middle: pixels shrink with the
    /// `cosine` of the angle to the optical axis across it and with its square along it.
    #[inline]
    pub fn off_axis(&self, cosine: f32) -> Self {
        Self { width: self.width, spread: self.spread * cosine * cosine.sqrt() }
    }

    /// Diameter after `distance` world units.
    #[inline]
    pub fn width_at(&self, distance: f32) -> f32 {
        (self.width + self.spread * distance).abs()
    }

    /// The cone of the next path segment: propagated over `distance` and widened by the roughness of
    /// the scattering, `extra_spread` radians. Beyond a focus the cone opens again.
    #[inline]
    pub fn propagate(&self, distance: f32, extra_spread: f32) -> Self {
        let width = self.width + self.spread * distance;
        let spread = if width < 0.0 { -self.spread } else { self.spread };
        Self { width: width.abs(), spread: spread + extra_spread }
    }

    /// The cone that a mirror sends on: a cone of width w opens by 2κw more on a surface of mean
    /// curvature κ, positive where the surface bulges towards the ray. `extra_spread` as in
    /// [`RayCone::propagate`].
    #[inline]
    pub fn reflect(&self, distance: f32, curvature: f32, extra_spread: f32) -> Self {
        let cone = self.propagate(distance, extra_spread);
        Self { spread: cone.spread + 2.0 * curvature * cone.width, ..cone }
    }

    /// The cone that passes an interface. `eta` is the index of refraction on the ray's side over the
    /// one beyond, `cos_i` and `cos_t` the cosines between the normal and the rays before and after,
    /// `curvature` as in [`RayCone::reflect`].
    #[inline]
    pub fn refract(
        &self,
        distance: f32,
        curvature: f32,
        (cos_i, cos_t): (f32, f32),
        eta: f32,
    ) -> Self {
        let cone = self.propagate(distance, 0.0);
        let (cos_i, cos_t) = (cos_i.abs().max(GRAZING), cos_t.abs().max(GRAZING));
        let squeeze = (cos_t / cos_i).sqrt();
        let power = (eta * cos_i - cos_t) / (cos_i * cos_t).sqrt();
        Self {
            width: cone.width * squeeze,
            spread: cone.spread * eta / squeeze + curvature * cone.width * power,
        }
    }
}

/// The axes of the ellipse in which a cone of the diameter `width` cuts a surface: full lengths, the
/// longer one first, in world units. `direction` is the ray's and `normal` the surface's, unit vectors.
///
/// The cone counts as a cylinder, so the longer axis is `width`/|cos θ|; at grazing angles it stays
/// finite.
#[inline]
pub fn section(width: f32, direction: Vec3, normal: Vec3) -> [Vec3; 2] {
    let cosine = normal.dot(direction);
    let frame = Frame::from_normal_tangent(normal, direction);
    [frame.tangent * (width / cosine.abs().max(GRAZING)), frame.bitangent * width]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_as_wide_as_the_cone_across_the_ray() {
        let normal = Vec3::new(0.36, 0.48, 0.8);
        for direction in [Vec3::Z, Vec3::X, -normal, Vec3::new(0.6, 0.0, -0.8)] {
            let [major, minor] = section(0.3, direction, normal);
            assert!(major.dot(normal).abs() < 1e-6 && minor.dot(normal).abs() < 1e-6);
            assert!(major.dot(minor).abs() < 1e-6 && minor.dot(direction).abs() < 1e-6);
            assert!((minor.length() - 0.3).abs() < 1e-6);
            let seen = major - direction * major.dot(direction);
            assert!((seen.length() - 0.3).abs() < 1e-5, "{direction}: {seen}");
        }
        let [major, _] = section(1.0, Vec3::X, Vec3::Y);
        assert!((major - Vec3::X * 64.0).length() < 1e-3);
    }

    #[test]
    fn a_lens_of_glass_has_its_focus_where_it_should() {
        // Parallel light into glass of index 1.5 meets behind a sphere at n/(n − 1) radii.
        let parallel = RayCone { width: 0.1, spread: 0.0 };
        let inside = parallel.refract(5.0, 1.0 / 2.0, (1.0, 1.0), 1.0 / 1.5);
        assert!(inside.width_at(3.0 * 2.0) < 1e-6, "{inside:?}");
        // And opens again beyond.
        let beyond = inside.propagate(9.0, 0.0);
        assert!((beyond.width - 0.05).abs() < 1e-6 && beyond.spread > 0.0);
        // A concave mirror meets at half its radius.
        let mirrored = parallel.reflect(1.0, -1.0 / 4.0, 0.0);
        assert!(mirrored.width_at(2.0) < 1e-6);
    }

    #[test]
    fn a_slab_of_glass_shifts_and_does_not_widen() {
        let cone = RayCone { width: 0.1, spread: 0.02 };
        let (cos_i, sin_i) = (0.6f32, 0.8f32);
        let cos_t = (1.0 - (sin_i / 1.5).powi(2)).sqrt();
        let inside = cone.refract(0.0, 0.0, (cos_i, cos_t), 1.0 / 1.5);
        let outside = inside.refract(0.0, 0.0, (cos_t, cos_i), 1.5);
        assert!((outside.width - cone.width).abs() < 1e-7);
        assert!((outside.spread - cone.spread).abs() < 1e-7);
    }
}
