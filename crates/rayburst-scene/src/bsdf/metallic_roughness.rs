//! glTF's metallic-roughness material: a diffuse base under a dielectric GGX coat, mixed with metal.
//!
//! glTF 2.0, appendix B, made energy-conserving and reciprocal:
//! - what single scattering between microfacets loses returns as the lobe of Kulla and Conty
//!   ("Revisiting Physically Based Shading at Imageworks", 2017);
//! - the base gets the light that the coat leaves, on the way in and on the way out, normalised as by
//!   Kelemen and Szirmay-Kalos ("A Microfacet Based Coupled Specular-Matte BRDF Model", 2001):
//!   `ρ/π · (1 − E(o))(1 − E(i)) / (1 − Ē)`. A white base under any coat reflects all light.
//!
//! Index of refraction 1 has no coat: the base is Lambert's. Below [`SMOOTH_ALPHA`] the GGX lobe is a
//! perfect mirror.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{
    BsdfSample, LobeValues, SpecularPath,
    albedo::{self, Albedo},
    fresnel, ggx, specular,
};
use rayburst_math::warp;

/// The lobe of smaller α = roughness² is sampled as a perfect mirror.
pub const SMOOTH_ALPHA: f32 = 1e-3;

/// Opening angle that a diffuse bounce adds to a ray cone, radians. Footprints after it may be wide:
/// one path stands for many directions.
pub(crate) const DIFFUSE_SPREAD: f32 = 0.5;

/// The lobes of one point, with what does not depend on directions worked out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobes {
    /// α of the GGX lobe, 0 when smooth.
    alpha: f32,
    /// Reflectance of the whole lobe at normal incidence and at grazing angles.
    f0: Vec3,
    f90: f32,
    /// Albedo of what is lost by single scattering and returned: factor of `Albedo::lost`.
    returned: Vec3,
    /// The same of the coat alone.
    coat_f0: f32,
    coat_f90: f32,
    coat_returned: f32,
    /// Albedo of the base.
    base: Vec3,
    /// 1/(π(1 − Ē)) of the lost light and of the coat.
    lost_norm: f32,
    base_norm: f32,
}

/// The scattering towards one direction, cut into what is integrated over area lights:
/// f = base·(1 − coat·E(i)) + GGX lobe + returned·lost(i), with the albedo E(i) of
/// [`albedo::directional`] in three parts (a, b, lost).
#[derive(Clone, Copy, Debug)]
pub(crate) struct AreaTerms {
    /// α of the GGX lobe; 0 when smooth or without one.
    pub(crate) alpha: f32,
    pub(crate) base: Vec3,
    /// What the coat takes of the base's light, factors of a, b and lost.
    pub(crate) coat: [f32; 3],
    /// Albedo of the GGX lobe by reflectance at normal incidence, and that by grazing reflectance.
    pub(crate) glossy: [Vec3; 2],
    pub(crate) returned: Vec3,
}

/// Fresnel average over the hemisphere, and the part of the lost light that later bounces return.
fn returned(f0: Vec3, f90: f32, average: Albedo) -> Vec3 {
    let mean = f0 + (Vec3::splat(f90) - f0) * (1.0 / 21.0);
    mean * mean * (average.a + average.b) / (Vec3::ONE - mean * average.lost())
}

impl Lobes {
    pub(super) fn new(
        color: Vec3,
        metallic: f32,
        roughness: f32,
        ior: f32,
        energy_compensation: bool,
    ) -> Self {
        let color = color.clamp(Vec3::ZERO, Vec3::ONE);
        let metallic = metallic.clamp(0.0, 1.0);
        let roughness = roughness.clamp(0.0, 1.0);
        let squared = roughness * roughness;
        let alpha = if squared < SMOOTH_ALPHA { 0.0 } else { squared };
        let coat_f0 = fresnel::normal_reflectance(ior.max(1.0));
        // Schlick's rise to 1 is wrong for interfaces that hardly reflect at all.
        let coat_f90 = (50.0 * coat_f0).min(1.0);
        let average = albedo::average(alpha);
        let (coat_returned, metal_returned) = if energy_compensation && alpha > 0.0 {
            (returned(Vec3::splat(coat_f0), coat_f90, average).x, returned(color, 1.0, average))
        } else {
            (0.0, Vec3::ZERO)
        };
        let coat_average =
            coat_f0 * average.a + coat_f90 * average.b + coat_returned * average.lost();
        Self {
            alpha,
            f0: Vec3::splat(coat_f0).lerp(color, metallic),
            f90: coat_f90 + (1.0 - coat_f90) * metallic,
            returned: Vec3::splat(coat_returned).lerp(metal_returned, metallic),
            coat_f0,
            coat_f90,
            coat_returned,
            base: color * (1.0 - metallic),
            lost_norm: FRAC_1_PI / average.lost().max(1e-6),
            base_norm: FRAC_1_PI / (1.0 - coat_average).max(1e-6),
        }
    }

