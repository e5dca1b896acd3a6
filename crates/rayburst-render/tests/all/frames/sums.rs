//! What frames converge to.

use glam::Vec3;
use rayburst_render::{
    RenderSettings,
    realtime::{
        CompositeParameters, FrameMode, FrameRenderer, FrameSettings, History, Passes, composite,
    },
};

use rayburst_scene::import;

use super::{channels, mean_of_frames};
use crate::scenes::{built_in, flat, picture, settings, zoo};

fn frames(mode: FrameMode, max_depth: u32) -> FrameSettings {
    let passes = Passes { ambient: false, ..Passes::ALL };
    FrameSettings { size: (48, 48), mode, max_depth, passes, ..FrameSettings::default() }
}

/// The largest relative difference of the channels' means, and the relative root mean square of pixels.
fn compare(scene: &str, mode: FrameMode, max_depth: u32, count: u32) -> (f32, f32) {
    let (scene, camera) = if scene == "zoo" { zoo() } else { built_in(scene) };
    let frames = mean_of_frames(&scene, camera, &frames(mode, max_depth), count);
    let reference = RenderSettings { max_depth, ..settings((48, 48), 4 * count) };
    let reference = picture(&scene, camera, &reference);
    let (a, b) = (channels(&frames), channels(&reference));
    let difference = ((a - b) / b).abs().max_element();
    let pixels = frames.pixels.iter().zip(&reference.pixels);
    let squares: f32 = pixels.map(|(a, b)| (*a - *b).length_squared()).sum();
    (difference, (squares / frames.pixels.len() as f32).sqrt() / b.length())
}

#[test]
fn one_path_a_pixel_is_the_path_tracer() {
    for depth in [1, 2, 3, 5] {
        let (mean, pixels) = compare("cornell", FrameMode::Path, depth, 256);
        assert!(mean < 0.01 && pixels < 0.12, "depth {depth}: {mean} {pixels}");
    }
}

#[test]
fn all_passes_together_are_the_path_tracer() {
    for depth in [1, 2, 3, 5] {
        let (mean, pixels) = compare("cornell", FrameMode::Hybrid, depth, 256);
        assert!(mean < 0.01 && pixels < 0.12, "depth {depth}: {mean} {pixels}");
    }
}

#[test]
fn sun_and_sky_are_shared_between_passes_without_loss() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let path = std::path::Path::new(folder).join("sponza/sponza.gltf");
    if !path.is_file() {
        eprintln!("skipped: {} is not there", path.display());
        return;
    }
    let scene = import::load(&path, &Default::default()).unwrap();
    let (flat, camera) = (flat(&scene), scene.views[0].camera);
    let size = (96, 54);
    let reference = RenderSettings { max_depth: 3, ..settings(size, 512) };
    let reference = channels(&picture(&flat, camera, &reference));
    for mode in [FrameMode::Hybrid, FrameMode::Path] {
        let frames = FrameSettings { size, ..frames(mode, 3) };
        let mean = channels(&mean_of_frames(&flat, camera, &frames, 128));
        let difference = ((mean - reference) / reference).abs().max_element();
        eprintln!("{mode:?}: {difference} of the path tracer's mean");
        assert!(difference < 0.02, "{mode:?}: {mean}, not {reference}");
    }
}

#[test]
fn mirrors_glass_and_metal_are_the_path_tracers() {
    for mode in [FrameMode::Path, FrameMode::Hybrid] {
        let (mean, _) = compare("zoo", mode, 4, 256);
        assert!(mean < 0.03, "{mode:?}: {mean}");
    }
}

#[test]
fn the_ambient_estimate_stands_for_longer_paths() {
    let (scene, camera) = built_in("cornell");
    let long = RenderSettings { max_depth: 16, ..settings((48, 48), 512) };
    let long = channels(&picture(&scene, camera, &long));
    let short = frames(FrameMode::Hybrid, 3);
    let with = FrameSettings { passes: Passes::ALL, ..short };
    let error = |settings: &FrameSettings| {
        let mean = channels(&mean_of_frames(&scene, camera, settings, 96));
        ((mean - long) / long).abs().max_element()
    };
    let (without, with) = (error(&short), error(&with));
    assert!(with < 0.05 && with < 0.5 * without, "{with} with, {without} without");
}

#[test]
fn signals_times_colours_are_the_picture() {
    let (scene, camera) = zoo();
    let settings = frames(FrameMode::Hybrid, 3);
    let mut renderer = FrameRenderer::new(settings).unwrap();
    let frame = renderer.frame(&scene, &camera, &mut History::new()).unwrap();
    let mut again = frame.picture.clone();
    again.fill(Vec3::ONE);
    let parameters = CompositeParameters { ambient: Vec3::ZERO, emission: true };
    let lights = frame.signals.lights();
    composite(frame.gbuffer, frame.signals, &lights, &parameters, &mut again);
    assert_eq!(again.to_image(), frame.picture.to_image());
    let (width, height) = frame.picture.size();
    let mut lit = 0;
    for y in 0..height {
        for x in 0..width {
            let s = frame.signals;
            let guard = |r: Vec3| r.max(Vec3::splat(rayburst_render::realtime::LEAST_REFLECTANCE));
            let diffuse = s.direct_diffuse.get(x, y)
                + s.indirect_diffuse.get(x, y)
                + s.analytic_diffuse.get(x, y) * s.shadow.get(x, y);
            let specular = s.direct_specular.get(x, y)
                + s.indirect_specular.get(x, y)
                + s.analytic_specular.get(x, y) * s.shadow.get(x, y);
            let sum = guard(s.diffuse_reflectance.get(x, y)) * diffuse
                + guard(s.specular_reflectance.get(x, y)) * specular
                + s.transparency.get(x, y)
                + frame.gbuffer.emitted.get(x, y);
            let picture = frame.picture.get(x, y);
            assert!((sum - picture).length() <= 1e-4 * (1.0 + picture.length()), "({x}, {y})");
            lit += u32::from(picture != Vec3::ZERO);
        }
    }
    assert!(lit > width * height / 2);
}

#[test]
fn passes_that_are_left_out_leave_nothing() {
    let (scene, camera) = zoo();
    let none = Passes {
        direct: false,
        shadows: false,
        reflections: false,
        indirect: false,
        ambient_occlusion: false,
        transparency: false,
        emission: false,
        ambient: false,
    };
    let render = |passes: Passes| {
        let settings = FrameSettings { passes, ..frames(FrameMode::Hybrid, 3) };
        let mut renderer = FrameRenderer::new(settings).unwrap();
        let mut history = History::new();
        let frame = renderer.frame(&scene, &camera, &mut history).unwrap();
        let rays: u64 =
            frame.passes.iter().filter(|p| p.name != "visibility").map(|p| p.rays.total()).sum();
        (channels(&frame.picture.to_image()), rays)
    };
    assert_eq!(render(none), (Vec3::ZERO, 0));
    let mut sum = Vec3::ZERO;
    for part in [
        Passes { direct: true, ..none },
        Passes { reflections: true, indirect: true, ..none },
        Passes { transparency: true, ..none },
        Passes { emission: true, ..none },
    ] {
        let (mean, _) = render(part);
        assert!(mean.min_element() >= 0.0 && mean != Vec3::ZERO, "{part:?}");
        sum += mean;
    }
    assert!(sum.is_finite());
    // Shadows only take away.
    let lit = render(Passes { direct: true, ..none });
    let shadowed = render(Passes { direct: true, shadows: true, ..none });
    assert!(shadowed.0.cmple(lit.0).all() && shadowed.1 > 0 && lit.1 == 0);
}
