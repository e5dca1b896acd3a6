//! The filters of a frame and their histories: what makes clean pictures of one sample a pixel.
//!
//! Filters are those of `rayburst-denoise`; here is which signal goes through which of them.

use rayburst_denoise::{
    Accumulation, AdaptiveSvgf, EdgeStopping, FireflyFilter, FireflySettings, GradientSettings,
    Guides, OcclusionFilter, OcclusionSettings, Reprojection, ShadowFilter, ShadowHistory,
    ShadowHistorySettings, ShadowSettings, SurfaceTests, Surfaces, Svgf, SvgfSettings, TaaSettings,
    Taps, TemporalAntialiasing, TemporalUpscaling, UpscaleSettings, Wavelet,
};
use rayburst_image::{Plane, Plane3};
use rayburst_math::glam::Vec3;
use rayburst_simd::IsaLevel;

use super::{
    composite::Lights,
    demodulate::{Sum, demodulate},
    gbuffer::GBuffer,
    settings::{Denoiser, FrameMode, FrameSettings},
    signals::Signals,
    view::FrameView,
};
use crate::Result;

/// Levels of the wavelet transform.
const LEVELS: u32 = 5;

/// Least weight of the newest frame in what mirrors and glass show, and levels of its blur.
const MIRROR_WEIGHT: f32 = 0.2;
const MIRROR_LEVELS: u32 = 1;

/// Twice the tangent of half the angle of lights whose shadows are filtered, as seen from a surface. Polygon
/// lights are of all sizes; narrow kernels leave noise that the history averages.
const LIGHT_SIZE: f32 = 0.2;

/// Differences of luminance that the wavelet transform alone takes for noise, in means of the picture.
const CONTRAST: f32 = 4.0;

/// White is so many times brighter than the mean of a picture.
const WHITE: f32 = 4.0;

/// All filters of a frame, kept with its history.
#[derive(Clone, Debug, Default)]
pub(crate) struct Filters {
    state: Option<Box<State>>,
}

/// Filters for one instruction set and one denoiser.
#[derive(Clone, Debug)]
struct State {
    isa: IsaLevel,
    denoiser: Denoiser,
    firefly: FireflyFilter,
    kind: Kind,
    mirrors: Mirrors,
    /// Where surfaces were, if the denoiser does not look for them.
    reprojection: Reprojection,
    antialiasing: TemporalAntialiasing,
    upscaling: TemporalUpscaling,
    /// What goes into the filters.
    sums: [Plane3; 3],
    /// What comes out.
    filtered: [Plane3; 3],
    shadow: Plane,
    occlusion: Plane,
    scratch: Plane,
    /// Mean luminance of pictures, smoothed over frames.
    brightness: f32,
}

/// What is seen in mirrors and glass.
#[derive(Clone, Debug)]
struct Mirrors {
    filter: Svgf<1>,
    filtered: Plane3,
}

#[derive(Clone, Debug)]
enum Kind {
    None,
    Wavelet(Box<Wavelet<2>>),
    Svgf(Box<Svgf<2>>),
    Adaptive(Box<AdaptiveSvgf<2>>),
    Effects(Box<Effects>),
}

/// A filter for each effect.
#[derive(Clone, Debug)]
struct Effects {
    light: Svgf<3>,
    surfaces: Surfaces,
    shadow: ShadowFilter,
    shadow_history: ShadowHistory,
    occlusion: OcclusionFilter,
    occlusion_history: ShadowHistory,
}

/// A frame that is to be filtered.
#[derive(Clone, Copy)]
pub(crate) struct Filtering<'a> {
    pub(crate) gbuffer: &'a GBuffer,
    pub(crate) signals: &'a Signals,
    pub(crate) settings: &'a FrameSettings,
    pub(crate) view: &'a FrameView,
    /// Whether there is light of polygon lights in closed form.
    pub(crate) polygons: bool,
    /// How far ambient occlusion reaches.
    pub(crate) reach: f32,
    /// Radiance from everywhere that is to be occluded.
    pub(crate) ambient: Vec3,
}

