//! Signals that are collected along with the picture (arbitrary output variables).

use rayburst_image::{AovMode, AovSpec, Precision};
use rayburst_math::glam::Vec3;
use rayburst_math::{Hit, Ray};

use crate::{RayFootprint, batch::Context};
use rayburst_scene::{ShadingPoint, Surface};

/// A signal of the first hit of each eye ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aov {
    /// Reflectance, or the colour of what shines; linear Rec. 709.
    Albedo,
    /// Unit shading normal in the world, on the side of the eye, averaged over the pixel.
    Normal,
    /// Distance from the eye to the first sample's hit, world units; 0 without a hit.
    Depth,
    /// Position in the world of the first sample's hit; 0 without a hit.
    Position,
    /// Number of the node, from 0, at the first sample; −1 without a hit.
    Instance,
    /// Number of the material, from 0, at the first sample; −1 without a hit.
    Material,
    /// Variance of the luminance of the pixel's mean.
    Variance,
}

impl Aov {
    /// All of them with the names that users type and that layers carry.
    pub const ALL: [(&'static str, Self); 7] = [
        ("albedo", Self::Albedo),
        ("normal", Self::Normal),
        ("depth", Self::Depth),
        ("position", Self::Position),
        ("instance", Self::Instance),
        ("material", Self::Material),
        ("variance", Self::Variance),
    ];

    /// The name that users type and that the layer carries.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, a)| *a == self).map_or("", |(name, _)| name)
    }
}

/// The most values that a sample's AOVs can have together.
pub(crate) const MAX_VALUES: usize = 12;

impl Aov {
    /// How the film keeps it; `None` for what the film computes itself.
    pub(crate) fn spec(self) -> Option<AovSpec> {
        let (channels, mode, precision): (&[&str], _, _) = match self {
            Self::Albedo => (&["R", "G", "B"], AovMode::Mean, Precision::Half),
            Self::Normal => (&["X", "Y", "Z"], AovMode::Mean, Precision::Half),
            Self::Depth => (&["Z"], AovMode::First, Precision::Float),
            Self::Position => (&["X", "Y", "Z"], AovMode::First, Precision::Float),
            Self::Instance | Self::Material => (&["id"], AovMode::First, Precision::Float),
            Self::Variance => return None,
        };
        Some(AovSpec::new(self.name(), channels, mode, precision))
    }

    /// Writes the values of one sample, as many as [`Aov::spec`] has channels; returns how many.
    pub(crate) fn values(self, features: &Features, out: &mut [f32]) -> usize {
        let id = |id: u32| if id == u32::MAX { -1.0 } else { id as f32 };
        let vector = match self {
            Self::Albedo => features.albedo,
            Self::Normal => features.normal,
            Self::Position => features.position,
            Self::Depth | Self::Instance | Self::Material | Self::Variance => {
                out[0] = match self {
                    Self::Depth => features.depth,
                    Self::Instance => id(features.instance),
                    Self::Material => id(features.material),
                    _ => return 0,
                };
                return 1;
            }
        };
        out[..3].copy_from_slice(&vector.to_array());
        3
    }
}

/// What the first hit of an eye ray leaves for the AOVs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Features {
    /// See [`Aov::Albedo`].
    pub(crate) albedo: Vec3,
    /// See [`Aov::Normal`].
    pub(crate) normal: Vec3,
    /// See [`Aov::Position`].
    pub(crate) position: Vec3,
    /// Distance; infinite without a hit.
    pub(crate) depth: f32,
    /// Node; `u32::MAX` without a hit.
    pub(crate) instance: u32,
    /// Material; `u32::MAX` without a hit.
    pub(crate) material: u32,
}

impl Features {
    /// What an eye ray that leaves the scene leaves.
    pub(crate) const MISS: Self = Self {
        albedo: Vec3::ZERO,
        normal: Vec3::ZERO,
        position: Vec3::ZERO,
        depth: f32::INFINITY,
        instance: u32::MAX,
        material: u32::MAX,
    };
}

impl Features {
    /// What an eye ray meets.
    pub(crate) fn of_hit(
        context: &Context<'_>,
        ray: &Ray,
        hit: &Hit,
        footprint: &RayFootprint,
    ) -> Self {
        let surface = context.scene.surface(hit);
        let options = context.settings.shading();
        let seen = footprint.at(ray, hit, &surface);
        let point = context.scene.shading_point(&surface, -ray.direction, seen, &options);
        Self::new(ray, hit, &surface, &point)
    }

    /// The same of what is known already.
    pub(crate) fn new(ray: &Ray, hit: &Hit, surface: &Surface, point: &ShadingPoint) -> Self {
        Self {
            albedo: point.base_color,
            normal: point.frame.normal,
            position: surface.position,
            depth: hit.t * ray.direction.length(),
            instance: surface.node,
            material: surface.material,
        }
    }
}
