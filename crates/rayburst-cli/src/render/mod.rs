//! `rayburst render`: from a scene to a file, or to a sequence of them.

mod fingerprint;
mod plan;
mod report;
mod saved;
mod writer;

use std::{ops::ControlFlow, path::Path, sync::Arc, time::Instant};

use rayburst::{
    accel::BuildOptions,
    render::{IntegratorKind, Limits, Outcome, RenderSettings, Renderer, StopReason},
    scene::{Camera, FlatScene, Flattener},
};

use crate::{
    args::render::RenderArgs,
    camera,
    develop::Developer,
    error::{CliError, Result},
    interrupt, light,
    load::{self, Loaded},
    machine,
    progress::{self, Bar},
    terminal,
};
use plan::{Frame, Plan};
use report::Report;
use writer::Writer;

/// The size of pictures of scenes that do not suggest one.
const DEFAULT_SIZE: (u32, u32) = (960, 540);

/// Samples a pixel unless told otherwise.
const DEFAULT_SPP: u32 = 256;

/// Samples a pixel of the inspection views, which have no noise but at edges.
const INSPECTION_SPP: u32 = 16;

/// Samples a pixel where only a limit ends the render.
const UNLIMITED_SPP: u32 = 1 << 20;

/// Renders as the options say.
pub(crate) fn run(args: &RenderArgs) -> Result<()> {
    let plan = Plan::new(args)?;
    plan.check_writable()?;
    machine::start(args.machine.threads)?;
    interrupt::watch(&args.output)?;

    let mut loaded = load::load(&args.scene.scene, &args.scene.instant)?;
    light::apply(&mut loaded.scene, &args.light)?;
    let size = args.quality.size.or(loaded.size).unwrap_or(DEFAULT_SIZE);
    let settings = settings(args, size);
    let developer = Developer::new(settings.integrator, &args.develop, loaded.scene.exposure);
    let mut writer = Writer::new(&plan, developer, size)?;

    let mut report = Report::new(args, &loaded, &settings);
    let mut job = Job { args, plan: &plan, loaded: &loaded, settings, report: &mut report };
    job.frames(&mut writer)?;
    report.seconds.write += writer.finish()?;
    report.print(args.json)
}

fn settings(args: &RenderArgs, size: (u32, u32)) -> RenderSettings {
    let quality = &args.quality;
    let usual = if args.budget.is_some() || args.noise.is_some() {
        UNLIMITED_SPP
    } else if matches!(quality.integrator, IntegratorKind::Inspect(_)) {
        INSPECTION_SPP
    } else {
        DEFAULT_SPP
    };
    RenderSettings {
        size,
        spp: quality.spp.unwrap_or(usual),
        integrator: quality.integrator,
        max_depth: quality.max_depth,
        seed: quality.seed,
        sampler: quality.sampler,
        filter: quality.filter,
        texture_lod: quality.texture_lod,
        aovs: args.aov.clone().unwrap_or_default().0,
        ..RenderSettings::default()
    }
}

/// One command's work.
struct Job<'a> {
    args: &'a RenderArgs,
    plan: &'a Plan,
    loaded: &'a Loaded,
    settings: RenderSettings,
    report: &'a mut Report,
}

impl Job<'_> {
    fn frames(&mut self, writer: &mut Writer) -> Result<()> {
        let scene = &self.loaded.scene;
        let options = BuildOptions { isa: self.args.machine.isa, ..BuildOptions::default() };
        let animations = load::animations(scene, &self.args.scene.instant)?;
        if self.args.frames.is_some() && animations.is_empty() {
            terminal::warn("the scene has no animation: all frames are alike");
        }
        let mut flattener = Flattener::new(scene, options);
        for frame in &self.plan.frames {
            let start = Instant::now();
            let pose = load::pose(scene, &animations, frame.time);
            let flat = Arc::new(flattener.at(&pose)?);
            self.report.seconds.build += start.elapsed().as_secs_f64();
            let camera =
                camera::choose(scene, &pose, &flat.bounds, self.settings.size, &self.args.camera)?;
            if !self.frame(frame, flat, camera, writer)? {
                break;
            }
        }
        Ok(())
    }

    /// Renders and writes one frame; says whether to go on.
    fn frame(
        &mut self,
        frame: &Frame,
        flat: Arc<FlatScene>,
        camera: Camera,
        writer: &mut Writer,
    ) -> Result<bool> {
        self.report.scene_numbers(&self.loaded.scene, &flat);
        let identity = fingerprint::Identity::new(self.loaded, &flat);
        let mut renderer = Renderer::new(flat, camera, self.settings.clone())?;
        let resumed = match saved::state(self.args.resume, &frame.path)? {
            saved::State::None => 0,
            saved::State::Finished => {
                terminal::note(format!("{} is finished", frame.path.display()));
                return Ok(true);
            }
            saved::State::Samples(image) => {
                identity.check(&image)?;
                let samples = renderer.resume(&image)?;
                terminal::note(format!("{} holds {samples} samples a pixel", frame.path.display()));
                samples
            }
        };
        let outcome = self.trace(&mut renderer, frame, resumed);
        self.report.add(&renderer, &outcome);
        let stopped = outcome.reason == StopReason::Interrupted;
        if stopped && outcome.samples == 0 {
            return Err(CliError::failed("stopped before the first sample of the picture"));
        }
        if stopped && self.plan.is_sequence() && !frame.keeps_state() {
            terminal::note(format!(
                "frame {} is not finished, nothing of it is kept",
                frame.number
            ));
            return Ok(false);
        }
        let start = Instant::now();
        writer.write(frame, &renderer, &identity)?;
        self.report.seconds.write += start.elapsed().as_secs_f64();
        self.tell(frame, &outcome);
        Ok(!stopped)
    }

    fn trace(&mut self, renderer: &mut Renderer, frame: &Frame, resumed: u32) -> Outcome {
        let budget = self.args.budget.map(std::time::Duration::from_secs_f32);
        let noise = self.args.noise;
        let prefix = self.plan.frame_label(frame);
        let bar = Bar::new(self.settings.pixels(), progress::Limits { budget, noise }, prefix);
        let outcome = renderer.render_until(&Limits { budget, noise }, &|progress| {
            bar.show(progress, resumed);
            if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        bar.clear();
        outcome
    }

    fn tell(&self, frame: &Frame, outcome: &Outcome) {
        let (width, height) = self.settings.size;
        let why = match outcome.reason {
            StopReason::Complete => "",
            StopReason::Interrupted => ", stopped by you",
            StopReason::Budget => ", the time is up",
            StopReason::Noise => ", the noise is low enough",
        };
        let seconds = outcome.elapsed.as_secs_f64();
        let rate = outcome.rays.total() as f64 / seconds.max(1e-9) / 1e6;
        terminal::say(format!(
            "{}: {width}x{height}, {} samples a pixel{why}; {} ({rate:.1} Mrays/s)",
            crate::error::shown(&frame.path).display(),
            outcome.samples,
            progress::shown(seconds),
        ));
    }
}

/// Paths for messages and JSON.
fn path_text(path: &Path) -> String {
    path.display().to_string()
}
