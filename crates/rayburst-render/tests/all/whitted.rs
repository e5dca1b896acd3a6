//! Whitted's ray tracing: the same picture for ever.

use std::path::Path;

use rayburst_image::{
    RgbImage, ToneMap, decode_ldr,
    quantise::{Dither, to_srgb8},
    write_png,
};
use rayburst_render::IntegratorKind;
use rayburst_scene::{Environment, FlatScene};

use crate::scenes::{picture, settings, zoo};

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
