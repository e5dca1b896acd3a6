//! Options of the benchmarks.

use std::path::PathBuf;

use rayburst::render::realtime::FrameMode;
use rayburst_bench::{
    EngineSpec, Mode, Preset, RaySetKind, UpdateCase,
    spec::{BUILDER_NAMES, EMBREE_NAMES},
};

use super::{
    frames::{self, FrameArgs},
    scene::{CameraArgs, InstantArgs, LightArgs},
    values,
};

/// Measure speed.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst bench rays sponza.gltf --peer embree=libembree4.so.4 --json rays.json
  rayburst bench build sponza.gltf --peer embree=libembree4.so.4
  rayburst bench update --threads 2
  rayburst bench frame sponza.gltf --json frame.json")]
pub(crate) struct BenchArgs {
    #[command(subcommand)]
    pub(crate) kind: BenchKind,
}

/// What to measure.
#[derive(clap::Subcommand, Clone, Debug)]
pub(crate) enum BenchKind {
    Rays(Box<BenchRaysArgs>),
    Build(Box<BenchBuildArgs>),
    Update(Box<BenchUpdateArgs>),
    Pipeline(Box<BenchPipelineArgs>),
    Frame(Box<BenchFrameArgs>),
}

/// Rays a second, by ray set, of this engine and of peers on the same geometry.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst bench rays cornell city
  rayburst bench rays sponza.gltf --peer embree=libembree4.so.4 --threads 2 --json rays.json
  rayburst bench rays city --peer embree=libembree4.so.4 --engines rayburst,embree:high --plot a.png")]
pub(crate) struct BenchRaysArgs {
    #[command(flatten)]
    pub(crate) common: BenchCommonArgs,
    /// Least length of a timed run
    #[arg(long, value_name = "S", default_value = "0.5", value_parser = values::positive)]
    pub(crate) seconds: f32,
    /// Side of the square picture whose eye rays are traced
    #[arg(long, value_name = "N", default_value_t = 1024,
          value_parser = clap::value_parser!(u32).range(8..=8192))]
    pub(crate) resolution: u32,
    /// Ray sets, with commas [default: all]
    #[arg(long, value_name = "LIST", value_parser = ray_sets)]
    pub(crate) sets: Option<RaySetList>,
    /// Engines by name or beginning of a name, with commas: rayburst:PRESET:MODE (presets as for
    /// --preset, modes as for --mode),
    /// embree:QUALITY:WIDTH[:coherent][:robust][:compact] [default: the usual ones]
    #[arg(long, value_name = "LIST", value_parser = engines)]
    pub(crate) engines: Option<EngineNames>,
    /// How this engine is asked, with commas: auto, single, interleaved, packet, stream (sorted
    /// first), call (one call a ray) [default: auto,call]
    #[arg(long, value_name = "LIST", value_parser = modes)]
    pub(crate) mode: Option<ModeList>,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
}

/// Triangles a second, bytes a triangle and quality of builds, by preset.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst bench build city
  rayburst bench build sponza.gltf terrain --peer embree=libembree4.so.4 --json build.json")]
pub(crate) struct BenchBuildArgs {
    #[command(flatten)]
    pub(crate) common: BenchCommonArgs,
    /// Least length of a timed run; short builds are repeated
    #[arg(long, value_name = "S", default_value = "0.2", value_parser = values::positive)]
    pub(crate) seconds: f32,
}

/// What it takes to keep structures up to date with what moves: refits beside builds, instances,
/// policies, particles.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst bench update --threads 2 --json update.json
  rayburst bench update --cases deform,twist dragon.ply")]
pub(crate) struct BenchUpdateArgs {
    /// Files or built-in scenes to deform and to twist [default: meshes made for it]
    #[arg(value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    /// What moves, with commas: deform (a mesh in waves), instances, twist (a mesh that twists
    /// further every frame, by policy), particles [default: all]
    #[arg(long, value_name = "LIST", value_parser = cases)]
    pub(crate) cases: Option<CaseList>,
    /// Triangles, instances and particles as a part of the usual 1,000,000 (200,000 that twist),
    /// 100,000, and 100,000 and 1,000,000
    #[arg(long, value_name = "F", default_value = "1", value_parser = scale)]
    pub(crate) scale: f32,
    /// Timed runs of each way; the median counts
    #[arg(long, value_name = "N", default_value_t = 5,
          value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1000))]
    pub(crate) repeat: usize,
    /// Least length of a timed run; short ones are repeated
    #[arg(long, value_name = "S", default_value = "0.2", value_parser = values::positive)]
    pub(crate) seconds: f32,
    /// Threads that work [default: 1]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub(crate) threads: Option<usize>,
    /// File for the rows
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) instant: InstantArgs,
}

