//! What is rendered and how: everything that decides a picture's bits besides scene and camera.

use rayburst_image::{AovSpec, FilterKind, PixelFilter};
use rayburst_math::SamplerKind;
use rayburst_scene::{Camera, ShadingOptions, TextureLod};

use crate::{Aov, IntegratorKind, RenderError, Result};

/// The most samples a pixel of the film can hold.
const MAX_SAMPLES: u32 = rayburst_image::film::MAX_SAMPLES;

/// The longest path.
const MAX_DEPTH: u32 = 1 << 16;

/// Settings of a [`crate::Renderer`]. Two renders with equal settings, scene and camera give the same
/// bits, whatever the number of threads and wherever they are interrupted and resumed.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderSettings {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Samples a pixel.
    pub spp: u32,
    /// What a pixel shows.
    pub integrator: IntegratorKind,
    /// Longest path in rays, the eye ray being the first (chapter 26.1). A shadow ray counts as the
    /// ray after the one whose hit it starts from: at depth 1 only what the eye sees shining is lit.
    pub max_depth: u32,
    /// Root of all randomness.
    pub seed: u32,
    /// Where random numbers come from.
    pub sampler: SamplerKind,
    /// The pixel filter, importance-sampled.
    pub filter: FilterKind,
    /// Its radius in pixels; `None` is the usual one.
    pub filter_radius: Option<f32>,
    /// How textures choose their mip level.
    pub texture_lod: TextureLod,
    /// Which other signals are collected along with the picture.
    pub aovs: Vec<Aov>,
    /// Reach of ambient occlusion rays in world units; infinite by default.
    pub ao_radius: f32,
    /// Which techniques find light.
    pub light_sampling: LightSampling,
    /// Whether rough metals get back the energy that the microfacet model loses.
    pub energy_compensation: bool,
    /// Whether weak paths may end early, at random and without bias.
    pub russian_roulette: bool,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            size: (640, 360),
            spp: 64,
            integrator: IntegratorKind::default(),
            max_depth: 16,
            seed: 0,
            sampler: SamplerKind::default(),
            filter: FilterKind::default(),
            filter_radius: None,
            texture_lod: TextureLod::Cones,
            aovs: Vec::new(),
            ao_radius: f32::INFINITY,
            light_sampling: LightSampling::default(),
            energy_compensation: true,
            russian_roulette: true,
        }
    }
}

impl RenderSettings {
    /// Pixels of the picture.
    pub fn pixels(&self) -> usize {
        self.size.0 as usize * self.size.1 as usize
    }
}

/// Which techniques find light. All three give the same picture on average; the single ones are there
/// to prove it, and cannot find every light: points and directions need `LightOnly`, mirror images
/// need `BsdfOnly`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSampling {
    /// Light and BSDF sampling, combined by the balance heuristic.
    #[default]
    Both,
    /// Shadow rays to sampled points of lights only.
    LightOnly,
    /// Paths that happen to meet a light only; punctual lights keep their shadow rays.
    BsdfOnly,
}

impl LightSampling {
    /// All of them with names.
    pub const ALL: [(&'static str, Self); 3] =
        [("both", Self::Both), ("light", Self::LightOnly), ("bsdf", Self::BsdfOnly)];
}

/// The name of an attribute that holds a property of a render.
pub(crate) fn attribute(name: &str) -> String {
    format!("rayburst.{name}")
}

impl RenderSettings {
    /// Whether every setting is in its range.
    pub(crate) fn check(&self) -> Result<()> {
        let bad = |name, value: String, must_be| Err(RenderError::Setting { name, value, must_be });
        if !(1..=MAX_SAMPLES).contains(&self.spp) {
            return bad("number of samples", self.spp.to_string(), "1 to 16777216");
        }
        if !(1..=MAX_DEPTH).contains(&self.max_depth) {
            return bad("maximum depth", self.max_depth.to_string(), "1 to 65536");
        }
        if !self.filter_radius.is_none_or(|r| r > 0.0 && r <= 64.0) {
            return bad("filter radius", format!("{:?}", self.filter_radius), "in (0, 64] pixels");
        }
        if self.ao_radius.is_nan() || self.ao_radius <= 0.0 {
            return bad("ambient occlusion radius", self.ao_radius.to_string(), "positive");
        }
        Ok(())
    }

    /// The AOVs that the film keeps.
    pub(crate) fn film_aovs(&self) -> Vec<AovSpec> {
        self.aovs.iter().filter_map(|a| a.spec()).collect()
    }

    /// What shading needs to know.
    pub(crate) fn shading(&self) -> ShadingOptions {
        ShadingOptions {
            lod: self.texture_lod,
            energy_compensation: self.energy_compensation,
            ..ShadingOptions::default()
        }
    }

    /// The pixel filter, ready to sample.
    pub(crate) fn pixel_filter(&self) -> PixelFilter {
        match self.filter_radius {
            Some(radius) => PixelFilter::with_radius(self.filter, radius),
            None => PixelFilter::new(self.filter),
        }
    }

    /// Everything that decides the bits of a sample, by name: what a resumed render must share.
    pub(crate) fn properties(&self, camera: &Camera) -> Vec<(&'static str, String)> {
        vec![
            ("size", format!("{}x{}", self.size.0, self.size.1)),
            ("integrator", self.integrator.name().to_owned()),
            ("max_depth", self.max_depth.to_string()),
            ("seed", self.seed.to_string()),
            ("sampler", format!("{:?}", self.sampler)),
            ("filter", format!("{:?} {:?}", self.filter, self.filter_radius)),
            ("texture_lod", format!("{:?}", self.texture_lod)),
            ("aovs", self.aovs.iter().map(|a| a.name()).collect::<Vec<_>>().join(",")),
            ("ao_radius", self.ao_radius.to_string()),
            ("light_sampling", format!("{:?}", self.light_sampling)),
            ("energy_compensation", self.energy_compensation.to_string()),
            ("russian_roulette", self.russian_roulette.to_string()),
            ("camera", format!("{camera:?}")),
        ]
    }
}
