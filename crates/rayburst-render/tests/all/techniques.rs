//! Light sampling and BSDF sampling agree, alone and together.

use rayburst_render::{LightSampling, Renderer};
use rayburst_scene::builtin;

use crate::scenes::{flat, mean, render, settings, zoo};

/// The mean of a picture and its standard error.
fn estimate(renderer: &Renderer) -> (f64, f64) {
    let film = renderer.film();
    let variance: f64 = film.variance().iter().map(|&v| f64::from(v)).sum();
    let pixels = f64::from(film.width() * film.height());
    let luminance =
        renderer.picture().map(|p| glam::Vec3::splat(rayburst_image::colour::luminance(p)));
    (mean(&luminance), variance.sqrt() / pixels)
}

#[test]
fn each_technique_alone_finds_all_the_light() {
    for name in ["veach-mis", "cornell"] {
        // Rougher than they are, so that no technique alone is hopeless.
        let mut scene = builtin::build(name).unwrap();
        for material in &mut scene.materials {
            material.roughness = material.roughness.max(0.4);
        }
        let camera = scene.views[0].camera;
        let scene = flat(&scene);
        let estimates: Vec<(f64, f64)> =
            [LightSampling::Both, LightSampling::LightOnly, LightSampling::BsdfOnly]
                .into_iter()
                .map(|technique| {
                    let mut settings = settings((24, 24), 256);
                    settings.light_sampling = technique;
                    settings.sampler = rayburst_math::SamplerKind::Independent;
                    settings.max_depth = 3;
                    estimate(&render(&scene, camera, &settings))
                })
                .collect();
        let (both, both_sigma) = estimates[0];
        for (technique, (mean, sigma)) in ["light", "bsdf"].into_iter().zip(&estimates[1..]) {
            let allowed = 3.0 * (sigma * sigma + both_sigma * both_sigma).sqrt();
            assert!(
                (mean - both).abs() < allowed,
                "{name}: {technique} alone {mean} ± {sigma}, both {both} ± {both_sigma}"
            );
            assert!(both_sigma <= 1.05 * sigma, "{name}: both is noisier than {technique} alone");
        }
    }
}

#[test]
fn roulette_changes_the_noise_and_not_the_mean() {
    let (scene, camera) = zoo();
    let mut settings = settings((24, 16), 256);
    settings.sampler = rayburst_math::SamplerKind::Independent;
    let with = render(&scene, camera, &settings);
    settings.russian_roulette = false;
    settings.seed = 1;
    let without = render(&scene, camera, &settings);
    assert!(with.rays().total() < without.rays().total());
    let ((a, sigma_a), (b, sigma_b)) = (estimate(&with), estimate(&without));
    assert!((a - b).abs() < 3.0 * (sigma_a * sigma_a + sigma_b * sigma_b).sqrt(), "{a} {b}");
}
