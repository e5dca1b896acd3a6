//! What a render says of itself: the JSON object of the contract.

use rayburst::{
    render::RayCounts,
    scene::{FlatScene, Scene},
};
use serde::Serialize;

use super::path_text;
use crate::{
    args::render::RenderArgs,
    error::{CliError, Result},
    load::Loaded,
    memory, terminal,
};

/// Times by what they were for.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Seconds {
    pub(super) load: f64,
    pub(super) build: f64,
    pub(super) render: f64,
    pub(super) denoise: f64,
    pub(super) write: f64,
}

/// Rays by what they were for.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Rays {
    camera: u64,
    shadow: u64,
    indirect: u64,
    total: u64,
}

/// The object that `--json` prints.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    scene: String,
    size: [u32; 2],
    spp: u32,
    integrator: &'static str,
    frames: u32,
    pub(super) seconds: Seconds,
    rays: Rays,
    mrays_per_second: f64,
    triangles: u64,
    instances: usize,
    peak_memory_bytes: Option<u64>,
    output: String,
}

impl Report {
    /// Before anything is rendered of pictures of a size.
    pub(super) fn new(args: &RenderArgs, loaded: &Loaded, size: (u32, u32)) -> Self {
        Self {
            scene: loaded.name.clone(),
            size: [size.0, size.1],
            spp: 0,
            integrator: args.quality.integrator.name(),
            frames: 0,
            seconds: Seconds { load: loaded.seconds, ..Seconds::default() },
            rays: Rays::default(),
            mrays_per_second: 0.0,
            triangles: 0,
            instances: 0,
            peak_memory_bytes: None,
            output: path_text(&args.output),
        }
    }

    /// What the scene holds at this frame.
    pub(super) fn scene_numbers(&mut self, scene: &Scene, flat: &FlatScene) {
        self.triangles = scene.placed_triangles();
        self.instances = flat.instances.len();
    }

    /// Adds a frame.
    pub(super) fn add(&mut self, samples: u32, rays: RayCounts, seconds: f64) {
        self.frames += 1;
        self.spp = samples;
        self.rays.camera += rays.camera;
        self.rays.shadow += rays.shadow;
        self.rays.indirect += rays.indirect;
        self.rays.total += rays.total();
        self.seconds.render += seconds;
        self.mrays_per_second = self.rays.total as f64 / self.seconds.render.max(1e-9) / 1e6;
    }

    /// The last line of stdout.
    pub(super) fn print(mut self, json: bool) -> Result<()> {
        if !json {
            return Ok(());
        }
        self.peak_memory_bytes = memory::peak_bytes();
        let text = serde_json::to_string(&self)
            .map_err(|e| CliError::failed(format!("cannot write JSON: {e}")))?;
        terminal::result(text)
    }
}
