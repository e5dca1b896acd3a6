//! Small scenes, and shortcuts for rendering them.

use std::{ops::ControlFlow, sync::Arc};

use glam::{Vec2, Vec3};
use rayburst_accel::BuildOptions;
use rayburst_image::{FilterKind, RgbImage};
use rayburst_render::{Limits, RenderSettings, Renderer};
use rayburst_scene::{
    Camera, Environment, FlatScene, Flattener, Light, LightKind, Material, Pose, Scene, builtin,
    shapes::{self, Shape},
};

/// A scene at rest.
pub(crate) fn flat(scene: &Scene) -> Arc<FlatScene> {
    let pose = Pose::rest(scene);
    Arc::new(Flattener::new(scene, BuildOptions::default()).at(&pose).unwrap())
}

/// A built-in scene and its first view.
pub(crate) fn built_in(spec: &str) -> (Arc<FlatScene>, Camera) {
    let scene = builtin::build(spec).unwrap();
    (flat(&scene), scene.views[0].camera)
}

/// Small, quick settings with a box filter.
pub(crate) fn settings(size: (u32, u32), spp: u32) -> RenderSettings {
    RenderSettings { size, spp, filter: FilterKind::Box, ..RenderSettings::default() }
}

/// A complete render.
pub(crate) fn render(
    scene: &Arc<FlatScene>,
    camera: Camera,
    settings: &RenderSettings,
) -> Renderer {
    let mut renderer = Renderer::new(scene.clone(), camera, settings.clone()).unwrap();
    let outcome = renderer.render_until(&Limits::default(), &|_| ControlFlow::Continue(()));
    assert_eq!(outcome.samples, settings.spp);
    assert_eq!(renderer.film().dropped(), 0, "samples that are not finite");
    renderer
}

pub(crate) fn picture(
    scene: &Arc<FlatScene>,
    camera: Camera,
    settings: &RenderSettings,
) -> RgbImage {
    render(scene, camera, settings).picture()
}

/// The mean of a picture's channels.
pub(crate) fn mean(picture: &RgbImage) -> f64 {
    let sum: f64 = picture.pixels.iter().map(|p| f64::from(p.element_sum())).sum();
    sum / (3.0 * picture.pixels.len() as f64)
}

/// A square of side `2·half` in the plane y = `height`, seen from above.
pub(crate) fn floor(half: f32, height: f32) -> Shape {
    let mut shape = Shape::default();
    shape.add_quad([
        Vec3::new(-half, height, half),
        Vec3::new(half, height, half),
        Vec3::new(half, height, -half),
        Vec3::new(-half, height, -half),
    ]);
    shape
}

/// A camera above a point of the plane y = 0 that looks at it at an angle, through a narrow lens so
/// that a pixel is nearly that point.
pub(crate) fn look_at_origin() -> Camera {
    Camera::look_at(Vec3::new(0.3, 1.0, 0.4), Vec3::ZERO, Vec3::Y, 1e-3)
}

/// A little of everything: a mirror, glass, metal, a coat, a cut-out, an emitter, a point light, a sky.
pub(crate) fn zoo() -> (Arc<FlatScene>, Camera) {
    let mut scene = Scene {
        environment: Some(Environment::Constant(Vec3::new(0.1, 0.15, 0.25))),
        ..Scene::default()
    };
    let mut add = |name: &str, material: Material, shape: Shape| {
        let index = scene.add_material(name, material);
        scene.add_mesh(name, vec![shape.into_primitive(index)]);
    };
    let ball = |x: f32, z: f32| shapes::sphere(Vec3::new(x, 0.5, z), 0.5, 2);
    add("floor", Material::diffuse(Vec3::new(0.5, 0.4, 0.3)), floor(4.0, 0.0));
    add("mirror", Material::mirror(Vec3::splat(0.9)), ball(-1.2, 0.0));
    add("glass", Material::glass(1.5), ball(0.0, 0.6));
    add("metal", Material::metal(Vec3::new(0.9, 0.6, 0.3), 0.4), ball(1.2, 0.0));
    add("coat", Material::plastic(Vec3::new(0.2, 0.5, 0.2), 0.2), ball(0.1, -1.2));
    let mut veil = Material::diffuse(Vec3::new(0.7, 0.2, 0.2));
    veil.base_color[3] = 0.4;
    veil.alpha_mode = rayburst_scene::AlphaMode::Blend as u32;
    let mut sheet = Shape::default();
    sheet.add_quad([
        Vec3::new(-2.0, 0.0, -2.0),
        Vec3::new(2.0, 0.0, -2.0),
        Vec3::new(2.0, 1.5, -2.0),
        Vec3::new(-2.0, 1.5, -2.0),
    ]);
    add("veil", veil, sheet);
    let mut lamp = Shape::default();
    lamp.add_quad([
        Vec3::new(-0.5, 3.0, -0.5),
        Vec3::new(0.5, 3.0, -0.5),
        Vec3::new(0.5, 3.0, 0.5),
        Vec3::new(-0.5, 3.0, 0.5),
    ]);
    add("lamp", Material::emitter(Vec3::splat(6.0)), lamp);
    scene.world_lights.push(Light {
        intensity: Vec3::new(4.0, 3.0, 2.0),
        kind: LightKind::Point { position: Vec3::new(2.5, 2.0, 2.0) },
    });
    let camera = Camera::look_at(Vec3::new(0.6, 1.6, 4.2), Vec3::new(0.0, 0.5, 0.0), Vec3::Y, 0.8);
    (flat(&scene), camera)
}

/// The middle of the picture's pixels in the coordinates of [`Camera::ray`].
pub(crate) fn pixel_centre(x: u32, y: u32) -> Vec2 {
    Vec2::new(x as f32 + 0.5, y as f32 + 0.5)
}
