//! How surfaces scatter light: evaluate, sample and density as pure functions over plain data.
//!
//! All directions are unit vectors in the local frame of a [`crate::ShadingPoint`]: z is the shading
//! normal on the side of `wo`, the direction towards the viewer; `wi` is the direction from which
//! light comes. Densities are per solid angle. Reflected light leaves on the side of the geometric
//! normal where `wo` is and transmitted light on the other, whatever the shading normal says, so that
//! no light leaks through surfaces (Veach: "Robust Monte Carlo Methods", 1997, section 5.3).

pub mod albedo;
pub mod fresnel;
pub mod ggx;
mod metallic_roughness;
mod specular;
#[cfg(test)]
mod tests;

use glam::{Vec2, Vec3};

pub use metallic_roughness::SMOOTH_ALPHA;
pub use specular::SpecularPath;

use metallic_roughness::Lobes;
pub(crate) use metallic_roughness::{AreaTerms, DIFFUSE_SPREAD};

/// The scattering at one point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    kind: Kind,
    /// Geometric normal in the local frame, on the side of `wo`.
    geometric_normal: Vec3,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Absorber,
    MetallicRoughness(Lobes),
    /// `eta` is the index on `wo`'s side over the other side's.
    Interface {
        eta: f32,
        tint: Vec3,
    },
    Mirror(Vec3),
}

/// f·|cos θᵢ| of a pair of directions, the broad lobes and the glossy one apart: what real-time passes
/// keep in signals of their own. Delta directions are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeValues {
    /// The base and the light that comes back after several bounces between microfacets.
    pub broad: Vec3,
    /// Single reflection off microfacets.
    pub glossy: Vec3,
    /// Density per solid angle of [`Bsdf::sample_broad`].
    pub broad_pdf: f32,
    /// Density per solid angle of [`Bsdf::sample_glossy`].
    pub glossy_pdf: f32,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where to.
    pub wi: Vec3,
    /// f·|cos θᵢ| / density: what the path's throughput is multiplied by.
    pub weight: Vec3,
    /// Density per solid angle; for `delta` samples the probability of the choice.
    pub pdf: f32,
    /// Whether `wi` is one of finitely many directions, which light sampling cannot find.
    pub delta: bool,
    /// Whether `wi` leaves on the other side.
    pub transmitted: bool,
    /// Angle by which a ray cone opens further, radians: about the width of the lobe.
    pub spread: f32,
}

impl Bsdf {
    /// Scatters nothing.
    pub const BLACK: Self = Self { kind: Kind::Absorber, geometric_normal: Vec3::Z };

    /// glTF's metallic-roughness model. `energy_compensation` returns what single scattering between
    /// microfacets loses.
    pub fn metallic_roughness(
        color: Vec3,
        metallic: f32,
        roughness: f32,
        ior: f32,
        energy_compensation: bool,
    ) -> Self {
        let lobes = Lobes::new(color, metallic, roughness, ior, energy_compensation);
        Self { kind: Kind::MetallicRoughness(lobes), ..Self::BLACK }
    }

    /// Lambert's diffuse reflection.
    pub fn diffuse(color: Vec3) -> Self {
        Self::metallic_roughness(color, 0.0, 1.0, 1.0, false)
    }

    /// A smooth interface; `eta` is the index of refraction on the side of `wo` divided by the one on
    /// the other side, `tint` what passes.
    pub fn interface(eta: f32, tint: Vec3) -> Self {
        Self { kind: Kind::Interface { eta, tint }, ..Self::BLACK }
    }

    /// A perfect mirror.
    pub fn mirror(color: Vec3) -> Self {
        Self { kind: Kind::Mirror(color), ..Self::BLACK }
    }

    /// With a geometric normal other than the shading normal: local, on the side of `wo`.
    #[must_use]
    pub fn with_geometric_normal(self, normal: Vec3) -> Self {
        Self { geometric_normal: normal, ..self }
    }

    /// Whether light sampling is in vain, because all directions are `delta` or nothing is scattered.
    #[inline]
    pub fn is_delta(&self) -> bool {
        match &self.kind {
            Kind::MetallicRoughness(lobes) => lobes.is_mirror_only(),
            Kind::Absorber | Kind::Interface { .. } | Kind::Mirror(_) => true,
        }
    }

    /// Whether light goes on in `delta` directions, perhaps among others.
    #[inline]
    pub fn has_delta(&self) -> bool {
        match &self.kind {
            Kind::MetallicRoughness(lobes) => lobes.is_smooth(),
            Kind::Absorber => false,
            Kind::Interface { .. } | Kind::Mirror(_) => true,
        }
    }

    /// Index of refraction on the side of `wo` over that on the other side; 1 for what is no interface.
    #[inline]
    pub fn relative_ior(&self) -> f32 {
        match self.kind {
            Kind::Interface { eta, .. } => eta,
            _ => 1.0,
        }
    }

    /// Fraction of the light from `wo` that is scattered at all.
    pub fn albedo(&self, wo: Vec3) -> Vec3 {
        match &self.kind {
            Kind::Absorber => Vec3::ZERO,
            Kind::MetallicRoughness(lobes) => lobes.albedo(wo.z),
            Kind::Interface { .. } => Vec3::ONE,
            Kind::Mirror(color) => *color,
        }
    }

