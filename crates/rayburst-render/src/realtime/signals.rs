//! The signals of a frame: light by where it comes from and how it is scattered, without the surfaces'
//! colours.
//!
//! Light L that leaves a surface by some lobes is kept as L/R, R being the lobes' albedo ("untextured
//! illumination": Eq. 26.4 to 26.6 of the chapter), so that filters do not blur textures. Where R is
//! nearly black it is raised to [`LEAST_REFLECTANCE`] both ways: nothing is lost.

use rayburst_image::{Plane, Plane3};
use rayburst_math::glam::Vec3;
use rayon::prelude::*;

use super::composite::Lights;
use crate::Result;

/// Albedos are taken to be at least this when light is divided by them.
pub const LEAST_REFLECTANCE: f32 = 1e-3;

/// An albedo that light can be divided by.
#[inline]
pub fn guarded(reflectance: Vec3) -> Vec3 {
    reflectance.max(Vec3::splat(LEAST_REFLECTANCE))
}

/// How light is scattered: the two kinds that signals are kept apart by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lobe {
    /// Diffuse reflection.
    Broad,
    /// Specular reflection.
    Glossy,
}

/// Signals of a frame, at the size that is rendered. Radiance is in cd/m²; what is said to be
/// demodulated is divided by the guarded albedo of its lobes.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    /// Albedo of the broad lobes (diffuse reflection).
    pub diffuse_reflectance: Plane3,
    /// Albedo of the glossy lobe (specular reflection).
    pub specular_reflectance: Plane3,
    /// Light from lights, broadly scattered, demodulated.
    pub direct_diffuse: Plane3,
    /// Light from lights, glossily scattered, demodulated.
    pub direct_specular: Plane3,
    /// Light of the tile's polygon lights as if nothing were in between, broadly scattered, demodulated:
    /// in closed form, without noise. What arrives is this times `shadow` (Heitz, Hill, McGuire:
    /// "Combining Analytic Direct Illumination and Stochastic Shadows", I3D 2018).
    pub analytic_diffuse: Plane3,
    /// The same, glossily scattered, demodulated.
    pub analytic_specular: Plane3,
    /// Share of the light of polygon lights that is not blocked, from one shadow ray.
    pub shadow: Plane,
    /// Distance to what blocked that ray's light; infinite if nothing did.
    pub shadow_distance: Plane,
    /// Light along sampled rays, broadly scattered, demodulated.
    pub indirect_diffuse: Plane3,
    /// Light along sampled rays, glossily scattered, demodulated.
    pub indirect_specular: Plane3,
    /// Length of the ray that `indirect_diffuse` came along; infinite if it left the scene, 0 without.
    pub diffuse_hit_distance: Plane,
    /// Length of the ray that `indirect_specular` came along; infinite if it left the scene, 0 without.
    pub specular_hit_distance: Plane,
    /// Radiance of mirrors and glass.
    pub transparency: Plane3,
    /// Cosine-weighted share of the hemisphere that is open within the radius; 1 without the pass.
    pub ambient_occlusion: Plane,
    /// Distance to what the ambient occlusion ray met; infinite if nothing.
    pub occluder_distance: Plane,
    /// Variance of the luminance of the demodulated light in the 3×3 pixels around.
    pub variance: Plane,
}

impl Signals {
    /// Empty signals of a size.
    pub fn new(size: (u32, u32)) -> Result<Self> {
        let vector = || Plane3::new(size.0, size.1);
        let plane = || Plane::new(size.0, size.1);
        Ok(Self {
            diffuse_reflectance: vector()?,
            specular_reflectance: vector()?,
            direct_diffuse: vector()?,
            direct_specular: vector()?,
            analytic_diffuse: vector()?,
            analytic_specular: vector()?,
            shadow: plane()?,
            shadow_distance: plane()?,
            indirect_diffuse: vector()?,
            indirect_specular: vector()?,
            diffuse_hit_distance: plane()?,
            specular_hit_distance: plane()?,
            transparency: vector()?,
            ambient_occlusion: plane()?,
            occluder_distance: plane()?,
            variance: plane()?,
        })
    }

    /// The light of the passes, unfiltered.
    pub fn lights(&self) -> Lights<'_> {
        Lights {
            direct: [&self.direct_diffuse, &self.direct_specular],
            indirect: [&self.indirect_diffuse, &self.indirect_specular],
            analytic: Some([&self.analytic_diffuse, &self.analytic_specular]),
            shadow: &self.shadow,
            transparency: &self.transparency,
            ambient_occlusion: Some(&self.ambient_occlusion),
        }
    }

    /// Everything to what it is without any pass.
    pub(crate) fn clear(&mut self) {
        let zero = [
            &mut self.diffuse_reflectance,
            &mut self.specular_reflectance,
            &mut self.direct_diffuse,
            &mut self.direct_specular,
            &mut self.analytic_diffuse,
            &mut self.analytic_specular,
            &mut self.indirect_diffuse,
            &mut self.indirect_specular,
            &mut self.transparency,
        ];
        zero.into_par_iter().for_each(|planes| planes.fill(Vec3::ZERO));
        let values = [
            (&mut self.shadow, 1.0),
            (&mut self.shadow_distance, f32::INFINITY),
            (&mut self.diffuse_hit_distance, 0.0),
            (&mut self.specular_hit_distance, 0.0),
            (&mut self.ambient_occlusion, 1.0),
            (&mut self.occluder_distance, f32::INFINITY),
        ];
        values.into_par_iter().for_each(|(plane, value)| plane.fill(value));
    }
}
