//! The frame loop: passes over planes, in order.

use std::{sync::Arc, time::Instant};

use rayburst_image::Plane3;
use rayburst_math::glam::{Vec2, Vec3};
use rayburst_scene::{Camera, FlatScene};
use rayburst_simd::IsaLevel;

use super::{
    analytic::analytic_light,
    composite::{CompositeParameters, composite, variance},
    direct::direct_light,
    gbuffer::GBuffer,
    history::History,
    indirect::{Gathered, gather_pixels, gather_quads},
    lights::{FrameLights, TileLights},
    motion::Motion,
    occlusion::ambient_occlusion,
    pass::{FrameContext, pixel_key},
    quads::Quads,
    screen_pass::{self, ScreenWork},
    settings::{FrameMode, FrameSettings, Technique},
    shadow_map::ShadowMaps,
    signals::Signals,
    technique::Chooser,
    view::FrameView,
    visibility::{PrimaryRaster, rasterise, trace_primary},
};
use crate::{Result, integrators::ray_key};

/// What a pass took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassReport {
    /// Which pass.
    pub name: &'static str,
    /// How it was made, if there is a choice.
    pub technique: Option<Technique>,
    /// Wall-clock time.
    pub seconds: f64,
    /// Rays that were traced.
    pub rays: u64,
}

/// A finished frame; its buffers are the renderer's until the next one.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Linear radiance at the size that is rendered.
    pub picture: &'a Plane3,
    /// What the eye rays met.
    pub gbuffer: &'a GBuffer,
    /// The light in parts.
    pub signals: &'a Signals,
    /// The view, with the jitter of this frame.
    pub view: FrameView,
    /// Passes in order.
    pub passes: &'a [PassReport],
}

impl Frame<'_> {
    /// Rays of all passes.
    pub fn rays(&self) -> u64 {
        self.passes.iter().map(|pass| pass.rays).sum()
    }

    /// Rays a pixel of the size that is rendered.
    pub fn rays_per_pixel(&self) -> f64 {
        let (width, height) = self.picture.size();
        self.rays() as f64 / (f64::from(width) * f64::from(height))
    }

    /// Time of all passes, seconds.
    pub fn seconds(&self) -> f64 {
        self.passes.iter().map(|pass| pass.seconds).sum()
    }
}

/// Renders frames of moving scenes, one after the other. Runs on the rayon pool it is called in; frames do
/// not depend on its threads.
#[derive(Debug)]
pub struct FrameRenderer {
    settings: FrameSettings,
    gbuffer: GBuffer,
    signals: Signals,
    quads: Quads,
    picture: Plane3,
    lights: Option<FrameLights>,
    tiles: Vec<TileLights>,
    passes: Vec<PassReport>,
    choosers: Choosers,
    screen: ScreenWork,
    raster: Option<PrimaryRaster>,
    maps: Vec<ShadowMaps>,
    keys: Vec<u32>,
}

impl FrameRenderer {
    /// Prepares the buffers. Fails where a setting is out of range or the picture too large.
    pub fn new(settings: FrameSettings) -> Result<Self> {
        settings.check()?;
        let size = settings.render_size();
        rayburst_image::check_size(
            "frame",
            u64::from(settings.size.0),
            u64::from(settings.size.1),
        )?;
        Ok(Self {
            settings,
            gbuffer: GBuffer::new(size)?,
            signals: Signals::new(size)?,
            quads: Quads::new(size)?,
            picture: Plane3::new(size.0, size.1)?,
            lights: None,
            tiles: Vec::new(),
            passes: Vec::new(),
            choosers: Choosers::default(),
            screen: ScreenWork::default(),
            raster: None,
            maps: Vec::new(),
            keys: Vec::new(),
        })
    }

    /// The settings.
    pub fn settings(&self) -> &FrameSettings {
        &self.settings
    }

    /// Changes the settings from the next frame on; a new size begins new buffers.
    pub fn set_settings(&mut self, settings: FrameSettings) -> Result<()> {
        settings.check()?;
        if settings.render_size() != self.settings.render_size() {
            *self = Self::new(settings)?;
        }
        self.settings = settings;
        Ok(())
    }