impl Filtering<'_> {
    fn guides(&self) -> Guides<'_> {
        let gbuffer = self.gbuffer;
        Guides {
            depth: &gbuffer.depth,
            normal: &gbuffer.normal,
            object: &gbuffer.instance,
            motion: &gbuffer.motion,
            depth_motion: Some(&gbuffer.depth_motion),
        }
    }
}

impl Kind {
    fn new(denoiser: Denoiser, isa: IsaLevel) -> Self {
        match denoiser {
            Denoiser::None => Self::None,
            Denoiser::Atrous => Self::Wavelet(Box::new(Wavelet::new(isa))),
            Denoiser::Svgf => Self::Svgf(Box::new(Svgf::new(isa))),
            Denoiser::AdaptiveSvgf => Self::Adaptive(Box::new(AdaptiveSvgf::new(isa))),
            Denoiser::Effects => Self::Effects(Box::new(Effects {
                light: Svgf::new(isa),
                surfaces: Surfaces::new(isa),
                shadow: ShadowFilter::new(isa),
                shadow_history: ShadowHistory::new(isa),
                occlusion: OcclusionFilter::new(isa),
                occlusion_history: ShadowHistory::new(isa),
            })),
        }
    }

    /// Where the filter found surfaces in the frame before.
    fn taps(&self) -> Option<&Plane<Taps>> {
        match self {
            Self::None | Self::Wavelet(_) => None,
            Self::Svgf(svgf) => Some(svgf.reprojection().taps()),
            Self::Adaptive(adaptive) => Some(adaptive.svgf().reprojection().taps()),
            Self::Effects(effects) => Some(effects.light.reprojection().taps()),
        }
    }
}

impl State {
    fn new(denoiser: Denoiser, isa: IsaLevel) -> Self {
        Self {
            isa,
            denoiser,
            firefly: FireflyFilter::new(isa),
            kind: Kind::new(denoiser, isa),
            mirrors: Mirrors { filter: Svgf::new(isa), filtered: Plane3::default() },
            reprojection: Reprojection::new(),
            antialiasing: TemporalAntialiasing::new(isa),
            upscaling: TemporalUpscaling::new(isa),
            sums: Default::default(),
            filtered: Default::default(),
            shadow: Plane::default(),
            occlusion: Plane::default(),
            scratch: Plane::default(),
            brightness: 0.0,
        }
    }
}

impl Filters {
    fn state(&mut self, denoiser: Denoiser, isa: IsaLevel) -> &mut State {
        let fits = |state: &State| state.denoiser == denoiser && state.isa == isa;
        if !self.state.as_deref().is_some_and(fits) {
            self.state = None;
        }
        self.state.get_or_insert_with(|| Box::new(State::new(denoiser, isa)))
    }

