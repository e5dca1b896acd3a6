//! The frame loop: passes over planes, in order.

use std::{sync::Arc, time::Instant};

use rayburst_image::Plane3;
use rayburst_math::glam::{Vec2, Vec3};
use rayburst_scene::{Camera, FlatScene};

use super::{
    analytic::analytic_light,
    composite::{CompositeParameters, composite, variance},
    direct::direct_light,
    filters::Filtering,
    gbuffer::GBuffer,
    history::History,
    indirect::{Gathered, gather_pixels, gather_quads, gather_specular},
    lights::{FrameLights, TileLights},
    motion::Motion,
    occlusion::ambient_occlusion,
    pass::{FrameContext, isa_of, pixel_key},
    quads::{Found, Quads},
    screen_pass::{self, ScreenWork},
    settings::{Denoiser, FrameMode, FrameSettings, Technique},
    shadow_map::ShadowMaps,
    signals::{Lobe, Signals},
    technique::Chooser,
    view::FrameView,
    visibility::{PrimaryRaster, rasterise, trace_primary},
};
use crate::{RayCounts, Result, integrators::ray_key};

/// How far ambient occlusion reaches unless said otherwise, as a part of the scene's diagonal.
const AO_REACH: f32 = 0.05;

/// Of passes that trace nothing.
const NO_RAYS: RayCounts = RayCounts { camera: 0, shadow: 0, indirect: 0 };

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
    pub rays: RayCounts,
}

