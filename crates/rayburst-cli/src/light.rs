//! What surrounds the scene: what it says itself, the options, or a sky if there is no light at all.

use std::path::Path;

use rayburst::{
    glam::Quat,
    scene::{
        Environment, LightKind, Scene, framing::default_light, import::load_environment, sky::Sky,
    },
};

use crate::{
    args::scene::LightArgs,
    error::{CliError, Result},
    terminal,
};

/// Changes the scene's environment as the options ask.
pub(crate) fn apply(scene: &mut Scene, args: &LightArgs) -> Result<()> {
    let rotation = args.environment_rotation.unwrap_or(0.0).to_radians();
    let intensity = args.environment_intensity.unwrap_or(1.0);
    match args.environment.as_deref() {
        Some("none") => scene.environment = Some(Environment::None),
        Some("sky") => {
            add_sky(scene, rotation, intensity);
            return Ok(());
        }
        Some(file) => {
            let (map, mended) = load_environment(Path::new(file))?;
            if let Some(mended) = mended {
                terminal::warn(mended);
            }
            scene.environment = Some(Environment::Map(map));
        }
        None => {
            if let Some(said) = default_light(scene) {
                terminal::note(said);
            }
        }
    }
    let changes = args.environment_rotation.is_some() || args.environment_intensity.is_some();
    match &mut scene.environment {
        Some(Environment::Map(map)) => {
            map.rotation += rotation;
            map.intensity *= intensity;
        }
        Some(Environment::Constant(radiance)) => *radiance *= intensity,
        Some(Environment::None) | None if changes => {
            return Err(CliError::usage(
                "there is no environment to turn or dim; choose one with --environment",
            ));
        }
        Some(Environment::None) | None => {}
    }
    Ok(())
}

/// A sky instead of the scene's environment, with a sun unless the scene has one.
fn add_sky(scene: &mut Scene, rotation: f32, intensity: f32) {
    let usual = Sky::default();
    let sun_direction = Quat::from_rotation_y(rotation) * usual.sun_direction;
    let (mut map, mut sun) = Sky { sun_direction, ..usual }.bake();
    map.intensity *= intensity;
    sun.intensity *= intensity;
    scene.environment = Some(Environment::Map(map));
    let shines = |kind: &LightKind| matches!(kind, LightKind::Directional { .. });
    let placed = scene.nodes.iter().filter_map(|n| scene.lights.get(n.light? as usize));
    if !scene.world_lights.iter().chain(placed).any(|l| shines(&l.kind)) {
        scene.world_lights.push(sun);
    }
}
