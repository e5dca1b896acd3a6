//! What surrounds the scene: what it says itself, the options, or a sky if there is no light at all.

use rayburst::{
    glam::Vec3,
    scene::{Environment, Scene},
};

use crate::{
    args::scene::LightArgs,
    error::{CliError, Result},
    names, terminal,
};

/// Changes the scene's environment as the options ask.
pub(crate) fn apply(scene: &mut Scene, args: &LightArgs) -> Result<()> {
    match args.environment.as_deref() {
        Some("none") => scene.environment = Some(Environment::None),
        Some(other) => {
            return Err(CliError::usage(names::unknown("environment", other, &["none"])));
        }
        None if scene.has_light() => {}
        None => {
            terminal::note("the scene has no light: a grey sky lights it");
            scene.environment = Some(Environment::Constant(Vec3::ONE));
        }
    }
    let changes = args.environment_rotation.is_some() || args.environment_intensity.is_some();
    match &mut scene.environment {
        Some(Environment::Map(map)) => {
            map.rotation += args.environment_rotation.unwrap_or(0.0).to_radians();
            map.intensity *= args.environment_intensity.unwrap_or(1.0);
        }
        Some(Environment::Constant(radiance)) => {
            *radiance *= args.environment_intensity.unwrap_or(1.0);
        }
        Some(Environment::None) | None if changes => {
            return Err(CliError::usage(
                "there is no environment to turn or dim; choose one with --environment",
            ));
        }
        Some(Environment::None) | None => {}
    }
    Ok(())
}