/// A finished frame; its buffers are the renderer's until the next one.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Linear radiance, of [`FrameSettings::picture_size`].
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
    pub fn rays(&self) -> RayCounts {
        self.passes.iter().fold(RayCounts::default(), |sum, pass| sum + pass.rays)
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
    /// After antialiasing.
    shown: Plane3,
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
            shown: Plane3::default(),
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
            (fit.unwrap_or_else(|| FrameLights::new(scene, &settings)), NO_RAYS)
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
            path_shading: settings.path_shading(),
            number: history.frames(),
        };
        self.visibility(&context)?;
        let motion = Motion::new(view, scene, history.before());
        self.timed("gbuffer", None, |this| {
            let sky = |direction| lights.sky(scene, direction);
            this.gbuffer.resolve(scene, &view, &motion, &context.shading, sky);
            ((), NO_RAYS)
        });
        let mut tiles = std::mem::take(&mut self.tiles);
        self.timed("prepare", None, |this| {
            this.signals.clear();
            lights.choose(&this.gbuffer, &settings, &mut tiles);
            if settings.mode == FrameMode::Hybrid {
                this.quads.choose(&context, &this.gbuffer);
            }
            ((), NO_RAYS)
        });
        context.tiles = &tiles;
        self.direct(&context)?;
        self.timed("polygon_lights", None, |this| {
            let shadow = analytic_light(&context, &this.gbuffer, &mut this.signals);
            ((), RayCounts { shadow, ..NO_RAYS })
        });
        let gathered = match settings.mode {
            FrameMode::Hybrid => self.blocks(&context, history)?,
            FrameMode::Path => {
                self.timed("paths", None, |this| {
                    ((), gather_pixels(&context, &this.gbuffer, &mut this.signals))
                });
                Gathered::default()
            }
        };
        if settings.passes.transparency {
            self.timed("transparency", None, |this| {
                ((), gather_specular(&context, &this.gbuffer, &mut this.signals))
            });
        }
        let ambient = match settings.mode {
            FrameMode::Hybrid if settings.passes.ambient => history.learn(&gathered),
            _ => Vec3::ZERO,
        };
        let polygons = !lights.polygons.is_empty();
        self.lights = Some(lights);
        self.tiles = tiles;
        self.finish(&view, scene, history, polygons, ambient)?;
        history.advance(view, scene, &self.picture);
        Ok(Frame {
            picture: if settings.antialias { &self.shown } else { &self.picture },
            gbuffer: &self.gbuffer,
            signals: &self.signals,
            view,
            passes: &self.passes,
        })
    }

    /// Makes the picture of the signals.
    fn finish(
        &mut self,
        view: &FrameView,
        scene: &FlatScene,
        history: &mut History,
        polygons: bool,
        ambient: Vec3,
    ) -> Result<()> {
        let (settings, isa) = (self.settings, isa_of(scene));
        let Self { gbuffer, signals, picture, shown, passes, .. } = self;
        let mut note = |name: &'static str, start: Instant| {
            let seconds = start.elapsed().as_secs_f64();
            passes.push(PassReport { name, technique: None, seconds, rays: NO_RAYS });
        };
        let start = Instant::now();
        let mut out = std::mem::take(&mut signals.variance);
        variance(signals, &mut out);
        signals.variance = out;
        note("variance", start);

        let start = Instant::now();
        let reach = settings.ao_radius.unwrap_or(AO_REACH * diagonal(scene));
        let filtering =
            Filtering { gbuffer, signals, settings: &settings, view, polygons, reach, ambient };
        let lights = history.filters.lights(isa, &filtering)?;
        if settings.denoiser != Denoiser::None {
            note(settings.denoiser.name(), start);
        }
        let start = Instant::now();
        let parameters = CompositeParameters { ambient, emission: settings.passes.emission };
        composite(gbuffer, signals, &lights, &parameters, picture);
        note("composite", start);

        if settings.antialias {
            let start = Instant::now();
            history.filters.show(isa, &filtering, picture, shown)?;
            note("antialias", start);
        }
        Ok(())
    }

    /// Runs a pass and notes what it took; the pass gives its result and its rays.
    fn timed<T>(
        &mut self,
        name: &'static str,
        technique: Option<Technique>,
        pass: impl FnOnce(&mut Self) -> (T, RayCounts),
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
            let raster = raster.get_or_insert_with(|| PrimaryRaster::new(isa_of(context.scene)));
            match technique {
                Technique::Rays => {
                    trace_primary(context.scene, context.view, keys, hits);
                    (Ok(()), RayCounts { camera: hits.len() as u64, ..NO_RAYS })
                }
                _ => (rasterise(raster, context.scene, context.view, keys, hits), NO_RAYS),
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
            let raster = raster.get_or_insert_with(|| PrimaryRaster::new(isa_of(context.scene)));
            if by_maps {
                maps.resize_with(exact.len(), ShadowMaps::default);
                for (maps, light) in maps.iter_mut().zip(exact) {
                    if let Err(error) = maps.draw(raster, context.scene, light) {
                        return (Err(error), NO_RAYS);
                    }
                }
            }
            let maps = by_maps.then_some(&maps[..]);
            let shadow = direct_light(context, gbuffer, maps, signals);
            (Ok(()), RayCounts { shadow, ..NO_RAYS })
        })?;
        self.note(|choosers| &mut choosers.shadows);
        Ok(())
    }

    /// What is asked for once a block of pixels: reflections, bounces, ambient occlusion.
    fn blocks(&mut self, context: &FrameContext<'_>, history: &History) -> Result<Gathered> {
        let FrameSettings { passes, quality, .. } = *context.settings;
        let mut found = Found { indirect: passes.indirect, ..Found::default() };
        if passes.reflections {
            found.reflections = true;
            let chooser = self.choosers.reflections;
            let technique = chooser.choose(context.settings.reflections, quality, false);
            self.timed("reflections", Some(technique), |this| {
                let Self { gbuffer, quads, screen, .. } = this;
                if technique == Technique::Rays {
                    return (Ok(()), gather_quads(context, gbuffer, quads, Lobe::Glossy).rays);
                }
                let (picture, size) = (&history.picture, diagonal(context.scene));
                let done = screen_pass::reflections(context, gbuffer, picture, size, screen, quads);
                (done, NO_RAYS)
            })?;
            self.note(|choosers| &mut choosers.reflections);
        }
        let mut gathered = Gathered::default();
        if passes.indirect {
            gathered = self.timed("indirect", None, |this| {
                let Self { gbuffer, quads, .. } = this;
                let gathered = gather_quads(context, gbuffer, quads, Lobe::Broad);
                (gathered, gathered.rays)
            });
        }
        if passes.ambient_occlusion {
            let radius = context.settings.ao_radius.unwrap_or(AO_REACH * diagonal(context.scene));
            let chooser = self.choosers.occlusion;
            let technique = chooser.choose(context.settings.ambient_occlusion, quality, false);
            found.occlusion = technique == Technique::Rays;
            self.timed("ambient_occlusion", Some(technique), |this| {
                let Self { gbuffer, quads, signals, .. } = this;
                if technique == Technique::Rays {
                    let shadow = ambient_occlusion(context, gbuffer, radius, quads);
                    return (Ok(()), RayCounts { shadow, ..NO_RAYS });
                }
                (screen_pass::occlusion(context, gbuffer, radius, signals), NO_RAYS)
            })?;
            self.note(|choosers| &mut choosers.occlusion);
        }
        self.timed("share", None, |this| {
            this.quads.share(&this.gbuffer, &mut this.signals, found);
            ((), NO_RAYS)
        });
        Ok(gathered)
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

/// Of a scene's bounds; 1 if it is empty.
fn diagonal(scene: &FlatScene) -> f32 {
    if scene.bounds.is_empty() { 1.0 } else { scene.bounds.diagonal().max(f32::MIN_POSITIVE) }
}