    /// What area lights need of the scattering towards a direction of cosine `cos_o`; `None` without
    /// any that is not `delta`.
    pub(crate) fn area_terms(&self, cos_o: f32) -> Option<AreaTerms> {
        match &self.kind {
            Kind::MetallicRoughness(lobes) if cos_o > 0.0 && !lobes.is_mirror_only() => {
                Some(lobes.area_terms(cos_o))
            }
            _ => None,
        }
    }

    /// The geometric normal in the local frame, on the side of `wo`.
    #[inline]
    pub(crate) fn geometric_normal(&self) -> Vec3 {
        self.geometric_normal
    }

    /// Whether `wi` may be reached by reflection.
    #[inline]
    fn reflects(&self, wo: Vec3, wi: Vec3) -> bool {
        wo.z > 0.0 && wi.z > 0.0 && self.geometric_normal.dot(wi) > 0.0
    }

    /// f·|cos θᵢ| and the density of [`Bsdf::sample`], without the delta directions.
    #[inline]
    pub fn evaluate_with_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        match &self.kind {
            Kind::MetallicRoughness(lobes) if self.reflects(wo, wi) => lobes.evaluate(wo, wi),
            _ => (Vec3::ZERO, 0.0),
        }
    }

    /// f·|cos θᵢ| of the broad lobes and of the glossy one, with the densities of sampling each alone.
    #[inline]
    pub fn evaluate_apart(&self, wo: Vec3, wi: Vec3) -> LobeValues {
        match &self.kind {
            Kind::MetallicRoughness(lobes) if self.reflects(wo, wi) => lobes.evaluate_apart(wo, wi),
            _ => LobeValues::default(),
        }
    }

    /// Fractions of the light from `wo` that the broad lobes and the glossy one scatter; zero for
    /// interfaces and mirrors, which have neither.
    #[inline]
    pub fn albedos_apart(&self, wo: Vec3) -> (Vec3, Vec3) {
        match &self.kind {
            Kind::MetallicRoughness(lobes) => lobes.albedos_apart(wo.z),
            _ => (Vec3::ZERO, Vec3::ZERO),
        }
    }

    /// A direction of the broad lobes alone, by the cosine; `weight` has their part of f only.
    #[inline]
    pub fn sample_broad(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        match &self.kind {
            Kind::MetallicRoughness(lobes) if wo.z > 0.0 => lobes.sample_broad(wo, u),
            _ => None,
        }
        .filter(|sample| self.geometric_normal.dot(sample.wi) > 0.0)
    }

    /// A direction of the glossy lobe alone, by its visible normals; `weight` has its part of f only.
    #[inline]
    pub fn sample_glossy(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        match &self.kind {
            Kind::MetallicRoughness(lobes) if wo.z > 0.0 => lobes.sample_glossy(wo, u),
            _ => None,
        }
        .filter(|sample| self.geometric_normal.dot(sample.wi) > 0.0)
    }

    /// Whether there are neither broad nor glossy lobes, but light goes on: mirrors and glass.
    #[inline]
    pub fn is_specular_only(&self) -> bool {
        matches!(self.kind, Kind::Mirror(_) | Kind::Interface { .. })
    }

    /// f·|cos θᵢ|, without the delta directions.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.evaluate_with_pdf(wo, wi).0
    }

    /// Density of [`Bsdf::sample`], without the delta directions.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.evaluate_with_pdf(wo, wi).1
    }

    /// A direction for a ray to go on; `None` absorbs it.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: Vec3) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let delta = |path: SpecularPath, pdf: f32, transmitted: bool| BsdfSample {
            wi: path.wi,
            weight: path.weight / pdf,
            pdf,
            delta: true,
            transmitted,
            spread: 0.0,
        };
        let sample = match &self.kind {
            Kind::Absorber => None,
            Kind::MetallicRoughness(lobes) => lobes.sample(wo, u),
            Kind::Mirror(_) => self.specular_reflection(wo).map(|path| delta(path, 1.0, false)),
            Kind::Interface { eta, tint } => match specular::interface(wo, *eta, *tint) {
                (reflected, None) => Some(delta(reflected, 1.0, false)),
                (reflected, Some(refracted)) => {
                    let p = reflected.weight.x;
                    Some(if u.z < p {
                        delta(reflected, p, false)
                    } else {
                        delta(refracted, 1.0 - p, true)
                    })
                }
            },
        }?;
        let above = self.geometric_normal.dot(sample.wi) > 0.0;
        (above != sample.transmitted).then_some(sample)
    }

    /// The perfectly specular reflection, if there is one.
    pub fn specular_reflection(&self, wo: Vec3) -> Option<SpecularPath> {
        let path = match &self.kind {
            Kind::Absorber => None,
            Kind::MetallicRoughness(lobes) => lobes.mirror(wo),
            Kind::Mirror(color) => Some(SpecularPath { wi: specular::reflect(wo), weight: *color }),
            Kind::Interface { eta, tint } => Some(specular::interface(wo, *eta, *tint).0),
        }?;
        (self.geometric_normal.dot(path.wi) > 0.0).then_some(path)
    }

    /// The refraction, if there is one.
    pub fn specular_refraction(&self, wo: Vec3) -> Option<SpecularPath> {
        match &self.kind {
            Kind::Interface { eta, tint } => specular::interface(wo, *eta, *tint)
                .1
                .filter(|path| self.geometric_normal.dot(path.wi) < 0.0),
            _ => None,
        }
    }
}
