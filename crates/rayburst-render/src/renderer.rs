//! The progressive renderer: passes over the whole picture, tile by tile, on all threads.
//!
//! A pixel's samples are numbered, and added to the film in order. So the picture depends neither on
//! how samples are grouped into passes, nor on tiles or threads, and a saved film goes on as if it had
//! never stopped.

use std::{
    ops::{ControlFlow, Range},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use rayburst_image::{Film, LayeredImage, PixelFilter, Precision, RgbImage};
use rayburst_scene::{Camera, FlatScene, LightSampler};
use rayon::prelude::*;

use crate::{
    Aov, Limits, Outcome, Progress, RayCounts, RenderError, RenderSettings, Result, StopReason,
    batch::Context, integrators::PointLights, settings, tile::Worker,
};

/// How long a pass may be expected to take, if it has more than one sample a pixel: what is lost at
/// an interrupt, and how late a limit is noticed.
const PASS_SECONDS: f64 = 0.5;

/// The most samples a pixel in one pass.
const MAX_PASS: u32 = 64;

/// Asked between tiles, from any thread, whether to go on; keep it short.
pub type Control<'a> = dyn Fn(&Progress) -> ControlFlow<()> + Sync + 'a;

/// Renders one picture progressively. Runs on the rayon pool it is called in.
#[derive(Debug)]
pub struct Renderer {
    scene: Arc<FlatScene>,
    opaque: bool,
    camera: Camera,
    settings: RenderSettings,
    lights: LightSampler,
    point_lights: PointLights,
    filter: PixelFilter,
    film: Film,
    samples: u32,
    rays: RayCounts,
    workers: Vec<Mutex<Worker>>,
}

impl Renderer {
    /// Prepares a render. Fails where a setting is out of range or the picture too large.
    pub fn new(
        scene: impl Into<Arc<FlatScene>>,
        camera: Camera,
        mut settings: RenderSettings,
    ) -> Result<Self> {
        settings.check()?;
        let mut seen = Vec::new();
        settings.aovs.retain(|aov| {
            !seen.contains(aov) && {
                seen.push(*aov);
                true
            }
        });
        let scene = scene.into();
        let film = Film::new(settings.size.0, settings.size.1, &settings.film_aovs())?;
        let filter = settings.pixel_filter();
        let lights = LightSampler::new(&scene);
        let point_lights = PointLights::new(&scene);
        Ok(Self {
            opaque: scene.is_opaque(),
            scene,
            camera,
            settings,
            lights,
            point_lights,
            filter,
            film,
            samples: 0,
            rays: RayCounts::default(),
            workers: Vec::new(),
        })
    }

    /// The settings.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The scene.
    pub fn scene(&self) -> &FlatScene {
        &self.scene
    }

    /// Changes how many samples a pixel the render shall have; those that are there stay.
    pub fn set_spp(&mut self, spp: u32) -> Result<()> {
        RenderSettings { spp, ..self.settings.clone() }.check()?;
        self.settings.spp = spp;
        Ok(())
    }

    /// Samples that every pixel has.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Rays traced in complete passes, without those of resumed samples.
    pub fn rays(&self) -> RayCounts {
        self.rays
    }

    /// What was gathered so far.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// Estimated relative error of the picture so far, see [`Film::noise`]; `None` below two samples.
    pub fn noise(&self) -> Option<f32> {
        (self.samples >= 2).then(|| self.film.noise())
    }

    /// The picture so far, in linear radiance.
    pub fn picture(&self) -> RgbImage {
        self.film.mean()
    }

    /// Picture, AOVs and settings as layers and attributes of a file; with `state`, everything that
    /// [`Renderer::resume`] needs.
    pub fn layers(&self, state: bool) -> LayeredImage {
        let mut image = self.film.to_layers(Precision::Float, state);
        if self.settings.aovs.contains(&Aov::Variance) {
            let variance = self.film.variance();
            image.layers.push(rayburst_image::Layer::from_scalar(
                Aov::Variance.name(),
                "Y",
                variance.into_iter().map(|v| if v.is_finite() { v } else { 0.0 }).collect(),
            ));
        }
        let properties = self.settings.properties(&self.camera);
        image
            .attributes
            .extend(properties.into_iter().map(|(name, value)| (settings::attribute(name), value)));
        image.attributes.insert(settings::attribute("samples"), self.samples.to_string());
        image
    }

    /// Goes on from a picture that [`Renderer::layers`] saved with its state; returns the samples a
    /// pixel that are there. Fails where the settings or the camera differ.
    pub fn resume(&mut self, saved: &LayeredImage) -> Result<u32> {
        for (name, now) in self.settings.properties(&self.camera) {
            let value = saved.attributes.get(&settings::attribute(name));
            if value != Some(&now) {
                return Err(RenderError::Resume {
                    name: name.to_owned(),
                    saved: value.cloned().unwrap_or_else(|| "unknown".to_owned()),
                    now,
                });
            }
        }
        let film = Film::from_layers(saved, &self.settings.film_aovs())?;
        let taken = film.samples_taken();
        if taken.0 != taken.1 {
            return Err(RenderError::Resume {
                name: "number of samples".to_owned(),
                saved: format!("{} to {}", taken.0, taken.1),
                now: "the same for all pixels".to_owned(),
            });
        }
        self.film = film;
        self.samples = taken.0;
        Ok(self.samples)
    }

    /// Renders until all samples are there.
    pub fn render(&mut self) -> Outcome {
        self.render_until(&Limits::default(), &|_| ControlFlow::Continue(()))
    }

    /// Renders until all samples are there, a limit is reached, or the control says stop. A pass that
    /// the control stops is dropped, so that all pixels have the same number of samples.
    pub fn render_until(&mut self, limits: &Limits, control: &Control<'_>) -> Outcome {
        let start = Instant::now();
        let rays_before = self.rays;
        let mut pace = Pace::default();
        let reason = loop {
            let elapsed = start.elapsed();
            let noise = self.noise();
            if self.samples >= self.settings.spp {
                break StopReason::Complete;
            }
            if noise.zip(limits.noise).is_some_and(|(now, wanted)| now <= wanted) {
                break StopReason::Noise;
            }
            let left = limits.budget.map(|budget| budget.saturating_sub(elapsed));
            let Some(size) = pace.next_pass(self.samples, left) else { break StopReason::Budget };
            let progress = Progress {
                samples: self.samples,
                target: self.settings.spp,
                pass: self.samples..(self.samples + size).min(self.settings.spp),
                tiles_done: 0,
                tiles: 0,
                rays: self.rays.since(rays_before),
                elapsed,
                noise,
            };
            let pass = progress.pass.clone();
            // The budget may cut a pass short too, but never the first.
            let deadline = limits.budget.filter(|_| self.samples > 0).map(|b| start + b);
            match self.pass(progress, start, deadline, control) {
                None => pace.record(pass, start.elapsed().saturating_sub(elapsed)),
                Some(reason) => break reason,
            }
        };
        Outcome {
            reason,
            samples: self.samples,
            rays: self.rays.since(rays_before),
            elapsed: start.elapsed(),
        }
    }

    /// One pass; says why it was stopped and dropped, if it was.
    fn pass(
        &mut self,
        mut progress: Progress,
        start: Instant,
        deadline: Option<Instant>,
        control: &Control<'_>,
    ) -> Option<StopReason> {
        let kept = self.film.clone();
        let threads = rayon::current_num_threads();
        self.workers.resize_with(threads.max(self.workers.len()), Mutex::default);
        let context = Context {
            scene: &self.scene,
            opaque: self.opaque,
            camera: &self.camera,
            lights: &self.lights,
            point_lights: &self.point_lights,
            settings: &self.settings,
            filter: &self.filter,
        };
        let samples = progress.pass.end - progress.pass.start;
        let tiles = self.film.tiles_mut();
        progress.tiles = tiles.len();
        let (done, interrupted, late) =
            (AtomicUsize::new(0), AtomicBool::new(false), AtomicBool::new(false));
        let workers = &self.workers;
        let counts = tiles
            .into_par_iter()
            .with_max_len(1)
            .map(|mut tile| {
                if interrupted.load(Ordering::Relaxed) || late.load(Ordering::Relaxed) {
                    return RayCounts::default();
                }
                let index = rayon::current_thread_index().unwrap_or(0);
                // Only this thread takes this lock; a panic elsewhere does not matter to scratch.
                let mut worker = workers[index].lock().unwrap_or_else(PoisonError::into_inner);
                let counts = worker.render(&context, &mut tile, samples);
                let now = Progress {
                    tiles_done: done.fetch_add(1, Ordering::Relaxed) + 1,
                    elapsed: start.elapsed(),
                    ..progress.clone()
                };
                if control(&now).is_break() {
                    interrupted.store(true, Ordering::Relaxed);
                }
                if deadline.is_some_and(|deadline| Instant::now() > deadline) {
                    late.store(true, Ordering::Relaxed);
                }
                counts
            })
            .reduce(RayCounts::default, |a, b| a + b);
        let complete = done.into_inner() == progress.tiles;
        if complete {
            self.samples = progress.pass.end;
            self.rays += counts;
        } else {
            self.film = kept;
        }
        match (interrupted.into_inner(), late.into_inner()) {
            (true, _) => Some(StopReason::Interrupted),
            (false, true) => Some(StopReason::Budget),
            (false, false) => None,
        }
    }
}

/// Chooses how many samples a pixel the next pass takes: 1, 1, 2, 4, 8…, as far as time allows.
#[derive(Debug, Default)]
struct Pace {
    last: u32,
    seconds_per_sample: f64,
}

impl Pace {
    /// The size of the next pass; `None` when not even one sample fits into the time left.
    fn next_pass(&self, samples: u32, left: Option<Duration>) -> Option<u32> {
        if self.last == 0 {
            return Some(1).filter(|_| samples == 0 || left != Some(Duration::ZERO));
        }
        let fits = |seconds: f64| (seconds / self.seconds_per_sample.max(1e-9)) as u32;
        let grown = if samples <= 1 { 1 } else { 2 * self.last };
        let size = grown.min(MAX_PASS).min(fits(PASS_SECONDS).max(1));
        match left {
            None => Some(size),
            Some(left) => Some(size.min(fits(left.as_secs_f64()))).filter(|&size| size > 0),
        }
    }

    fn record(&mut self, pass: Range<u32>, took: Duration) {
        self.last = pass.end - pass.start;
        self.seconds_per_sample = took.as_secs_f64() / f64::from(self.last.max(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_grow_as_long_as_there_is_time() {
        let mut pace = Pace::default();
        let mut samples = 0;
        let mut sizes = Vec::new();
        while samples < 200 {
            let size = pace.next_pass(samples, None).unwrap();
            sizes.push(size);
            pace.record(samples..samples + size, Duration::from_millis(u64::from(size)));
            samples += size;
        }
        assert_eq!(sizes, [1, 1, 2, 4, 8, 16, 32, 64, 64, 64]);
        // Half a second a sample: one at a time, and none into the last fifth of a second.
        pace.record(0..1, Duration::from_millis(400));
        assert_eq!(pace.next_pass(10, None), Some(1));
        assert_eq!(pace.next_pass(10, Some(Duration::from_millis(500))), Some(1));
        assert_eq!(pace.next_pass(10, Some(Duration::from_millis(200))), None);
    }
}
