//! Pictures by frames in real time: one renderer and one history for all of a sequence.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use rayburst::{
    image::LayeredImage,
    render::{
        Outcome, Progress, RayCounts, StopReason,
        realtime::{Denoiser, FrameLayer, FrameMode, FrameRenderer, FrameSettings, History},
    },
    scene::{Camera, FlatScene},
};

use super::{
    fingerprint::Identity,
    mean::Mean,
    plan::{Frame, Plan},
    report::Report,
    tell,
    writer::Writer,
};
use crate::{
    args::render::RenderArgs,
    error::{CliError, Result},
    interrupt,
    load::Loaded,
    output::Format,
    progress::{self, Bar},
    terminal,
};

/// What the options ask for.
#[derive(Clone, Debug)]
pub(super) struct Wanted {
    /// At a size that is filled in later.
    pub(super) settings: FrameSettings,
    layers: Vec<FrameLayer>,
    /// Frames of each instant, whose mean is the picture.
    spp: u32,
}

impl Wanted {
    /// Checks that the options fit frames.
    pub(super) fn new(args: &RenderArgs, mode: FrameMode) -> Result<Self> {
        let quality = &args.quality;
        let why_not = [
            (
                "--resume",
                args.resume,
                "a frame goes on with the frames before it, which no file holds",
            ),
            ("--budget", args.budget.is_some(), "a frame is done when its passes are; use --spp"),
            ("--noise", args.noise.is_some(), "frames do not estimate their error; use --spp"),
            (
                "--filter",
                quality.filter.is_some(),
                "its rays go through a point of each pixel, without a filter",
            ),
            (
                "--aperture",
                args.camera.aperture.is_some_and(|diameter| diameter > 0.0),
                "frames see through a pinhole",
            ),
            ("--focus", args.camera.focus.is_some(), "frames see through a pinhole"),
        ];
        if let Some((option, _, why)) = why_not.iter().find(|(_, given, _)| *given) {
            let name = mode.name();
            return Err(CliError::usage(format!(
                "{option} does not fit --integrator {name}: {why}"
            )));
        }
        let layers = args.aov.as_ref().map(|list| list.of(&FrameLayer::ALL, quality.integrator));
        let default = FrameSettings::default();
        let mut settings = FrameSettings {
            render_scale: args.render_scale.unwrap_or(default.render_scale),
            mode,
            max_depth: quality.max_depth.unwrap_or(default.max_depth),
            seed: quality.seed,
            sampler: quality.sampler.unwrap_or(default.sampler),
            texture_lod: quality.texture_lod,
            ..default
        };
        args.frame.apply(&mut settings);
        Ok(Self {
            settings,
            layers: layers.transpose()?.unwrap_or_default(),
            spp: quality.spp.unwrap_or(1),
        })
    }
}

/// Renders frames one after the other.
pub(super) struct Job<'a> {
    plan: &'a Plan,
    loaded: &'a Loaded,
    wanted: Wanted,
    renderer: FrameRenderer,
    history: History,
    /// Whether the user knows that there is no lens.
    told: bool,
}

impl<'a> Job<'a> {
    /// Prepares the buffers.
    pub(super) fn new(plan: &'a Plan, loaded: &'a Loaded, wanted: Wanted) -> Result<Self> {
        let renderer = FrameRenderer::new(wanted.settings)?;
        Ok(Self { plan, loaded, wanted, renderer, history: History::new(), told: false })
    }

    /// Renders and writes one frame; says whether to go on.
    pub(super) fn frame(
        &mut self,
        frame: &Frame,
        flat: &Arc<FlatScene>,
        camera: &Camera,
        writer: &mut Writer,
        report: &mut Report,
    ) -> Result<bool> {
        if camera.aperture > 0.0 && !self.told {
            terminal::note("the camera has a lens; frames see through a pinhole");
            self.told = true;
        }
        let (mean, outcome) = self.trace(frame, flat, camera)?;
        report.add(outcome.samples, outcome.rays, outcome.elapsed.as_secs_f64());
        if outcome.reason == StopReason::Interrupted && self.plan.is_sequence() {
            frame.tell_unfinished();
            return Ok(false);
        }
        let start = Instant::now();
        let layers = || {
            let mut image = LayeredImage::from_rgb(&mean.picture());
            image.layers.extend(mean.layers());
            Identity::new(self.loaded, flat).store(&mut image);
            self.note_settings(&mut image, outcome.samples);
            image
        };
        writer.write(frame, || mean.picture(), layers)?;
        report.seconds.write += start.elapsed().as_secs_f64();
        tell(frame, self.wanted.settings.picture_size(), &outcome);
        Ok(outcome.reason == StopReason::Complete && !interrupt::requested())
    }

    /// The frames of one instant. The first is always finished.
    fn trace(
        &mut self,
        frame: &Frame,
        flat: &Arc<FlatScene>,
        camera: &Camera,
    ) -> Result<(Mean, Outcome)> {
        let settings = &self.wanted.settings;
        let (width, height) = settings.picture_size();
        let layers = if self.plan.format == Format::Exr { &self.wanted.layers[..] } else { &[] };
        let last = settings.denoiser != Denoiser::None || settings.antialias;
        let mut mean = Mean::new((width, height), last, layers);
        let pixels = width as usize * height as usize;
        let prefix = self.plan.frame_label(frame);
        let bar = Bar::new(pixels, progress::Limits::default(), prefix);
        let start = Instant::now();
        // Only what the passes take counts as rendering.
        let mut elapsed = Duration::ZERO;
        let mut rays = RayCounts::default();
        let spp = self.wanted.spp;
        let reason = loop {
            let samples = mean.frames();
            bar.show(
                &Progress {
                    samples,
                    target: spp,
                    pass: samples..samples,
                    tiles_done: 0,
                    tiles: 1,
                    rays,
                    elapsed: start.elapsed(),
                    noise: None,
                },
                0,
            );
            if samples == spp {
                break StopReason::Complete;
            }
            if samples > 0 && interrupt::requested() {
                break StopReason::Interrupted;
            }
            let begin = Instant::now();
            let rendered = self.renderer.frame(flat, camera, &mut self.history)?;
            elapsed += begin.elapsed();
            rays += rendered.rays();
            mean.add(&rendered);
        };
        bar.clear();
        let samples = mean.frames();
        Ok((mean, Outcome { reason, samples, rays, elapsed }))
    }

    /// What the picture was made with, as attributes.
    fn note_settings(&self, image: &mut LayeredImage, samples: u32) {
        let settings = &self.wanted.settings;
        let (width, height) = settings.picture_size();
        let values = [
            ("size", format!("{width}x{height}")),
            ("integrator", settings.mode.name().to_owned()),
            ("max_depth", settings.max_depth.to_string()),
            ("seed", settings.seed.to_string()),
            ("sampler", format!("{:?}", settings.sampler)),
            ("texture_lod", format!("{:?}", settings.texture_lod)),
            ("render_scale", settings.render_scale.to_string()),
            ("denoiser", settings.denoiser.name().to_owned()),
            ("antialias", settings.antialias.to_string()),
            ("samples", samples.to_string()),
        ];
        let named = values.map(|(name, value)| (format!("rayburst.{name}"), value));
        image.attributes.extend(named);
    }
}
