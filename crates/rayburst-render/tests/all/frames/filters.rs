//! Frames whose light is filtered.

use std::sync::Arc;

use glam::Vec3;
use rayburst_image::RgbImage;
use rayburst_render::realtime::{
    Denoiser, FrameMode, FrameRenderer, FrameSettings, History, Passes, PixelKind,
};
use rayburst_scene::{Camera, FlatScene};

use super::{channels, mean_of_frames};
use crate::scenes::{built_in, flat, zoo};

/// The last of some frames of a scene that stands still.
fn last_of(
    scene: &Arc<FlatScene>,
    camera: Camera,
    settings: FrameSettings,
    frames: u32,
) -> RgbImage {
    let mut renderer = FrameRenderer::new(settings).unwrap();
    let mut history = History::new();
    for _ in 1..frames {
        renderer.frame(scene, &camera, &mut history).unwrap();
    }
    renderer.frame(scene, &camera, &mut history).unwrap().picture.to_image()
}

/// The mean of squared errors over squared values, the brightest hundredth left out: edges of lamps.
fn relative_error(picture: &RgbImage, reference: &RgbImage) -> f32 {
    let floor = 1e-3 * channels(reference).length_squared();
    let pixels = picture.pixels.iter().zip(&reference.pixels);
    let error = |(a, b): (&Vec3, &Vec3)| (*a - *b).length_squared() / (b.length_squared() + floor);
    let mut errors: Vec<f32> = pixels.map(error).collect();
    errors.sort_by(f32::total_cmp);
    let kept = &errors[..errors.len() * 99 / 100];
    kept.iter().sum::<f32>() / kept.len() as f32
}

#[test]
fn filters_take_the_noise_away_and_keep_the_light() {
    let (scene, camera) = built_in("cornell");
    for mode in [FrameMode::Hybrid, FrameMode::Path] {
        // Without jitter, so that edges do not count.
        let plain =
            FrameSettings { size: (64, 64), mode, jitter: false, ..FrameSettings::default() };
        let reference = mean_of_frames(&scene, camera, &plain, 400);
        let noisy = relative_error(&last_of(&scene, camera, plain, 16), &reference);
        for (name, denoiser) in Denoiser::ALL {
            let settings = FrameSettings { denoiser, ..plain };
            let picture = last_of(&scene, camera, settings, 16);
            let gain = noisy / relative_error(&picture, &reference);
            let light = channels(&picture) / channels(&reference);
            eprintln!("{mode:?}, {name}: error {gain:.1} times lower, light {light:.3}");
            let least = match denoiser {
                Denoiser::None => 0.99,
                Denoiser::Atrous => 1.5,
                _ => 8.0,
            };
            assert!(gain >= least, "{mode:?}, {name}: {gain}");
            // A frame that is not filtered is too noisy for that.
            if denoiser != Denoiser::None {
                assert!((light - 1.0).abs().max_element() < 0.06, "{mode:?}, {name}: {light}");
            }
        }
    }
}

#[test]
fn what_mirrors_and_glass_show_is_filtered() {
    let (scene, camera) = zoo();
    let plain =
        FrameSettings { size: (96, 96), jitter: false, max_depth: 5, ..FrameSettings::default() };
    let mut renderer = FrameRenderer::new(plain).unwrap();
    let frame = renderer.frame(&scene, &camera, &mut History::new()).unwrap();
    let gbuffer = frame.gbuffer.clone();
    let mirrors = |picture: &RgbImage| {
        let at = |i: u32| gbuffer.kind_at(i % 96, i / 96) == PixelKind::Specular;
        let pixels: Vec<Vec3> = picture
            .pixels
            .iter()
            .zip(0..)
            .filter_map(|(pixel, i)| at(i).then_some(*pixel))
            .collect();
        RgbImage { width: pixels.len() as u32, height: 1, pixels }
    };
    let reference = mirrors(&mean_of_frames(&scene, camera, &plain, 300));
    assert!(reference.pixels.len() > 100);
    let error =
        |settings| relative_error(&mirrors(&last_of(&scene, camera, settings, 16)), &reference);
    let noisy = error(plain);
    for denoiser in [Denoiser::Svgf, Denoiser::AdaptiveSvgf, Denoiser::Effects] {
        let gain = noisy / error(FrameSettings { denoiser, ..plain });
        eprintln!("{}: error {gain:.1} times lower", denoiser.name());
        assert!(gain > 3.0, "{}: {gain}", denoiser.name());
    }
}

