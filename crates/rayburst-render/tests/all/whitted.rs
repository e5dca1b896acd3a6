//! Whitted's ray tracing: the same picture for ever.

use std::path::Path;

use glam::Vec3;
use rayburst_image::{
    RgbImage, ToneMap, decode_ldr,
    quantise::{Dither, to_srgb8},
    write_png,
};
use rayburst_render::IntegratorKind;
use rayburst_scene::{Camera, Environment, FlatScene, Material, Scene, shapes};

use crate::scenes::{flat, floor, mean, picture, render, settings, zoo};

/// Kept beside the tests; `RAYBURST_BLESS=1` writes it anew.
const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/whitted.png");

#[test]
fn the_picture_is_the_golden_one() {
    let (scene, camera) = zoo();
    let mut settings = settings((96, 64), 4);
    settings.integrator = IntegratorKind::Whitted;
    let picture = ToneMap::Aces.apply_image(&picture(&scene, camera, &settings), 0.0);
    let shown = to_srgb8(&picture, Dither::None);
    if std::env::var_os("RAYBURST_BLESS").is_some() {
        write_png(Path::new(GOLDEN), &shown).unwrap();
    }
    let golden = std::fs::read(GOLDEN).expect("the golden picture is kept beside the tests");
    let golden = to_srgb8(&decode_ldr(&golden, GOLDEN).unwrap(), Dither::None);
    assert_eq!((golden.width, golden.height), (shown.width, shown.height));
    // Another instruction set may round a silhouette differently.
    let differ = golden.data.iter().zip(&shown.data).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    assert!(differ <= golden.data.len() / 200, "{differ} of {} bytes differ", golden.data.len());
}

/// Where all surfaces are perfect mirrors and glass, a tree of all rays and random paths through it
/// have the same mean (chapter 26.1).
#[test]
fn branching_and_random_paths_agree() {
    let mut scene =
        Scene { environment: Some(Environment::Constant(Vec3::splat(0.5))), ..Scene::default() };
    let mirror = scene.add_material("mirror", Material::mirror(Vec3::new(0.9, 0.7, 0.5)));
    let mut glass = Material::glass(1.5);
    glass.base_color = [0.8, 0.9, 1.0, 1.0];
    let glass = scene.add_material("glass", glass);
    scene.add_mesh("floor", vec![floor(3.0, 0.0).into_primitive(mirror)]);
    let ball = shapes::sphere(Vec3::Y, 0.9, 3).into_primitive(glass);
    scene.add_mesh("ball", vec![ball]);
    let scene = flat(&scene);
    let camera = Camera::look_at(Vec3::new(0.0, 2.0, 4.0), Vec3::Y, Vec3::Y, 0.7);
    let mean_of = |integrator: IntegratorKind, spp: u32| {
        let mut settings = settings((16, 16), spp);
        settings.integrator = integrator;
        let renderer = render(&scene, camera, &settings);
        let variance: f64 = renderer.film().variance().iter().map(|&v| f64::from(v)).sum();
        (mean(&renderer.picture()), variance.sqrt() / 256.0)
    };
    let (tree, tree_sigma) = mean_of(IntegratorKind::Whitted, 64);
    let (paths, sigma) = mean_of(IntegratorKind::Path, 256);
    // Faint branches are left out of the tree.
    let allowed = 3.0 * (sigma * sigma + tree_sigma * tree_sigma).sqrt() + 2e-3;
    assert!((tree - paths).abs() < allowed, "{tree} {paths} ± {sigma}");
}

#[test]
fn there_is_no_noise_in_it() {
    let (scene, camera) = zoo();
    let mut opaque = FlatScene::clone(&scene);
    opaque.environment = Environment::None;
    let scene = std::sync::Arc::new(opaque);
    let mut settings = settings((24, 16), 1);
    settings.integrator = IntegratorKind::Whitted;
    settings.filter_radius = Some(1e-4);
    let mut of_seed = |seed: u32| -> RgbImage {
        settings.seed = seed;
        picture(&scene, camera, &settings)
    };
    let (a, b) = (of_seed(1), of_seed(2));
    let same = a
        .pixels
        .iter()
        .zip(&b.pixels)
        .filter(|(a, b)| (**a - **b).abs().max_element() < 1e-2 * a.max_element().max(0.01));
    // All but the veil, whose coverage is random, and silhouettes.
    assert!(same.count() > 250);
}
