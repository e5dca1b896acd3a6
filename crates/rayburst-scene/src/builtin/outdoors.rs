//! Daylight of the built-in scenes.

use glam::Vec3;

use crate::{Environment, Scene, sky::Sky};

/// Adds a clear sky and a sun that stands in the direction `towards_sun`.
pub(super) fn add_daylight(scene: &mut Scene, towards_sun: Vec3) {
    let sky = Sky { sun_direction: towards_sun.normalize(), ..Sky::default() };
    let (map, sun) = sky.bake();
    scene.environment = Some(Environment::Map(map));
    scene.world_lights.push(sun);
}
