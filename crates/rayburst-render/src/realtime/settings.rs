//! What a frame consists of.

use rayburst_math::SamplerKind;
use rayburst_scene::{ShadingOptions, TextureLod};

use crate::{RenderError, Result};

/// The most taps of a texture lookup in a frame: anisotropy beyond that is blurred.
const FRAME_TAPS: u32 = 4;

/// How a frame is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum FrameMode {
    /// A G-buffer, then a pass for each effect, with about two and a quarter rays a pixel (the pipeline of
    /// chapter 26.2).
    #[default]
    Hybrid,
    /// One path a pixel, with shadow rays at every hit but the last.
    Path,
}

impl FrameMode {
    /// All of them with the names that users type.
    pub const ALL: [(&'static str, Self); 2] =
        [("hybrid", Self::Hybrid), ("realtime-path", Self::Path)];

    /// The name that users type.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, mode)| *mode == self).map_or("", |(name, _)| name)
    }
}

/// Which way an effect is made that can be rasterised or traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Technique {
    /// What takes less time, measured frame by frame, among what is good enough for
    /// [`FrameSettings::quality`]. Pictures may then depend on the machine.
    Auto,
    /// By rasterising, or in screen space.
    Raster,
    /// By rays.
    #[default]
    Rays,
}

impl Technique {
    /// All of them with the names that users type.
    pub const ALL: [(&'static str, Self); 3] =
        [("auto", Self::Auto), ("raster", Self::Raster), ("rays", Self::Rays)];
}

/// How good effects have to be for [`Technique::Auto`] to take them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Quality {
    /// Right: of the effects, only rays are.
    #[default]
    Exact,
    /// Whatever is fastest.
    Fast,
}

/// How the light of frames is filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Denoiser {
    /// Not at all.
    #[default]
    None,
    /// The edge-avoiding wavelet transform of each frame alone (Dammertz et al. 2010).
    Atrous,
    /// Spatiotemporal variance-guided filtering of direct and indirect light (Schied et al. 2017).
    Svgf,
    /// The same that forgets where light has changed (Schied et al. 2018).
    AdaptiveSvgf,
    /// A filter for each effect.
    Effects,
}

impl Denoiser {
    /// All of them with the names that users type.
    pub const ALL: [(&'static str, Self); 5] = [
        ("none", Self::None),
        ("atrous", Self::Atrous),
        ("svgf", Self::Svgf),
        ("asvgf", Self::AdaptiveSvgf),
        ("effects", Self::Effects),
    ];

    /// The name that users type.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, denoiser)| *denoiser == self).map_or("", |(name, _)| name)
    }
}

/// Settings of a [`super::FrameRenderer`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameSettings {
    /// Width and height of the finished frame in pixels.
    pub size: (u32, u32),
    /// Size that is rendered, as a fraction of `size` along each side, 0.5 to 1.
    pub render_scale: f32,
    /// How the frame is made.
    pub mode: FrameMode,
    /// Longest path in rays, the eye ray being the first, a shadow ray counting as the ray after the one
    /// whose hit it starts from.
    pub max_depth: u32,
    /// Root of all randomness.
    pub seed: u32,
    /// Where random numbers come from.
    pub sampler: SamplerKind,
    /// Whether rays go through other points of the pixels in every frame, for temporal filters.
    pub jitter: bool,
    /// How textures choose their mip level.
    pub texture_lod: TextureLod,
    /// Whether rough surfaces give back the light that single scattering loses.
    pub energy_compensation: bool,
    /// How the G-buffer is made.
    pub gbuffer: Technique,
    /// How shadows of punctual lights are made.
    pub shadows: Technique,
    /// How reflections are made.
    pub reflections: Technique,
    /// How ambient occlusion is made.
    pub ambient_occlusion: Technique,
    /// What [`Technique::Auto`] may take.
    pub quality: Quality,
    /// Which passes run.
    pub passes: Passes,
    /// Reach of ambient occlusion, world units; by default a twentieth of the scene's diagonal.
    pub ao_radius: Option<f32>,
    /// Pixels along the side of the blocks that repeat the same directions, so that rays of a direction
    /// can be traced together (interleaved sampling: Keller, Heidrich, 2001); 1 is none.
    pub interleave: u32,
    /// How the light is filtered.
    pub denoiser: Denoiser,
    /// Whether frames are averaged along their motion, which takes away edges of stairs and gives the
    /// picture the size `size` whatever the size that is rendered; wants `jitter`.
    pub antialias: bool,
}