#[test]
fn frames_without_stairs_are_supersampled() {
    let (scene, camera) = built_in("cornell");
    let size = (72, 72);
    let plain = FrameSettings { size, ..FrameSettings::default() };
    let reference = mean_of_frames(&scene, camera, &plain, 400);
    let filtered = FrameSettings { denoiser: Denoiser::Effects, ..plain };
    let without = relative_error(&last_of(&scene, camera, filtered, 32), &reference);
    // Half as many pixels along each side, each four times as large.
    let half = FrameSettings { render_scale: 0.5, ..filtered };
    let coarse = last_of(&scene, camera, half, 32);
    let large =
        RgbImage::from_fn(size.0, size.1, |x, y| coarse.pixels[(y / 2 * 36 + x / 2) as usize]);
    let stretched = relative_error(&large, &reference);
    for (settings, before, least) in [(filtered, without, 1.5), (half, stretched, 1.5)] {
        let settings = FrameSettings { antialias: true, ..settings };
        let picture = last_of(&scene, camera, settings, 32);
        assert_eq!((picture.width, picture.height), size);
        let gain = before / relative_error(&picture, &reference);
        let scale = settings.render_scale;
        eprintln!("scale {scale}: error {gain:.2} times lower than without antialiasing");
        assert!(gain > least, "scale {scale}: {gain}");
    }
}

#[test]
fn filters_depend_on_no_thread_and_take_any_size() {
    let (scene, camera) = zoo();
    for (name, denoiser) in Denoiser::ALL {
        for (size, render_scale) in [((1, 1), 1.0), ((2, 9), 0.5), ((61, 43), 0.7)] {
            let settings = FrameSettings {
                size,
                render_scale,
                denoiser,
                antialias: true,
                ..FrameSettings::default()
            };
            let pictures = [1, 3].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| last_of(&scene, camera, settings, 4))
            });
            assert_eq!((pictures[0].width, pictures[0].height), size);
            assert!(pictures[0] == pictures[1], "{name}, {size:?}");
            let fine = |p: &Vec3| p.is_finite() && p.min_element() >= 0.0;
            assert!(pictures[0].pixels.iter().all(fine), "{name}, {size:?}");
        }
    }
}

#[test]
fn a_reset_forgets_everything() {
    let (scene, camera) = built_in("cornell");
    for denoiser in [Denoiser::Svgf, Denoiser::AdaptiveSvgf, Denoiser::Effects] {
        let settings =
            FrameSettings { size: (40, 30), denoiser, antialias: true, ..FrameSettings::default() };
        let mut renderer = FrameRenderer::new(settings).unwrap();
        let mut history = History::new();
        let mut frame = |history: &mut History| {
            renderer.frame(&scene, &camera, history).unwrap().picture.to_image()
        };
        let first = frame(&mut history);
        let second = frame(&mut history);
        history.reset();
        assert!(frame(&mut history) == first && second != first);
    }
}

/// The same scene with all lights off.
fn darkened(name: &str) -> Arc<FlatScene> {
    let mut scene = rayburst_scene::builtin::build(name).unwrap();
    for material in &mut scene.materials {
        material.emissive = [0.0; 3];
    }
    flat(&scene)
}

#[test]
fn light_that_goes_out_is_forgotten_sooner_by_the_adaptive_filter() {
    let (scene, camera) = built_in("cornell");
    let dark = darkened("cornell");
    let residual = |denoiser: Denoiser| {
        // The estimate of longer paths fades by itself.
        let passes = Passes { ambient: false, ..Passes::ALL };
        let settings =
            FrameSettings { size: (64, 64), denoiser, passes, ..FrameSettings::default() };
        let mut renderer = FrameRenderer::new(settings).unwrap();
        let mut history = History::new();
        let mut picture = RgbImage::new(1, 1, Vec3::ZERO);
        for number in 0..28 {
            let scene = if number < 24 { &scene } else { &dark };
            picture = renderer.frame(scene, &camera, &mut history).unwrap().picture.to_image();
        }
        assert_eq!(history.frames(), 28, "the history went on");
        channels(&picture).element_sum()
    };
    let [plain, adaptive] = [Denoiser::Svgf, Denoiser::AdaptiveSvgf].map(residual);
    eprintln!("after four dark frames: {plain} by SVGF, {adaptive} by its adaptive form");
    assert!(plain > 0.0 && adaptive <= 0.25 * plain, "{adaptive} of {plain}");
}