    /// No GGX lobe: Lambert's cosine law alone.
    #[inline]
    fn is_lambert(&self) -> bool {
        self.f90 == 0.0
    }

    /// Whether the glossy lobe is a perfect mirror.
    #[inline]
    pub(super) fn is_smooth(&self) -> bool {
        self.alpha == 0.0 && !self.is_lambert()
    }

    #[inline]
    pub(super) fn is_mirror_only(&self) -> bool {
        self.alpha == 0.0 && self.base == Vec3::ZERO && !self.is_lambert()
    }

    /// Albedo of the base and of the whole, for AOVs.
    pub(super) fn albedo(&self, cos_o: f32) -> Vec3 {
        if self.is_lambert() {
            return self.base;
        }
        let e = albedo::directional(cos_o, self.alpha);
        self.glossy_albedo(e) + self.returned * e.lost() + self.base * (1.0 - self.coat_albedo(e))
    }

    /// The scattering towards a direction above the surface for area lights.
    pub(super) fn area_terms(&self, cos_o: f32) -> AreaTerms {
        if self.is_lambert() {
            return AreaTerms {
                alpha: 0.0,
                base: self.base * FRAC_1_PI,
                coat: [0.0; 3],
                glossy: [Vec3::ZERO; 2],
                returned: Vec3::ZERO,
            };
        }
        let o = albedo::directional(cos_o, self.alpha);
        AreaTerms {
            alpha: self.alpha,
            base: self.base * ((1.0 - self.coat_albedo(o)) * self.base_norm),
            coat: [self.coat_f0, self.coat_f90, self.coat_returned],
            glossy: [self.f0 * o.a, Vec3::splat(self.f90 * o.b)],
            returned: self.returned * (o.lost() * self.lost_norm),
        }
    }

    #[inline]
    fn glossy_albedo(&self, e: Albedo) -> Vec3 {
        self.f0 * e.a + self.f90 * e.b
    }

    #[inline]
    fn coat_albedo(&self, e: Albedo) -> f32 {
        self.coat_f0 * e.a + self.coat_f90 * e.b + self.coat_returned * e.lost()
    }

    /// Probabilities of sampling the GGX lobe and the returned light; the base has the rest.
    #[inline]
    fn probabilities(&self, e: Albedo) -> (f32, f32) {
        let glossy = self.glossy_albedo(e).element_sum();
        let returned = (self.returned * e.lost()).element_sum();
        let base = (self.base * (1.0 - self.coat_albedo(e))).element_sum();
        let sum = glossy + returned + base;
        if sum > 0.0 { (glossy / sum, returned / sum) } else { (0.0, 0.0) }
    }

