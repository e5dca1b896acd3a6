//! Options of frames in real time.

use rayburst::render::realtime::{Denoiser, FrameSettings, Passes, Technique};

use super::values;
use crate::names;

/// Which passes make a frame, and how.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Frames (hybrid and realtime-path)")]
pub(crate) struct FrameArgs {
    /// How effects are made: EFFECT=auto|raster|rays, with commas; effects are gbuffer, shadows,
    /// reflections, ambient-occlusion
    #[arg(long, value_name = "LIST", value_parser = techniques)]
    pub(crate) techniques: Option<TechniqueList>,
    /// Passes that run, with commas: direct, shadows, reflections, indirect, ambient-occlusion,
    /// transparency, emission, ambient [default: all]
    #[arg(long, value_name = "LIST", value_parser = passes)]
    pub(crate) passes: Option<PassList>,
    /// Filter of the light: none, atrous (each frame alone), svgf, asvgf (forgets where light changes),
    /// effects (a filter for each effect); a picture is the last of its --spp frames
    #[arg(long, value_name = "NAME", value_parser = denoiser)]
    pub(crate) denoise: Option<Denoiser>,
    /// Average frames along their motion: smooth edges, and pictures of --size whatever is rendered
    #[arg(long)]
    pub(crate) antialias: bool,
}

impl FrameArgs {
    /// Changes settings as the options ask.
    pub(crate) fn apply(&self, settings: &mut FrameSettings) {
        for (effect, technique) in self.techniques.iter().flat_map(|list| &list.0) {
            *effect.of(settings) = *technique;
        }
        if let Some(PassList(passes)) = self.passes {
            settings.passes = passes;
        }
        settings.denoiser = self.denoise.unwrap_or(settings.denoiser);
        settings.antialias |= self.antialias;
    }
}

/// An effect that can be made in several ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    GBuffer,
    Shadows,
    Reflections,
    AmbientOcclusion,
}

impl Effect {
    const ALL: [(&'static str, Self); 4] = [
        ("gbuffer", Self::GBuffer),
        ("shadows", Self::Shadows),
        ("reflections", Self::Reflections),
        ("ambient-occlusion", Self::AmbientOcclusion),
    ];

    /// The setting that says how.
    fn of(self, settings: &mut FrameSettings) -> &mut Technique {
        match self {
            Self::GBuffer => &mut settings.gbuffer,
            Self::Shadows => &mut settings.shadows,
            Self::Reflections => &mut settings.reflections,
            Self::AmbientOcclusion => &mut settings.ambient_occlusion,
        }
    }
}

fn denoiser(given: &str) -> Result<Denoiser, String> {
    named("denoiser", &Denoiser::ALL, given)
}

/// How effects are made; those that are not named as usual.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TechniqueList(Vec<(Effect, Technique)>);

fn techniques(given: &str) -> Result<TechniqueList, String> {
    let one = |item: &str| {
        let Some((effect, technique)) = item.split_once('=') else {
            return Err(format!("'{item}' is not EFFECT=TECHNIQUE, such as shadows=rays"));
        };
        let effect = named("effect", &Effect::ALL, effect.trim())?;
        Ok((effect, named("technique", &Technique::ALL, technique.trim())?))
    };
    let items: Vec<&str> = given.split(',').map(str::trim).filter(|i| !i.is_empty()).collect();
    if items.is_empty() {
        return Err("no effect is named".into());
    }
    items.into_iter().map(one).collect::<Result<_, _>>().map(TechniqueList)
}

fn named<T: Copy>(kind: &str, all: &[(&'static str, T)], given: &str) -> Result<T, String> {
    all.iter().find(|(name, _)| *name == given).map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
        names::unknown(kind, given, &known)
    })
}

/// The passes that run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PassList(Passes);

/// Passes by name: where each stands among all.
const PASSES: [(&str, usize); 8] = [
    ("direct", 0),
    ("shadows", 1),
    ("reflections", 2),
    ("indirect", 3),
    ("ambient-occlusion", 4),
    ("transparency", 5),
    ("emission", 6),
    ("ambient", 7),
];

fn passes(given: &str) -> Result<PassList, String> {
    let mut runs = [false; PASSES.len()];
    for pass in values::choices("pass", &PASSES, given)? {
        runs[pass] = true;
    }
    let [
        direct,
        shadows,
        reflections,
        indirect,
        ambient_occlusion,
        transparency,
        emission,
        ambient,
    ] = runs;
    Ok(PassList(Passes {
        direct,
        shadows,
        reflections,
        indirect,
        ambient_occlusion,
        transparency,
        emission,
        ambient,
    }))
}

/// The size that is rendered, as a part of the picture's.
pub(crate) fn render_scale(given: &str) -> Result<f32, String> {
    let scale = values::number(given)?;
    if (0.5..=1.0).contains(&scale) { Ok(scale) } else { Err("must be from 0.5 to 1".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_have_techniques() {
        let list = techniques("gbuffer=rays, ambient-occlusion=auto").unwrap();
        let mut settings = FrameSettings { gbuffer: Technique::Raster, ..FrameSettings::default() };
        let args = FrameArgs {
            techniques: Some(list),
            denoise: Some(denoiser("asvgf").unwrap()),
            antialias: true,
            ..FrameArgs::default()
        };
        args.apply(&mut settings);
        assert!(denoiser("svfg").unwrap_err().contains("did you mean 'svgf'?"));
        let expected = FrameSettings {
            denoiser: Denoiser::AdaptiveSvgf,
            antialias: true,
            gbuffer: Technique::Rays,
            ambient_occlusion: Technique::Auto,
            ..FrameSettings::default()
        };
        assert_eq!(settings, expected);
        let error = techniques("shadow=rays").unwrap_err();
        assert!(error.contains("did you mean 'shadows'?"), "{error}");
        assert!(techniques("shadows=ray").unwrap_err().contains("auto, raster, rays"));
        assert!(techniques("shadows").is_err() && techniques(" ,").is_err());
    }

    #[test]
    fn only_the_passes_that_are_named_run() {
        let all: Vec<&str> = PASSES.iter().map(|(name, _)| *name).collect();
        assert_eq!(passes(&all.join(",")), Ok(PassList(Passes::ALL)));
        let PassList(some) = passes("emission,ambient-occlusion").unwrap();
        assert!(some.emission && some.ambient_occlusion);
        assert!(!(some.direct || some.shadows || some.reflections || some.indirect));
        assert!(!(some.transparency || some.ambient));
        assert!(passes("indirct").unwrap_err().contains("did you mean 'indirect'?"));
        assert_eq!(render_scale("0.5"), Ok(0.5));
        assert!(render_scale("0.49").is_err() && render_scale("nan").is_err());
    }
}
