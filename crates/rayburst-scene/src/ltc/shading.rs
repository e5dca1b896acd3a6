//! A surface prepared for polygon lights, and the light of one of them.

use glam::Vec3;
use rayburst_math::Frame;

use super::{
    axial::{COSINE, Profile, albedo_profiles},
    polygon::SeenPolygon,
    table::{Lobe, Part},
};
use crate::{
    Bsdf, ShadingPoint,
    bsdf::{AreaTerms, albedo},
};

/// Polygons of fewer steradians are integrated by the value of a function in their middle.
const SMALL: f32 = 1e-3;

/// Albedos of the lobe towards grazing angles below this are added to the other lobe's.
const FAINT: f32 = 2e-3;

/// ∫f·cos θ dω over the directions of a light of radiance 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PolygonIntegral {
    /// Of the base.
    pub diffuse: Vec3,
    /// Of the GGX lobe, with the light that multiple scattering returns.
    pub specular: Vec3,
}

impl PolygonIntegral {
    /// Both.
    #[inline]
    pub fn total(&self) -> Vec3 {
        self.diffuse + self.specular
    }
}

/// A point of a surface seen from one direction, ready for any number of polygon lights.
#[derive(Clone, Copy, Debug)]
pub struct PolygonShading {
    position: Vec3,
    frame: Frame,
    /// In the frame, on the side of the view.
    geometric_normal: Vec3,
    terms: AreaTerms,
    profiles: [Profile; 3],
    /// `None` without a GGX lobe, or where it is a perfect mirror.
    lobes: Option<[Lobe; 2]>,
}

impl PolygonShading {
    /// Prepares a point at `position` that is seen from the unit direction `wo`. `None` if light
    /// sampling is in vain there, because all directions are `delta` or nothing is scattered, and
    /// where `wo` is not above the surface.
    ///
    /// As in [`Bsdf::evaluate`] perfect mirrors and coats as smooth are left out of the integrals.
    pub fn new(bsdf: &Bsdf, frame: &Frame, position: Vec3, wo: Vec3) -> Option<Self> {
        let local = frame.to_local(wo);
        let terms = bsdf.area_terms(local.z)?;
        let [a, b] = albedo_profiles(terms.alpha);
        let lobes =
            (terms.alpha > 0.0).then(|| Part::ALL.map(|p| Lobe::new(p, local, terms.alpha)));
        let mut terms = terms;
        if terms.glossy[1].max_element() < FAINT {
            // Little is lost if it comes from where the rest does.
            let [normal, grazing] = &mut terms.glossy;
            *normal += std::mem::take(grazing);
        }
        let geometric_normal = bsdf.geometric_normal();
        Some(Self {
            position,
            frame: *frame,
            geometric_normal,
            terms,
            profiles: [COSINE, a, b],
            lobes,
        })
    }

    /// Of a [`ShadingPoint`] at `position`, see [`PolygonShading::new`].
    pub fn of_point(point: &ShadingPoint, position: Vec3, wo: Vec3) -> Option<Self> {
        Self::new(&point.bsdf, &point.frame, position, wo)
    }

    /// The light of a convex polygon of radiance 1 whose corners are given in order, at most
    /// [`super::MAX_CORNERS`] of them. It shines to both sides; shadows are not known. Zero for
    /// polygons without area and where a corner is not finite.
    pub fn integrate(&self, corners: &[Vec3]) -> PolygonIntegral {
        let seen = self.seen(corners);
        if seen.is_empty() {
            return PolygonIntegral::default();
        }
        let [cosine, a, b] = self.axial(&seen);
        let lost = (cosine - a - b).max(0.0);
        PolygonIntegral {
            diffuse: self.diffuse(cosine, a, b, lost),
            specular: self.glossy(&seen) + self.terms.returned * lost,
        }
    }

    /// The polygon in the frame, what is above the surface of it.
    fn seen(&self, corners: &[Vec3]) -> SeenPolygon {
        let local = corners.iter().map(|&c| self.frame.to_local(c - self.position));
        let above = SeenPolygon::new(local).clip(Vec3::Z);
        if self.geometric_normal == Vec3::Z { above } else { above.clip(self.geometric_normal) }
    }

    /// ∫cos θ, ∫cos θ·a and ∫cos θ·b for the albedos a and b at θ.
    fn axial(&self, seen: &SeenPolygon) -> [f32; 3] {
        if self.terms.coat == [0.0; 3] && self.terms.returned == Vec3::ZERO {
            return [seen.cosine_integral(), 0.0, 0.0];
        }
        let (integrals, solid_angle) = seen.axial_integrals(&self.profiles);
        if solid_angle > SMALL {
            return integrals;
        }
        let [cosine, ..] = integrals;
        let e = albedo::directional(cosine / solid_angle.max(f32::MIN_POSITIVE), self.terms.alpha);
        [cosine, cosine * e.a, cosine * e.b]
    }

    fn diffuse(&self, cosine: f32, a: f32, b: f32, lost: f32) -> Vec3 {
        let [f0, f90, returned] = self.terms.coat;
        self.terms.base * (cosine - f0 * a - f90 * b - returned * lost).max(0.0)
    }

    /// The GGX lobe.
    fn glossy(&self, seen: &SeenPolygon) -> Vec3 {
        let Some(lobes) = &self.lobes else { return Vec3::ZERO };
        let share = |lobe: &Lobe| {
            let there = seen.map(|p| lobe.to_cosine * p).clip(Vec3::Z);
            (there.cosine_share() * lobe.normalisation).min(1.0)
        };
        let [normal, grazing] = self.terms.glossy;
        let light = share(&lobes[0]) * normal;
        if grazing == Vec3::ZERO { light } else { light + share(&lobes[1]) * grazing }
    }
}
