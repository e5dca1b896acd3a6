//! The lights of a scene as the passes of a frame ask them.

use std::sync::Arc;

use rayburst_math::{Aabb, glam::Vec3};
use rayburst_scene::{
    Environment, FlatScene, Light, LightKinds, LightSampler,
    ltc::{PolygonLightLimits, PolygonLights, SurfaceBounds},
};
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, GBuffer},
    settings::{FrameMode, FrameSettings},
};

/// More punctual lights than this are sampled at random.
const EXACT_LIGHTS: usize = 4;

/// A brighter part of the environment than so many times its mean is worth shadow rays of its own; else
/// the rays of other passes find it.
const PEAK: f32 = 64.0;

/// Samplers, and what they were made of.
#[derive(Debug)]
pub(crate) struct FrameLights {
    scene: Arc<FlatScene>,
    wants: Wants,
    /// All lights, for hits beyond the first.
    pub(crate) all: LightSampler,
    /// What is sampled at random at the first hit.
    pub(crate) primary: LightSampler,
    /// What is asked for by a ray each at the first hit.
    pub(crate) exact: Vec<Light>,
    /// What has a closed form at the first hit.
    pub(crate) polygons: PolygonLights,
}

/// The polygon lights with a closed form in one square of pixels, as indices.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TileLights {
    count: u32,
    lights: [u32; TILE_LIGHTS],
}

/// The most polygon lights of a square.
const TILE_LIGHTS: usize = 4;

impl TileLights {
    pub(crate) fn lights(&self) -> &[u32] {
        &self.lights[..self.count as usize]
    }

    /// Whether a triangle is part of one of the lights.
    #[inline]
    pub(crate) fn hold(
        &self,
        polygons: &PolygonLights,
        [instance, geometry, primitive]: [u32; 3],
    ) -> bool {
        self.count > 0
            && polygons
                .light_of(instance, geometry, primitive)
                .is_some_and(|light| self.lights().contains(&light))
    }
}

/// What of the settings decides about lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Wants {
    mode: FrameMode,
    /// Whether rays of other passes find the environment.
    rays_find_environment: bool,
}

impl FrameLights {
    pub(crate) fn new(scene: &Arc<FlatScene>, settings: &FrameSettings) -> Self {
        let wants = Wants::of(settings);
        let all = LightSampler::new(scene);
        let exact = match wants.mode {
            FrameMode::Hybrid if scene.lights.len() <= EXACT_LIGHTS => scene.lights.clone(),
            _ => vec![],
        };
        let by_rays = wants.rays_find_environment && peak(&scene.environment) < PEAK;
        let kinds = LightKinds {
            punctual: exact.is_empty(),
            environment: wants.mode == FrameMode::Path || !by_rays,
            emitters: true,
        };
        let polygons = match wants.mode {
            FrameMode::Hybrid => PolygonLights::new(scene, &PolygonLightLimits::default()),
            FrameMode::Path => PolygonLights::default(),
        };
        // Few enough to be in every square that they reach: they are never sampled.
        let few = polygons.lights().len() <= TILE_LIGHTS;
        let primary = LightSampler::of_kinds(scene, kinds, |instance, geometry, primitive| {
            few && polygons.light_of(instance, geometry, primitive).is_some()
        });
        Self { scene: scene.clone(), wants, all, primary, exact, polygons }
    }

    /// The most important polygon lights of each square of pixels, row by row.
    pub(crate) fn choose(
        &self,
        gbuffer: &GBuffer,
        settings: &FrameSettings,
        tiles: &mut Vec<TileLights>,
    ) {
        let (width, height) = gbuffer.size();
        let (columns, rows) = (width.div_ceil(BAND), height.div_ceil(BAND));
        tiles.clear();
        tiles.resize((columns * rows) as usize, TileLights::default());
        if self.polygons.is_empty() || !settings.passes.direct || settings.max_depth < 2 {
            return;
        }
        tiles.par_iter_mut().enumerate().for_each(|(i, tile)| {
            let (left, top) = (i as u32 % columns * BAND, i as u32 / columns * BAND);
            let mut bounds = Aabb::EMPTY;
            for y in top..(top + BAND).min(height) {
                for x in left..(left + BAND).min(width) {
                    if let Some(place) = gbuffer.place_at((x, y)) {
                        bounds = bounds.grow(place.position);
                    }
                }
            }
            let mut chosen = [(0, 0.0); TILE_LIGHTS];
            let surfaces = SurfaceBounds::of_positions(bounds);
            tile.count = self.polygons.most_important(&surfaces, &mut chosen) as u32;
            tile.lights = chosen.map(|(light, _)| light);
        });
    }

    /// Whether these are the lights of a scene, for these settings.
    pub(crate) fn fit(&self, scene: &Arc<FlatScene>, settings: &FrameSettings) -> bool {
        Arc::ptr_eq(&self.scene, scene) && self.wants == Wants::of(settings)
    }

    /// What a ray sees that leaves the scene straight from the eye.
    #[inline]
    pub(crate) fn sky(&self, scene: &FlatScene, direction: Vec3) -> Vec3 {
        self.all.environment_radiance(scene, direction) + self.all.sun_radiance(scene, direction)
    }
}

impl Wants {
    fn of(settings: &FrameSettings) -> Self {
        let passes = &settings.passes;
        Self {
            mode: settings.mode,
            rays_find_environment: passes.indirect && passes.reflections && settings.max_depth > 1,
        }
    }
}

/// How many times brighter than its mean an environment gets.
fn peak(environment: &Environment) -> f32 {
    let Environment::Map(map) = environment else { return 1.0 };
    let luminance = |c: &Vec3| c.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let (width, height) = (map.size.0 as usize, map.size.1 as usize);
    let (mut sum, mut weights, mut most) = (0.0f64, 0.0f64, 0.0f32);
    for (y, row) in map.texels.chunks(width.max(1)).enumerate() {
        let weight = ((y as f64 + 0.5) / height as f64 * std::f64::consts::PI).sin();
        for texel in row {
            let value = luminance(texel);
            sum += f64::from(value) * weight;
            weights += weight;
            most = most.max(value);
        }
    }
    if sum > 0.0 { (f64::from(most) * weights / sum) as f32 } else { 1.0 }
}