/// Rays a second through shaders, beside queries without them: eye rays and shadow rays, the same
/// shading in every form.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Example:
  rayburst bench pipeline sponza.gltf --json pipeline.json")]
pub(crate) struct BenchPipelineArgs {
    /// Files or built-in scenes
    #[arg(value_name = "SCENE", default_value = rayburst::scene::builtin::DEFAULT)]
    pub(crate) scenes: Vec<String>,
    /// Timed runs of each form; the median counts
    #[arg(long, value_name = "N", default_value_t = 5,
          value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1000))]
    pub(crate) repeat: usize,
    /// Least length of a timed run
    #[arg(long, value_name = "S", default_value = "0.5", value_parser = values::positive)]
    pub(crate) seconds: f32,
    /// Side of the square picture
    #[arg(long, value_name = "N", default_value_t = 1024,
          value_parser = clap::value_parser!(u32).range(8..=8192))]
    pub(crate) resolution: u32,
    /// Threads that trace [default: 1]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub(crate) threads: Option<usize>,
    /// File for the rows
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) instant: InstantArgs,
}

/// Frames in real time under a camera that sways, pass by pass.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst bench frame
  rayburst bench frame sponza.gltf --modes hybrid --render-scales 1 --json frame.json
  rayburst bench frame city --techniques gbuffer=rays --passes direct,shadows,emission")]
pub(crate) struct BenchFrameArgs {
    /// Files or built-in scenes
    #[arg(value_name = "SCENE", default_value = rayburst::scene::builtin::DEFAULT)]
    pub(crate) scenes: Vec<String>,
    /// Width and height of the frames in pixels
    #[arg(long, value_name = "WxH", default_value = "640x360", value_parser = values::size)]
    pub(crate) size: (u32, u32),
    /// Modes, with commas: hybrid, realtime-path [default: both]
    #[arg(long, value_name = "LIST", value_parser = frame_modes)]
    pub(crate) modes: Option<FrameModeList>,
    /// Sizes that are rendered, as parts of --size along each side, 0.5 to 1, with commas
    #[arg(long, value_name = "LIST", default_value = "1,0.5", value_parser = render_scales)]
    pub(crate) render_scales: ScaleList,
    /// Frames of a run, after 16 that are not measured
    #[arg(long, value_name = "N", default_value_t = 64,
          value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(64..=100_000))]
    pub(crate) frames: usize,
    /// Runs of each mode and scale, which take turns; figures are over the frames of all
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1000))]
    pub(crate) repeat: usize,
    /// Threads that render [default: one a core]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub(crate) threads: Option<usize>,
    /// File for the rows
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) frame: FrameArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) light: LightArgs,
    #[command(flatten)]
    pub(crate) instant: InstantArgs,
}

/// What all benchmarks of scenes take.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct BenchCommonArgs {
    /// Files or built-in scenes
    #[arg(value_name = "SCENE", default_value = rayburst::scene::builtin::DEFAULT)]
    pub(crate) scenes: Vec<String>,
    /// A peer's shared library to measure beside: embree=PATH
    #[arg(long, value_name = "NAME=PATH", value_parser = peer)]
    pub(crate) peer: Option<Peer>,
    /// Build presets of this engine, with commas: fast, balanced, best, compressed (balanced, in the
    /// compressed layout), or a builder's name: lbvh, hlbvh, ploc, binned-sah, spatial-splits
    /// [default: fast,balanced,best]
    #[arg(long, value_name = "LIST", value_parser = presets)]
    pub(crate) preset: Option<PresetList>,
    /// Timed runs of each engine; the median counts
    #[arg(long, value_name = "N", default_value_t = 5,
          value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1000))]
    pub(crate) repeat: usize,
    /// Threads that work [default: 1]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub(crate) threads: Option<usize>,
    /// File for the rows
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Picture of this engine's and the best peer's figures, a .png
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) instant: InstantArgs,
}