    /// Renders the next frame of a scene at its instant. Fails where memory for its planes cannot be had.
    pub fn frame(
        &mut self,
        scene: &Arc<FlatScene>,
        camera: &Camera,
        history: &mut History,
    ) -> Result<Frame<'_>> {
        let settings = self.settings;
        let size = settings.render_size();
        history.prepare(size, scene);
        let jitter = if settings.jitter { history.jitter() } else { Vec2::ZERO };
        let view = FrameView::new(*camera, size, jitter);
        self.passes.clear();

        let lights = self.timed("lights", None, |this| {
            let fit = this.lights.take().filter(|lights| lights.fit(scene, &settings));
            (fit.unwrap_or_else(|| FrameLights::new(scene, &settings)), 0)
        });
        self.tiles.clear();
        let mut context = FrameContext {
            tiles: &[],
            scene,
            opaque: scene.is_opaque(),
            view: &view,
            lights: &lights,
            settings: &settings,
            shading: settings.shading(),
            number: history.frames(),
        };
        self.visibility(&context)?;
        let motion = Motion::new(view, scene, history.before());
        self.timed("gbuffer", None, |this| {
            let sky = |direction| lights.sky(scene, direction);
            this.gbuffer.resolve(scene, &view, &motion, &context.shading, sky);
            ((), 0)
        });
        let mut tiles = std::mem::take(&mut self.tiles);
        self.timed("tiles", None, |this| {
            this.signals.clear();
            lights.choose(&this.gbuffer, &settings, &mut tiles);
            ((), 0)
        });
        context.tiles = &tiles;
        self.direct(&context)?;
        self.timed("polygon_lights", None, |this| {
            ((), analytic_light(&context, &this.gbuffer, &mut this.signals))
        });
        let gathered = self.indirect(&context, history)?;
        self.occlusion(&context)?;
        let ambient = match settings.mode {
            FrameMode::Hybrid if settings.passes.ambient => history.learn(&gathered),
            _ => Vec3::ZERO,
        };
        self.timed("composite", None, |this| {
            let mut out = std::mem::take(&mut this.signals.variance);
            variance(&this.signals, &mut out);
            this.signals.variance = out;
            let emission = settings.passes.emission;
            let parameters = CompositeParameters { ambient, emission };
            composite(&this.gbuffer, &this.signals, &parameters, &mut this.picture);
            ((), 0)
        });
        self.lights = Some(lights);
        self.tiles = tiles;
        history.advance(view, scene, &self.picture);
        Ok(Frame {
            picture: &self.picture,
            gbuffer: &self.gbuffer,
            signals: &self.signals,
            view,
            passes: &self.passes,
        })
    }

    /// Runs a pass and notes what it took; the pass gives its result and its rays.
    fn timed<T>(
        &mut self,
        name: &'static str,
        technique: Option<Technique>,
        pass: impl FnOnce(&mut Self) -> (T, u64),
    ) -> T {
        let start = Instant::now();
        let (result, rays) = pass(self);
        let seconds = start.elapsed().as_secs_f64();
        self.passes.push(PassReport { name, technique, seconds, rays });
        result
    }

    /// What every pixel sees.
    fn visibility(&mut self, context: &FrameContext<'_>) -> Result<()> {
        let settings = context.settings;
        let technique = self.choosers.visibility.choose(settings.gbuffer, settings.quality, true);
        self.timed("visibility", Some(technique), |this| {
            let (width, height) = context.view.size();
            this.keys.clear();
            if !context.opaque {
                let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
                let key = |at| ray_key(pixel_key(settings.seed, at, context.number), 1);
                this.keys.extend(pixels.map(key));
            }
            let Self { raster, keys, gbuffer: GBuffer { hits, .. }, .. } = this;
            let raster = raster.get_or_insert_with(|| new_raster(context.scene));
            let (camera, jitter) = (context.view.camera(), context.view.jitter());
            match technique {
                Technique::Rays => {
                    trace_primary(context.scene, camera, (width, height), jitter, keys, hits);
                    (Ok(()), hits.len() as u64)
                }
                _ => {
                    let size = (width, height);
                    (rasterise(raster, context.scene, camera, size, jitter, keys, hits), 0)
                }
            }
        })?;
        self.note(|choosers| &mut choosers.visibility);
        Ok(())
    }

    /// Light from punctual and sampled lights.
    fn direct(&mut self, context: &FrameContext<'_>) -> Result<()> {
        let settings = context.settings;
        let exact = &context.lights.exact;
        let any = settings.passes.direct && settings.passes.shadows && !exact.is_empty();
        let technique = self.choosers.shadows.choose(settings.shadows, settings.quality, false);
        let by_maps = any && technique == Technique::Raster;
        self.timed("direct", any.then_some(technique), |this| {
            let Self { raster, gbuffer, signals, maps, .. } = this;
            let raster = raster.get_or_insert_with(|| new_raster(context.scene));
            if by_maps {
                maps.resize_with(exact.len(), ShadowMaps::default);
                for (maps, light) in maps.iter_mut().zip(exact) {
                    if let Err(error) = maps.draw(raster, context.scene, light) {
                        return (Err(error), 0);
                    }
                }
            }
            let maps = by_maps.then_some(&maps[..]);
            (Ok(()), direct_light(context, gbuffer, maps, signals))
        })?;
        self.note(|choosers| &mut choosers.shadows);
        Ok(())
    }

    /// Light along sampled rays, and reflections.
    fn indirect(&mut self, context: &FrameContext<'_>, history: &History) -> Result<Gathered> {
        let settings = context.settings;
        if settings.mode == FrameMode::Path {
            return Ok(self.timed("paths", None, |this| {
                let gathered = gather_pixels(context, &this.gbuffer, &mut this.signals);
                (gathered, gathered.rays)
            }));
        }
        self.quads.choose(context, &self.gbuffer);
        let wanted = settings.passes.reflections;
        let technique =
            self.choosers.reflections.choose(settings.reflections, settings.quality, false);
        let by_rays = wanted && technique == Technique::Rays;
        if wanted && !by_rays {
            self.timed("screen_reflections", Some(technique), |this| {
                let Self { gbuffer, quads, screen, .. } = this;
                let (picture, diagonal) = (&history.picture, diagonal(context.scene));
                (screen_pass::reflections(context, gbuffer, picture, diagonal, screen, quads), 0)
            })?;
            self.note(|choosers| &mut choosers.reflections);
        }
        Ok(self.timed("indirect", by_rays.then_some(technique), |this| {
            let Self { gbuffer, quads, signals, .. } = this;
            let gathered = gather_quads(context, gbuffer, quads, signals, by_rays);
            (gathered, gathered.rays)
        }))
    }

    fn occlusion(&mut self, context: &FrameContext<'_>) -> Result<()> {
        let settings = context.settings;
        if settings.mode == FrameMode::Path || !settings.passes.ambient_occlusion {
            return Ok(());
        }
        let radius = settings.ao_radius.unwrap_or(0.05 * diagonal(context.scene));
        let chooser = self.choosers.occlusion;
        let technique = chooser.choose(settings.ambient_occlusion, settings.quality, false);
        self.timed("ambient_occlusion", Some(technique), |this| {
            let Self { gbuffer, quads, signals, .. } = this;
            match technique {
                Technique::Raster => (screen_pass::occlusion(context, gbuffer, radius, signals), 0),
                _ => (Ok(()), ambient_occlusion(context, gbuffer, radius, quads, signals)),
            }
        })?;
        self.note(|choosers| &mut choosers.occlusion);
        Ok(())
    }

    /// Tells a chooser what the last pass took.
    fn note(&mut self, chooser: impl FnOnce(&mut Choosers) -> &mut Chooser) {
        if let Some(PassReport { technique: Some(technique), seconds, .. }) = self.passes.last() {
            chooser(&mut self.choosers).note(*technique, *seconds);
        }
    }
}

/// Of what there are two ways to make.
#[derive(Clone, Copy, Debug, Default)]
struct Choosers {
    visibility: Chooser,
    shadows: Chooser,
    reflections: Chooser,
    occlusion: Chooser,
}

/// A rasteriser with the instruction set that the scene is traced with.
fn new_raster(scene: &FlatScene) -> PrimaryRaster {
    let isa = scene.tlas.blases().first().map_or_else(IsaLevel::detect, |blas| blas.isa());
    PrimaryRaster::new(isa)
}

/// Of a scene's bounds; 1 if it is empty.
fn diagonal(scene: &FlatScene) -> f32 {
    if scene.bounds.is_empty() { 1.0 } else { scene.bounds.diagonal().max(f32::MIN_POSITIVE) }
}
