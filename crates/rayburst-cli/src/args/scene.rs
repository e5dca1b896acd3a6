//! Options that choose the scene, its instant, the camera and the light around it.

use std::path::PathBuf;

use rayburst::glam::Vec3;

use super::values;

/// Which scene, and which instant of it.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Scene")]
pub(crate) struct SceneArgs {
    /// A .gltf, .glb, .obj or .ply file, or a built-in scene's name (see `rayburst scenes`)
    #[arg(value_name = "SCENE", default_value = rayburst::scene::builtin::DEFAULT)]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) instant: InstantArgs,
}

/// How files are read, and at which time.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Scene")]
pub(crate) struct InstantArgs {
    /// Cameras and lights from this file instead of NAME.view.json beside the scene
    #[arg(long, value_name = "FILE")]
    pub(crate) view: Option<PathBuf>,
    /// Let the scene refer to files outside its folder
    #[arg(long)]
    pub(crate) allow_external: bool,
    /// Animation to play, by name or index [default: all that do not move the same]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) animation: Option<String>,
    /// Time in the animation, in seconds
    #[arg(long, value_name = "S", value_parser = values::number, allow_hyphen_values = true)]
    pub(crate) time: Option<f32>,
}

/// From where the scene is seen.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Camera of the scene, by name or index [default: the first]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) camera: Option<String>,
    /// Where the camera stands
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true)]
    pub(crate) eye: Option<Vec3>,
    /// What it looks at
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true)]
    pub(crate) target: Option<Vec3>,
    /// Which way is up
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true)]
    pub(crate) up: Option<Vec3>,
    /// Vertical field of view, in degrees
    #[arg(long, value_name = "DEG", value_parser = values::field_of_view)]
    pub(crate) fov: Option<f32>,
    /// Diameter of the lens, in metres; 0 is a pinhole
    #[arg(long, value_name = "M", value_parser = values::not_negative)]
    pub(crate) aperture: Option<f32>,
    /// Distance of the plane in focus, in metres
    #[arg(long, value_name = "M", value_parser = values::positive)]
    pub(crate) focus: Option<f32>,
}

/// What surrounds the scene.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Light")]
pub(crate) struct LightArgs {
    /// What lies behind everything: an .hdr or .exr panorama, `sky` (with a sun), or `none`
    #[arg(long, value_name = "FILE|sky|none")]
    pub(crate) environment: Option<String>,
    /// Turns the environment about the vertical axis
    #[arg(long, value_name = "DEG", value_parser = values::number, allow_hyphen_values = true)]
    pub(crate) environment_rotation: Option<f32>,
    /// Factor on the environment's radiance
    #[arg(long, value_name = "F", value_parser = values::not_negative)]
    pub(crate) environment_intensity: Option<f32>,
}