impl BenchCommonArgs {
    /// Presets asked for, or the usual ones.
    pub(crate) fn presets(&self) -> &[Preset] {
        self.preset.as_ref().map_or(&Preset::USUAL, |list| &list.0)
    }
}

/// A list of ray sets.
#[derive(Clone, Debug)]
pub(crate) struct RaySetList(pub(crate) Vec<RaySetKind>);

fn ray_sets(given: &str) -> Result<RaySetList, String> {
    values::choices("ray set", &RaySetKind::ALL, given).map(RaySetList)
}

/// Names of engines as typed; each means at least one.
#[derive(Clone, Debug)]
pub(crate) struct EngineNames(pub(crate) Vec<String>);

fn engines(given: &str) -> Result<EngineNames, String> {
    let names: Vec<&str> = given.split(',').map(str::trim).filter(|n| !n.is_empty()).collect();
    for name in &names {
        if EngineSpec::named(name, &[]).is_empty() {
            let usual = EngineSpec::usual(&Preset::USUAL, &Mode::USUAL);
            let mut known: Vec<String> = usual.iter().map(ToString::to_string).collect();
            known.extend([BUILDER_NAMES, EMBREE_NAMES].map(String::from));
            let known: Vec<&str> = known.iter().map(String::as_str).collect();
            return Err(crate::names::unknown("engine", name, &known));
        }
    }
    if names.is_empty() {
        return Err("no engine is named".into());
    }
    Ok(EngineNames(names.into_iter().map(str::to_owned).collect()))
}

/// A list of build presets.
#[derive(Clone, Debug)]
pub(crate) struct PresetList(pub(crate) Vec<Preset>);

fn presets(given: &str) -> Result<PresetList, String> {
    let all = Preset::ALL.map(|preset| (preset.name, preset));
    values::choices("preset", &all, given).map(PresetList)
}

/// A list of things that move.
#[derive(Clone, Debug)]
pub(crate) struct CaseList(pub(crate) Vec<UpdateCase>);

fn cases(given: &str) -> Result<CaseList, String> {
    values::choices("case", &UpdateCase::ALL, given).map(CaseList)
}

/// A part of usual numbers, small enough for memory.
fn scale(given: &str) -> Result<f32, String> {
    const MOST: f32 = 10.0;
    let scale = values::positive(given)?;
    if scale <= MOST { Ok(scale) } else { Err(format!("must not be above {MOST}")) }
}

/// A list of modes.
#[derive(Clone, Debug)]
pub(crate) struct ModeList(pub(crate) Vec<Mode>);

fn modes(given: &str) -> Result<ModeList, String> {
    values::choices("mode", &Mode::ALL, given).map(ModeList)
}

/// A list of ways to make frames.
#[derive(Clone, Debug)]
pub(crate) struct FrameModeList(pub(crate) Vec<FrameMode>);

fn frame_modes(given: &str) -> Result<FrameModeList, String> {
    values::choices("mode", &FrameMode::ALL, given).map(FrameModeList)
}

/// A list of render scales.
#[derive(Clone, Debug)]
pub(crate) struct ScaleList(pub(crate) Vec<f32>);

fn render_scales(given: &str) -> Result<ScaleList, String> {
    let mut scales = Vec::new();
    for scale in given.split(',').map(|part| frames::render_scale(part.trim())) {
        let scale = scale?;
        if !scales.contains(&scale) {
            scales.push(scale);
        }
    }
    Ok(ScaleList(scales))
}

/// The library of a peer.
#[derive(Clone, Debug)]
pub(crate) struct Peer(pub(crate) PathBuf);

fn peer(given: &str) -> Result<Peer, String> {
    match given.split_once('=') {
        Some(("embree", path)) if !path.is_empty() => Ok(Peer(path.into())),
        Some((name, _)) if name != "embree" => {
            Err(crate::names::unknown("peer", name, &["embree"]))
        }
        _ => Err("a peer is NAME=PATH, such as embree=libembree4.so.4".into()),
    }
}
