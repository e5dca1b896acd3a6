//! `rayburst render`: from a scene to a file, or to a sequence of them.

mod fingerprint;
mod frames;
mod mean;
mod plan;
mod progressive;
mod report;
mod saved;
mod writer;

use std::{path::Path, sync::Arc, time::Instant};

use rayburst::{
    accel::BuildOptions,
    render::{Outcome, RenderSettings, StopReason, realtime::FrameSettings},
    scene::{Camera, FlatScene, Flattener, Pose},
};

use crate::{
    args::render::RenderArgs,
    camera,
    develop::Developer,
    error::Result,
    interrupt, light,
    load::{self, Loaded},
    machine,
    method::Method,
    progress, terminal,
};
use plan::{Frame, Plan};
use report::Report;
use writer::Writer;

/// The size of pictures of scenes that do not suggest one.
const DEFAULT_SIZE: (u32, u32) = (960, 540);

/// What is rendered with.
enum Wanted {
    Progressive(RenderSettings),
    Frames(frames::Wanted),
}

/// Renders as the options say.
pub(crate) fn run(args: &RenderArgs) -> Result<()> {
    let method = args.quality.integrator;
    let wanted = match method {
        Method::Progressive(kind) => Wanted::Progressive(progressive::settings(args, kind)?),
        Method::Frames(mode) => Wanted::Frames(frames::Wanted::new(args, mode)?),
    };
    let plan = Plan::new(args)?;
    plan.check_writable()?;
    machine::start(args.machine.threads)?;
    interrupt::watch(&args.output)?;

    let mut loaded = load::load(&args.scene.scene, &args.scene.instant)?;
    light::apply(&mut loaded.scene, &args.light)?;
    let size = args.quality.size.or(loaded.size).unwrap_or(DEFAULT_SIZE);
    let written = match &wanted {
        Wanted::Progressive(_) => size,
        Wanted::Frames(wanted) => FrameSettings { size, ..wanted.settings }.picture_size(),
    };
    let developer = Developer::new(method.display(), &args.develop, loaded.scene.exposure);
    let mut writer = Writer::new(&plan, developer, written)?;
    let mut report = Report::new(args, &loaded, written);
    let command = Command { args, plan: &plan, loaded: &loaded, size };
    match wanted {
        Wanted::Progressive(settings) => {
            let settings = RenderSettings { size, ..settings };
            let job = progressive::Job { args, plan: &plan, loaded: &loaded, settings };
            command.each_frame(&mut report, |frame, flat, camera, report| {
                job.frame(frame, flat.clone(), *camera, &mut writer, report)
            })?;
        }
        Wanted::Frames(mut wanted) => {
            wanted.settings.size = size;
            let mut job = frames::Job::new(&plan, &loaded, wanted)?;
            command.each_frame(&mut report, |frame, flat, camera, report| {
                job.frame(frame, flat, camera, &mut writer, report)
            })?;
        }
    }
    report.seconds.write += writer.finish()?;
    report.print(args.json)
}

/// One command's work.
struct Command<'a> {
    args: &'a RenderArgs,
    plan: &'a Plan,
    loaded: &'a Loaded,
    /// The size that cameras are chosen for.
    size: (u32, u32),
}

impl Command<'_> {
    /// Poses the scene for each frame and hands it on, until `render` says that it is enough. A scene that
    /// does not change stays the same one.
    fn each_frame(
        &self,
        report: &mut Report,
        mut render: impl FnMut(&Frame, &Arc<FlatScene>, &Camera, &mut Report) -> Result<bool>,
    ) -> Result<()> {
        let scene = &self.loaded.scene;
        let options = BuildOptions { isa: self.args.machine.isa, ..BuildOptions::default() };
        let animations = load::animations(scene, &self.args.scene.instant)?;
        if self.args.frames.is_some() && animations.is_empty() {
            terminal::warn("the scene has no animation: all frames are alike");
        }
        let mut flattener = Flattener::new(scene, options);
        let mut last: Option<(Pose, Arc<FlatScene>)> = None;
        for frame in &self.plan.frames {
            let start = Instant::now();
            let pose = load::pose(scene, &animations, frame.time);
            let flat = match last.take().filter(|(before, _)| is_same(before, &pose)) {
                Some((_, flat)) => flat,
                None => Arc::new(flattener.at(&pose)?),
            };
            report.seconds.build += start.elapsed().as_secs_f64();
            let camera = camera::choose(scene, &pose, &flat.bounds, self.size, &self.args.camera)?;
            report.scene_numbers(scene, &flat);
            if !render(frame, &flat, &camera, report)? {
                break;
            }
            last = Some((pose, flat));
        }
        Ok(())
    }
}

fn is_same(a: &Pose, b: &Pose) -> bool {
    a.world == b.world && a.weights == b.weights
}

/// Says what a frame took.
fn tell(frame: &Frame, (width, height): (u32, u32), outcome: &Outcome) {
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

/// Paths for messages and JSON.
fn path_text(path: &Path) -> String {
    path.display().to_string()
}