    /// f·cos θᵢ and the density, for two directions above the surface.
    #[inline]
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if self.is_lambert() {
            let pdf = wi.z * FRAC_1_PI;
            return (self.base * pdf, pdf);
        }
        let o = albedo::directional(wo.z, self.alpha);
        self.evaluate_lobes(wo, wi, o, self.probabilities(o))
    }

    /// [`Lobes::evaluate`] when the albedo for `wo` and the probabilities are known.
    #[inline]
    fn evaluate_lobes(
        &self,
        wo: Vec3,
        wi: Vec3,
        o: Albedo,
        (p_glossy, p_returned): (f32, f32),
    ) -> (Vec3, f32) {
        let cosine_pdf = wi.z * FRAC_1_PI;
        let i = albedo::directional(wi.z, self.alpha);
        let mut f = self.base
            * ((1.0 - self.coat_albedo(o)) * (1.0 - self.coat_albedo(i)) * self.base_norm);
        let mut pdf = (1.0 - p_glossy - p_returned).max(0.0) * cosine_pdf;
        if self.alpha > 0.0 {
            let h = (wo + wi).normalize_or(Vec3::Z);
            let d = ggx::distribution(h, self.alpha);
            f += fresnel::schlick(self.f0, self.f90, wo.dot(h))
                * (d * ggx::visibility(wo.z, wi.z, self.alpha));
            pdf += p_glossy * ggx::reflection_pdf(wo.z, h, self.alpha);
            if p_returned > 0.0 {
                f += self.returned * (o.lost() * i.lost() * self.lost_norm);
                pdf += p_returned * albedo::lost_pdf(wi.z, self.alpha);
            }
        }
        (f * wi.z, pdf)
    }

    /// The broad lobes (base and returned light) and the glossy one (GGX) apart, each with the density of
    /// sampling it alone.
    #[inline]
    pub(super) fn evaluate_apart(&self, wo: Vec3, wi: Vec3) -> LobeValues {
        let cosine_pdf = wi.z * FRAC_1_PI;
        let mut values = LobeValues { broad_pdf: cosine_pdf, ..LobeValues::default() };
        if self.is_lambert() {
            values.broad = self.base * cosine_pdf;
            return values;
        }
        let (o, i) = (albedo::directional(wo.z, self.alpha), albedo::directional(wi.z, self.alpha));
        let base = (1.0 - self.coat_albedo(o)) * (1.0 - self.coat_albedo(i)) * self.base_norm;
        values.broad = self.base * (base * wi.z);
        if self.alpha > 0.0 {
            values.broad += self.returned * (o.lost() * i.lost() * self.lost_norm * wi.z);
            let h = (wo + wi).normalize_or(Vec3::Z);
            let d = ggx::distribution(h, self.alpha);
            values.glossy = fresnel::schlick(self.f0, self.f90, wo.dot(h))
                * (d * ggx::visibility(wo.z, wi.z, self.alpha) * wi.z);
            values.glossy_pdf = ggx::reflection_pdf(wo.z, h, self.alpha);
        }
        values
    }

    /// Albedos of the broad lobes and of the glossy one.
    #[inline]
    pub(super) fn albedos_apart(&self, cos_o: f32) -> (Vec3, Vec3) {
        if self.is_lambert() {
            return (self.base, Vec3::ZERO);
        }
        let e = albedo::directional(cos_o, self.alpha);
        let broad = self.returned * e.lost() + self.base * (1.0 - self.coat_albedo(e));
        let glossy = if self.alpha > 0.0 {
            self.glossy_albedo(e)
        } else {
            fresnel::schlick(self.f0, self.f90, cos_o)
        };
        (broad, glossy)
    }

    /// A direction of the broad lobes.
    #[inline]
    pub(super) fn sample_broad(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let wi = warp::cosine_hemisphere(u);
        let pdf = wi.z * FRAC_1_PI;
        (pdf > 0.0).then(|| BsdfSample {
            wi,
            weight: self.evaluate_apart(wo, wi).broad / pdf,
            pdf,
            delta: false,
            transmitted: false,
            spread: DIFFUSE_SPREAD,
        })
    }

    /// A direction of the glossy lobe; a mirror's if that is smooth.
    #[inline]
    pub(super) fn sample_glossy(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        if self.is_lambert() {
            return None;
        }
        let sample = BsdfSample {
            wi: specular::reflect(wo),
            weight: Vec3::ZERO,
            pdf: 1.0,
            delta: true,
            transmitted: false,
            spread: 0.0,
        };
        if let Some(path) = self.mirror(wo) {
            return Some(BsdfSample { wi: path.wi, weight: path.weight, ..sample });
        }
        let h = ggx::sample(wo, self.alpha, u);
        let wi = 2.0 * wo.dot(h) * h - wo;
        if wi.z <= 0.0 {
            return None;
        }
        let LobeValues { glossy, glossy_pdf: pdf, .. } = self.evaluate_apart(wo, wi);
        let weight = glossy / pdf;
        let spread = 0.5 * self.alpha;
        weight.is_finite().then_some(BsdfSample { wi, weight, pdf, delta: false, spread, ..sample })
    }

    /// The mirror direction of a smooth coat or metal.
    pub(super) fn mirror(&self, wo: Vec3) -> Option<SpecularPath> {
        (self.alpha == 0.0 && !self.is_lambert()).then(|| SpecularPath {
            wi: specular::reflect(wo),
            weight: fresnel::schlick(self.f0, self.f90, wo.z),
        })
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec3) -> Option<BsdfSample> {
        let scattered = |wi: Vec3, (f, pdf): (Vec3, f32), spread: f32| {
            let weight = f / pdf;
            weight.is_finite().then_some(BsdfSample {
                wi,
                weight,
                pdf,
                delta: false,
                transmitted: false,
                spread,
            })
        };
        if self.is_lambert() {
            let wi = warp::cosine_hemisphere(u.truncate());
            return (wi.z > 0.0)
                .then(|| scattered(wi, self.evaluate(wo, wi), DIFFUSE_SPREAD))
                .flatten();
        }
        let o = albedo::directional(wo.z, self.alpha);
        let (p_glossy, p_returned) = self.probabilities(o);
        let glossy = u.z < p_glossy;
        if let Some(path) = self.mirror(wo).filter(|_| glossy) {
            return Some(BsdfSample {
                wi: path.wi,
                weight: path.weight / p_glossy,
                pdf: p_glossy,
                delta: true,
                transmitted: false,
                spread: 0.0,
            });
        }
        let (wi, spread) = if glossy {
            let h = ggx::sample(wo, self.alpha, u.truncate());
            (2.0 * wo.dot(h) * h - wo, 0.5 * self.alpha)
        } else if u.z < p_glossy + p_returned {
            (albedo::sample_lost(self.alpha, u.truncate()), DIFFUSE_SPREAD)
        } else {
            (warp::cosine_hemisphere(u.truncate()), DIFFUSE_SPREAD)
        };
        if wi.z <= 0.0 {
            return None;
        }
        scattered(wi, self.evaluate_lobes(wo, wi, o, (p_glossy, p_returned)), spread)
    }
}