    /// Filters a frame's signals.
    pub(crate) fn lights<'a>(
        &'a mut self,
        isa: IsaLevel,
        frame: &Filtering<'a>,
    ) -> Result<Lights<'a>> {
        let denoiser = frame.settings.denoiser;
        let state = self.state(denoiser, isa);
        let Filtering { signals, gbuffer, .. } = *frame;
        let size = gbuffer.size();
        if denoiser == Denoiser::None {
            return Ok(signals.lights());
        }
        let mirrors = denoiser != Denoiser::Atrous && gbuffer.has_mirrors();
        if mirrors {
            state.mirrors.run(frame)?;
        } else {
            state.mirrors.filter.reset();
        }
        for planes in state.sums.iter_mut().chain(&mut state.filtered) {
            if planes.size() != size {
                *planes = Plane3::new(size.0, size.1)?;
            }
        }
        if let Kind::Effects(_) = state.kind {
            return state.effects(frame, mirrors);
        }
        let guides = frame.guides();
        let State { firefly, kind, sums: [direct, indirect, scratch], filtered, .. } = state;
        demodulate(isa, signals, Sum::Direct, direct);
        demodulate(isa, signals, Sum::Indirect(frame.ambient), scratch);
        firefly.filter(scratch, &dimming(frame.settings), indirect)?;
        let [a, b, _] = filtered;
        let mut out = [std::mem::take(a), std::mem::take(b)];
        let done = match kind {
            Kind::Wavelet(wavelet) => {
                // Without a variance the tolerance is absolute.
                let mean = mean_luminance(direct) + mean_luminance(indirect);
                let luminance = (CONTRAST * mean).clamp(1e-3, 1e9);
                let stopping = EdgeStopping { luminance, ..EdgeStopping::default() };
                wavelet.filter(&guides, [direct, indirect], None, LEVELS, &stopping, &mut out)
            }
            Kind::Svgf(svgf) => {
                svgf.filter(&guides, [direct, indirect], &svgf_settings(), &mut out)
            }
            Kind::Adaptive(adaptive) => {
                let gradients = GradientSettings { dead_zone: 0.3, ..GradientSettings::default() };
                let signals = [&*direct, &*indirect];
                adaptive.filter(&guides, signals, None, &svgf_settings(), &gradients, &mut out)
            }
            Kind::None | Kind::Effects(_) => Ok(()),
        };
        [*a, *b] = out;
        done?;
        Ok(Lights {
            direct: [a, a],
            indirect: [b, b],
            analytic: None,
            shadow: &signals.shadow,
            transparency: if mirrors { &state.mirrors.filtered } else { &signals.transparency },
            ambient_occlusion: None,
        })
    }

    /// Takes a finished picture in, and gives one without edges of stairs, at the size of the settings.
    pub(crate) fn show(
        &mut self,
        isa: IsaLevel,
        frame: &Filtering<'_>,
        picture: &Plane3,
        out: &mut Plane3,
    ) -> Result<()> {
        let state = self.state(frame.settings.denoiser, isa);
        let guides = frame.guides();
        let taps = match state.kind.taps() {
            Some(taps) => taps,
            None => state.reprojection.advance(&guides, &SurfaceTests::default())?,
        };
        let mean = mean_luminance(picture);
        let first = state.brightness <= 0.0;
        state.brightness += if first { mean } else { 0.1 * (mean - state.brightness) };
        let dimming = if state.brightness > 0.0 { 1.0 / (WHITE * state.brightness) } else { 0.0 };
        let (size, jitter) = (frame.settings.size, frame.view.jitter());
        if frame.gbuffer.size() == size {
            let settings = TaaSettings { dimming, ..TaaSettings::default() };
            let antialiasing = &mut state.antialiasing;
            antialiasing.resolve(picture, &guides, jitter, Some(taps), &settings, out)?;
        } else {
            let settings = UpscaleSettings { dimming, ..UpscaleSettings::default() };
            let upscaling = &mut state.upscaling;
            upscaling.resolve(picture, &guides, jitter, Some(taps), &settings, size, out)?;
        }
        Ok(())
    }
}

impl Mirrors {
    /// Filters what mirrors and glass show. Histories are short, as images move otherwise than what shows
    /// them; materials are kept apart instead of objects, so that frames do not darken their panes.
    fn run(&mut self, frame: &Filtering<'_>) -> Result<()> {
        let (gbuffer, transparency) = (frame.gbuffer, &frame.signals.transparency);
        let guides = Guides { object: &gbuffer.material, ..frame.guides() };
        let accumulation = Accumulation { alpha: MIRROR_WEIGHT, ..Accumulation::default() };
        let settings =
            SvgfSettings { accumulation, levels: MIRROR_LEVELS, ..SvgfSettings::default() };
        let size = gbuffer.size();
        let mut out = [std::mem::take(&mut self.filtered)];
        if out[0].size() != size {
            out[0] = Plane3::new(size.0, size.1)?;
        }
        let done = self.filter.filter(&guides, [transparency], &settings, &mut out);
        [self.filtered] = out;
        Ok(done?)
    }
}

