//! Options of the smaller verbs.

use std::path::PathBuf;

use rayburst::{image::metrics::Metric, math::SamplerKind};

use super::{
    scene::{CameraArgs, InstantArgs, LightArgs, SceneArgs},
    values,
};

/// Tell what is in a scene.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst info sponza.gltf
  rayburst info cornell --json")]
pub(crate) struct InfoArgs {
    /// A .gltf, .glb, .obj or .ply file, or a built-in scene's name
    #[arg(value_name = "SCENE")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) instant: InstantArgs,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// List the built-in scenes, each with the figure of the chapter that it follows.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst scenes
  rayburst render veach-mis -o veach.png")]
pub(crate) struct ScenesArgs {
    /// Print one JSON array
    #[arg(long)]
    pub(crate) json: bool,
}

/// Draw what a figure of the chapter shows, and print its property as a number.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = crate::figure::help())]
pub(crate) struct FigureArgs {
    /// Number of the figure
    #[arg(value_name = "26.N", value_parser = values::choice(crate::figure::FIGURES))]
    pub(crate) figure: crate::figure::Figure,
    /// Picture to write [default: figure-26.N.png]
    #[arg(short, long, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
    /// Threads [default: one a core]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub(crate) threads: Option<usize>,
}

/// Print a completion script for a shell.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Example:
  rayburst completions bash > ~/.local/share/bash-completion/completions/rayburst")]
pub(crate) struct CompletionsArgs {
    /// Which shell
    pub(crate) shell: clap_complete::Shell,
}

/// Measure how far picture B is from the reference A.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst compare reference.exr noisy.exr
  rayburst compare a.png b.png --metric flip,ssim --json --heatmap flip.png")]
pub(crate) struct CompareArgs {
    /// The reference: .exr, .hdr, .pfm, .png or .jpg
    pub(crate) a: PathBuf,
    /// The picture to judge
    pub(crate) b: PathBuf,
    /// Measures, with commas: flip, hdr-flip, rmse, relmse, psnr, ssim
    #[arg(long, value_name = "LIST", value_parser = metrics)]
    pub(crate) metric: Option<MetricList>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// Picture of where the first measure sees differences
    #[arg(long, value_name = "FILE")]
    pub(crate) heatmap: Option<PathBuf>,
}

/// A list of measures.
#[derive(Clone, Debug)]
pub(crate) struct MetricList(pub(crate) Vec<Metric>);

fn metrics(given: &str) -> Result<MetricList, String> {
    values::choices("metric", &Metric::ALL, given).map(MetricList)
}

/// Tell the paths of one pixel, vertex by vertex: rays, hits, materials, lights, densities.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst inspect cornell --pixel 200,320
  rayburst inspect sponza.gltf --pixel 480,270 --samples 4")]
pub(crate) struct InspectArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Column and row of the pixel, from the top left
    #[arg(long, value_name = "X,Y", value_parser = values::pixel)]
    pub(crate) pixel: (u32, u32),
    /// Width and height of the picture [default: the built-in scene's own, or 960x540]
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    pub(crate) size: Option<(u32, u32)>,
    /// Number of the first sample
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) sample: u32,
    /// How many samples
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) samples: u32,
    /// Longest path in rays; the eye ray is the first
    #[arg(long, value_name = "N", default_value_t = 16,
          value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub(crate) max_depth: u32,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u32,
    /// Where random numbers come from
    #[arg(long, value_name = "NAME", default_value = "sobol",
          value_parser = values::choice(&SamplerKind::ALL))]
    pub(crate) sampler: SamplerKind,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) light: LightArgs,
}