/// Passes that can be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passes {
    /// Light that comes from lights directly.
    pub direct: bool,
    /// Shadow rays of direct light; without them everything is lit.
    pub shadows: bool,
    /// Reflections off glossy surfaces.
    pub reflections: bool,
    /// Light by way of other surfaces, and of the sky.
    pub indirect: bool,
    /// Ambient occlusion, which darkens what stands for light beyond the longest path.
    pub ambient_occlusion: bool,
    /// Mirrors and glass.
    pub transparency: bool,
    /// What shines, and the sky behind everything.
    pub emission: bool,
    /// An estimate of the light of longer paths than are traced.
    pub ambient: bool,
}

impl Passes {
    /// All of them.
    pub const ALL: Self = Self {
        direct: true,
        shadows: true,
        reflections: true,
        indirect: true,
        ambient_occlusion: true,
        transparency: true,
        emission: true,
        ambient: true,
    };
}

impl Default for FrameSettings {
    fn default() -> Self {
        Self {
            size: (640, 360),
            render_scale: 1.0,
            mode: FrameMode::Hybrid,
            max_depth: 3,
            seed: 0,
            sampler: SamplerKind::Blue,
            jitter: true,
            texture_lod: TextureLod::Cones,
            energy_compensation: true,
            gbuffer: Technique::Rays,
            shadows: Technique::Rays,
            reflections: Technique::Rays,
            ambient_occlusion: Technique::Rays,
            quality: Quality::Exact,
            passes: Passes::ALL,
            ao_radius: None,
            interleave: 1,
            denoiser: Denoiser::None,
            antialias: false,
        }
    }
}

impl FrameSettings {
    /// The size that is rendered: at least one pixel along each side.
    pub fn render_size(&self) -> (u32, u32) {
        let scaled = |side: u32| ((side as f32 * self.render_scale).round() as u32).max(1);
        (scaled(self.size.0), scaled(self.size.1))
    }

    /// The size of the finished picture: `size` with antialiasing, else the one that is rendered.
    pub fn picture_size(&self) -> (u32, u32) {
        if self.antialias { self.size } else { self.render_size() }
    }

    /// What shading needs to know.
    pub(crate) fn shading(&self) -> ShadingOptions {
        ShadingOptions {
            lod: self.texture_lod,
            energy_compensation: self.energy_compensation,
            most_taps: FRAME_TAPS,
            most_detail_taps: 1,
        }
    }

    /// The same for hits beyond the first.
    pub(crate) fn path_shading(&self) -> ShadingOptions {
        ShadingOptions { most_taps: 1, ..self.shading() }
    }

    /// Whether every setting is in its range.
    pub(crate) fn check(&self) -> Result<()> {
        let bad = |name, value: String, must_be| Err(RenderError::Setting { name, value, must_be });
        if !(0.5..=1.0).contains(&self.render_scale) {
            return bad("render scale", self.render_scale.to_string(), "0.5 to 1");
        }
        if !(1..=1 << 16).contains(&self.max_depth) {
            return bad("maximum depth", self.max_depth.to_string(), "1 to 65536");
        }
        if !(1..=64).contains(&self.interleave) {
            return bad("interleaving", self.interleave.to_string(), "1 to 64 pixels");
        }
        if self.ao_radius.is_some_and(|r| r.is_nan() || r <= 0.0) {
            let value = format!("{:?}", self.ao_radius);
            return bad("ambient occlusion radius", value, "positive");
        }
        Ok(())
    }
}
