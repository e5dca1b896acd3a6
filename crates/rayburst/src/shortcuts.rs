//! The usual way from a scene to a picture, in one call a step.

use std::{path::Path, sync::Arc};

use glam::Affine3A;
use rayburst_accel::BuildOptions;
use rayburst_image::{
    ImageError, RgbImage, ToneMap, exposure,
    quantise::{Dither, to_srgb8},
    write_png,
};
use rayburst_render::{RenderError, RenderSettings, Renderer};
use rayburst_scene::{
    Camera, FlatScene, FlattenError, Flattener, Pose, Scene, framing,
    import::{self, ImportError, LoadOptions},
};

/// What can go wrong between a file and a picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene could not be read.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The scene could not be prepared for tracing.
    #[error(transparent)]
    Flatten(#[from] FlattenError),
    /// The picture could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The picture could not be written.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// Reads a scene from a file.
pub fn load(path: impl AsRef<Path>) -> Result<Scene, Error> {
    Ok(import::load(path.as_ref(), &LoadOptions::default())?)
}

/// Prepares a scene at rest for tracing. A scene without any light gets a sky with a sun.
pub fn flatten(scene: &Scene) -> Result<FlatScene, Error> {
    let mut lit = None;
    if !scene.has_light() {
        framing::default_light(lit.insert(scene.clone()));
    }
    let scene = lit.as_ref().unwrap_or(scene);
    Ok(Flattener::new(scene, BuildOptions::default()).at(&Pose::rest(scene))?)
}

/// The scene's first camera, or one that sees all of it.
pub fn default_camera(scene: &Scene, flat: &FlatScene) -> Camera {
    if let Some(view) = scene.views.first() {
        return view.camera;
    }
    let pose = Pose::rest(scene);
    let placed = scene.nodes.iter().zip(&pose.world).find_map(|(node, world)| {
        let camera = &scene.cameras[node.camera? as usize];
        let (_, rotation, at) = world.to_scale_rotation_translation();
        let transform = Affine3A::from_rotation_translation(rotation, at);
        Some(Camera { transform, projection: camera.projection, aperture: 0.0, focus: 1.0 })
    });
    placed.unwrap_or_else(|| framing::default_view(&flat.bounds, 16.0 / 9.0).camera)
}

/// Renders a scene at rest from its first camera, in linear radiance.
pub fn picture(scene: &Scene, settings: RenderSettings) -> Result<RgbImage, Error> {
    let flat = Arc::new(flatten(scene)?);
    let camera = default_camera(scene, &flat);
    let mut renderer = Renderer::new(flat, camera, settings)?;
    renderer.render();
    Ok(renderer.picture())
}

/// Writes radiance as a picture for the eye: exposed automatically, tone-mapped, 8 bits.
pub fn save_png(picture: &RgbImage, path: impl AsRef<Path>) -> Result<(), Error> {
    let toned = ToneMap::default().apply_image(picture, exposure::auto_exposure(picture));
    Ok(write_png(path.as_ref(), &to_srgb8(&toned, Dither::Triangular))?)
}
