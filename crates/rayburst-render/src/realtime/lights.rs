//! The lights of a scene as the passes of a frame ask them.

use std::sync::Arc;

use rayburst_math::glam::Vec3;
use rayburst_scene::{Environment, FlatScene, Light, LightKinds, LightSampler};

use super::settings::{FrameMode, FrameSettings};

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
        let primary = LightSampler::of_kinds(scene, kinds, |_, _, _| false);
        Self { scene: scene.clone(), wants, all, primary, exact }
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
