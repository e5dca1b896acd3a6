//! Options of `rayburst render`.

use std::{ops::RangeInclusive, path::PathBuf};

use rayburst::{
    accel::IsaLevel,
    image::{FilterKind, ToneMap},
    math::SamplerKind,
    render::{Aov, realtime::FrameLayer},
    scene::TextureLod,
};

use super::{
    frames::{self, FrameArgs},
    scene::{CameraArgs, LightArgs, SceneArgs},
    values::{self, Exposure},
};
use crate::{
    error::{CliError, Result},
    method::Method,
};

/// What is computed, and how well.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Quality")]
pub(crate) struct QualityArgs {
    /// Width and height in pixels [default: the built-in scene's own, or 960x540]
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    pub(crate) size: Option<(u32, u32)>,
    /// Samples a pixel [default: 256; 16 for the views of surfaces; no end with --budget or --noise; 1
    /// for hybrid and realtime-path, which take the mean of so many frames of an instant]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16_777_216))]
    pub(crate) spp: Option<u32>,
    /// What a pixel shows; hybrid and realtime-path render frames as in real time
    #[arg(long, value_name = "NAME", default_value = Method::default().name(),
          value_parser = values::choice(&Method::ALL))]
    pub(crate) integrator: Method,
    /// Longest path in rays; the eye ray is the first [default: 16; 3 for hybrid and realtime-path]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub(crate) max_depth: Option<u32>,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u32,
    /// Where random numbers come from [default: sobol; blue for hybrid and realtime-path]
    #[arg(long, value_name = "NAME", value_parser = values::choice(&SamplerKind::ALL))]
    pub(crate) sampler: Option<SamplerKind>,
    /// Pixel filter; not for hybrid and realtime-path [default: blackman-harris]
    #[arg(long, value_name = "NAME", value_parser = values::choice(&FilterKind::ALL))]
    pub(crate) filter: Option<FilterKind>,
    /// How textures choose their mip level
    #[arg(long, value_name = "NAME", default_value = TextureLod::default().name(),
          value_parser = values::choice(&TextureLod::ALL))]
    pub(crate) texture_lod: TextureLod,
}

/// What the machine does.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Machine")]
pub(crate) struct MachineArgs {
    /// Threads [default: one a core]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub(crate) threads: Option<usize>,
    /// Instruction set of the tracing kernels [default: the best]
    #[arg(long, value_name = "NAME", value_parser = isa)]
    pub(crate) isa: Option<IsaLevel>,
}

/// How a picture becomes 8 bits a channel.
#[derive(clap::Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Development")]
pub(crate) struct DevelopArgs {
    /// Stops of exposure for .png, .gif and .mp4, or `auto` [default: the scene's, or auto]
    #[arg(long, value_name = "EV|auto", value_parser = values::exposure,
          allow_hyphen_values = true)]
    pub(crate) exposure: Option<Exposure>,
    /// Tone map for .png, .gif and .mp4
    #[arg(long, value_name = "NAME", default_value = ToneMap::default().name(),
          value_parser = values::choice(&ToneMap::ALL))]
    pub(crate) tone_map: ToneMap,
}

/// Render a scene to a picture.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst render                                 the Cornell box, to rayburst.png
  rayburst render sponza.gltf -o sponza.exr --spp 256 --aov albedo,normal
  rayburst render bunny.ply --environment sky --eye 0,0.2,0.4 --target 0,0.1,0
  rayburst render fox.glb --frames 0..47 --fps 24 -o fox.gif
  rayburst render sponza.gltf --integrator hybrid -o frame.exr --aov motion,direct_diffuse
  rayburst render sponza.gltf -o sponza.exr --spp 1024 --resume")]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// File to write: .png, .exr, .hdr, .gif or .mp4; `{frame}` or `####` number a sequence
    #[arg(
        short,
        long,
        value_name = "PATH",
        default_value = "rayburst.png",
        help_heading = "Output"
    )]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) quality: QualityArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) light: LightArgs,
    #[command(flatten)]
    pub(crate) develop: DevelopArgs,
    /// Frames of a sequence, both included
    #[arg(long, value_name = "A..B", value_parser = values::frames, help_heading = "Sequence")]
    pub(crate) frames: Option<RangeInclusive<u32>>,
    /// Frames a second
    #[arg(long, value_name = "N", value_parser = values::positive, help_heading = "Sequence")]
    pub(crate) fps: Option<f32>,
    /// Further signals as layers of the .exr, with commas: albedo, normal, depth, position, instance,
    /// material, variance; of hybrid and realtime-path also motion, geometric_normal, roughness,
    /// metallic, emitted, direct_diffuse, direct_specular, analytic_diffuse, analytic_specular,
    /// shadow, shadow_distance, indirect_diffuse, indirect_specular, diffuse_reflectance,
    /// specular_reflectance, transparency, ambient_occlusion, diffuse_hit_distance,
    /// specular_hit_distance
    #[arg(long, value_name = "LIST", value_parser = aovs, help_heading = "Output")]
    pub(crate) aov: Option<AovList>,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    /// Size that is rendered, as a part of --size along each side, 0.5 to 1; the picture that is
    /// written has that size, or with --antialias the whole one
    #[arg(long, value_name = "S", value_parser = frames::render_scale,
          help_heading = "Frames (hybrid and realtime-path)")]
    pub(crate) render_scale: Option<f32>,
    /// Stop after so many seconds (the first sample is always finished)
    #[arg(long, value_name = "SECONDS", value_parser = values::positive, help_heading = "Stop")]
    pub(crate) budget: Option<f32>,
    /// Stop when the estimated relative error is this small, such as 0.02
    #[arg(long, value_name = "THRESHOLD", value_parser = values::positive, help_heading = "Stop")]
    pub(crate) noise: Option<f32>,
    /// Go on with the samples that the .exr holds; sequences skip finished frames
    #[arg(long, help_heading = "Output")]
    pub(crate) resume: bool,
    /// Print one JSON object as the last line of stdout
    #[arg(long, help_heading = "Output")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) machine: MachineArgs,
}

/// Names of signals, of whatever integrator.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AovList(Vec<&'static str>);

impl AovList {
    /// The signals of an integrator that has those of a table.
    pub(crate) fn of<T: Copy>(&self, all: &[(&'static str, T)], method: Method) -> Result<Vec<T>> {
        let find = |name: &&str| {
            let found = all.iter().find(|(known, _)| known == name);
            found.map(|(_, signal)| *signal).ok_or_else(|| {
                let known: Vec<&str> = all.iter().map(|(known, _)| *known).collect();
                CliError::usage(format!(
                    "--integrator {} has no AOV '{name}'; it has {}",
                    method.name(),
                    known.join(", ")
                ))
            })
        };
        self.0.iter().map(find).collect()
    }
}

fn aovs(given: &str) -> Result<AovList, String> {
    let progressive = Aov::ALL.iter().map(|(name, _)| *name);
    let mut all: Vec<(&str, &str)> = progressive.map(|name| (name, name)).collect();
    for (name, _) in FrameLayer::ALL {
        if !all.contains(&(name, name)) {
            all.push((name, name));
        }
    }
    values::choices("AOV", &all, given).map(AovList)
}

fn isa(given: &str) -> Result<IsaLevel, String> {
    IsaLevel::from_name(given).map_err(|e| e.to_string())
}
