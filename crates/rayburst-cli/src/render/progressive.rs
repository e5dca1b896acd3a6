//! Pictures by the progressive renderer: samples that add up, and can be continued.

use std::{ops::ControlFlow, sync::Arc, time::Instant};

use rayburst::{
    render::{
        Aov, IntegratorKind, Limits, Outcome, RenderSettings, Renderer, StopReason,
        realtime::Denoiser,
    },
    scene::{Camera, FlatScene},
};

use super::{
    fingerprint::Identity,
    plan::{Frame, Plan},
    report::Report,
    saved, tell,
    writer::Writer,
};
use crate::{
    args::render::RenderArgs,
    error::{CliError, Result},
    interrupt,
    load::Loaded,
    progress::{self, Bar},
    terminal,
};

/// Samples a pixel unless told otherwise.
const DEFAULT_SPP: u32 = 256;

/// Samples a pixel of the inspection views, which have no noise but at edges.
const INSPECTION_SPP: u32 = 16;

/// Samples a pixel where only a limit ends the render.
const UNLIMITED_SPP: u32 = 1 << 20;

/// What the options ask for, at a size that is filled in later.
pub(super) fn settings(args: &RenderArgs, integrator: IntegratorKind) -> Result<RenderSettings> {
    let quality = &args.quality;
    let not_for = [
        ("--render-scale", args.render_scale.is_some()),
        ("--techniques", args.frame.techniques.is_some()),
        ("--passes", args.frame.passes.is_some()),
        ("--denoise", args.frame.denoise.is_some_and(|denoiser| denoiser != Denoiser::None)),
        ("--antialias", args.frame.antialias),
    ];
    if let Some((option, _)) = not_for.iter().find(|(_, given)| *given) {
        return Err(CliError::usage(format!(
            "{option} is about frames in real time: it needs --integrator hybrid or realtime-path"
        )));
    }
    let usual = if args.budget.is_some() || args.noise.is_some() {
        UNLIMITED_SPP
    } else if matches!(integrator, IntegratorKind::Inspect(_)) {
        INSPECTION_SPP
    } else {
        DEFAULT_SPP
    };
    let aovs = args.aov.as_ref().map(|list| list.of(&Aov::ALL, quality.integrator));
    let default = RenderSettings::default();
    Ok(RenderSettings {
        spp: quality.spp.unwrap_or(usual),
        integrator,
        max_depth: quality.max_depth.unwrap_or(default.max_depth),
        seed: quality.seed,
        sampler: quality.sampler.unwrap_or(default.sampler),
        filter: quality.filter.unwrap_or(default.filter),
        texture_lod: quality.texture_lod,
        aovs: aovs.transpose()?.unwrap_or_default(),
        ..default
    })
}

/// Renders pictures one by one.
pub(super) struct Job<'a> {
    pub(super) args: &'a RenderArgs,
    pub(super) plan: &'a Plan,
    pub(super) loaded: &'a Loaded,
    pub(super) settings: RenderSettings,
}

impl Job<'_> {
    /// Renders and writes one picture; says whether to go on.
    pub(super) fn frame(
        &self,
        frame: &Frame,
        flat: Arc<FlatScene>,
        camera: Camera,
        writer: &mut Writer,
        report: &mut Report,
    ) -> Result<bool> {
        let identity = Identity::new(self.loaded, &flat);
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
        report.add(renderer.samples(), outcome.rays, outcome.elapsed.as_secs_f64());
        let stopped = outcome.reason == StopReason::Interrupted;
        if stopped && outcome.samples == 0 {
            return Err(CliError::failed("stopped before the first sample of the picture"));
        }
        if stopped && self.plan.is_sequence() && !frame.keeps_state() {
            frame.tell_unfinished();
            return Ok(false);
        }
        let start = Instant::now();
        let layers = || {
            let mut image = renderer.layers(true);
            identity.store(&mut image);
            image
        };
        writer.write(frame, || renderer.picture(), layers)?;
        report.seconds.write += start.elapsed().as_secs_f64();
        tell(frame, self.settings.size, &outcome);
        Ok(!stopped)
    }

    fn trace(&self, renderer: &mut Renderer, frame: &Frame, resumed: u32) -> Outcome {
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
}
