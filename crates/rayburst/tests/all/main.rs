//! From a scene to a picture by the facade alone.

mod examples;
mod tutorial;

use rayburst::prelude::*;
use rayburst::scene::{builtin, shapes};

#[test]
fn a_scene_becomes_a_png() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("furnace.png");
    let scene = builtin::build("furnace").unwrap();
    let settings = RenderSettings { size: (20, 10), spp: 4, ..RenderSettings::default() };
    let picture = rayburst::picture(&scene, settings).unwrap();
    rayburst::save_png(&picture, &path).unwrap();
    let back = rayburst::image::read_ldr(&path).unwrap();
    assert_eq!((back.width, back.height), (20, 10));
    let darkest = back.pixels.iter().map(|p| p.min_element()).fold(1.0, f32::min);
    assert!(darkest > 0.05, "a furnace is bright: {darkest}");
}

#[test]
fn a_scene_without_camera_and_light_is_seen() {
    let mut scene = Scene::default();
    let grey = scene.add_material("grey", Material::diffuse(Vec3::splat(0.5)));
    let ball = shapes::sphere(Vec3::new(100.0, -3.0, 7.0), 0.2, 3).into_primitive(grey);
    scene.add_mesh("ball", vec![ball]);
    let settings = RenderSettings { size: (16, 16), spp: 16, ..RenderSettings::default() };
    let picture = rayburst::picture(&scene, settings).unwrap();
    let (ball, sky) = (picture.get(8, 8), picture.get(0, 0));
    assert!(ball.min_element() > 0.0 && sky.min_element() > 0.0, "{ball} {sky}");
    assert!((ball - sky).abs().max_element() > 0.1 * sky.max_element(), "the ball is in view");
}

#[test]
fn what_is_missing_is_named() {
    let error = rayburst::load("no/such/scene.glb").unwrap_err().to_string();
    assert!(error.contains("scene.glb"), "{error}");
}