impl State {
    /// A filter for each effect: direct light, bounces and reflections over time and space, guided by how
    /// much they vary; shadows of polygon lights by their penumbrae; ambient occlusion by how near the
    /// occluder is.
    fn effects<'a>(&'a mut self, frame: &Filtering<'a>, mirrors: bool) -> Result<Lights<'a>> {
        let Filtering { signals, gbuffer, settings, polygons, reach, .. } = *frame;
        let guides = frame.guides();
        let [direct, bounces, reflections] = &mut self.sums;
        demodulate(self.isa, signals, Sum::DirectSampled, direct);
        let dim = dimming(settings);
        self.firefly.filter(&signals.indirect_diffuse, &dim, bounces)?;
        self.firefly.filter(&signals.indirect_specular, &dim, reflections)?;
        let Kind::Effects(effects) = &mut self.kind else { return Ok(signals.lights()) };
        let light = [&*direct, &*bounces, &*reflections];
        effects.light.filter(&guides, light, &svgf_settings(), &mut self.filtered)?;
        let taps = effects.light.reprojection().taps();
        let occluded = settings.mode == FrameMode::Hybrid && settings.passes.ambient_occlusion;
        if polygons || occluded {
            effects.surfaces.prepare(&guides, &gbuffer.footprint)?;
        }
        let history = ShadowHistorySettings::default();
        let shadow = if polygons {
            let light = rayburst_denoise::LightSize::Everywhere(LIGHT_SIZE);
            effects.shadow.filter(
                &effects.surfaces,
                &signals.shadow,
                &signals.shadow_distance,
                light,
                &ShadowSettings::default(),
                &mut self.scratch,
            )?;
            let (scratch, shadow) = (&self.scratch, &mut self.shadow);
            effects.shadow_history.accumulate(scratch, taps, &history, shadow)?;
            &self.shadow
        } else {
            &signals.shadow
        };
        let ambient_occlusion = if occluded {
            effects.occlusion.filter(
                &effects.surfaces,
                &signals.ambient_occlusion,
                &signals.occluder_distance,
                &OcclusionSettings { reach, ..OcclusionSettings::default() },
                &mut self.scratch,
            )?;
            let (scratch, occlusion) = (&self.scratch, &mut self.occlusion);
            effects.occlusion_history.accumulate(scratch, taps, &history, occlusion)?;
            &self.occlusion
        } else {
            &signals.ambient_occlusion
        };
        let [direct, bounces, reflections] = &self.filtered;
        Ok(Lights {
            direct: [direct, direct],
            indirect: [bounces, reflections],
            analytic: Some([&signals.analytic_diffuse, &signals.analytic_specular]),
            shadow,
            transparency: if mirrors { &self.mirrors.filtered } else { &signals.transparency },
            ambient_occlusion: Some(ambient_occlusion),
        })
    }
}

fn svgf_settings() -> SvgfSettings {
    SvgfSettings { levels: LEVELS, ..SvgfSettings::default() }
}

/// Blocks of 2×2 pixels share what is indirect in hybrid frames.
fn dimming(settings: &FrameSettings) -> FireflySettings {
    let spacing = if settings.mode == FrameMode::Hybrid { 2 } else { 1 };
    FireflySettings { spacing, ..FireflySettings::default() }
}

/// Of the finite pixels of a picture.
fn mean_luminance(picture: &Plane3) -> f32 {
    let (width, height) = picture.size();
    let (mut sum, mut count) = (0.0f64, 0u64);
    for y in (0..height).step_by(4) {
        for x in (0..width).step_by(4) {
            let value = rayburst_image::colour::luminance(picture.get(x, y));
            if value.is_finite() {
                sum += f64::from(value);
                count += 1;
            }
        }
    }
    if count > 0 { (sum / count as f64) as f32 } else { 0.0 }
}
