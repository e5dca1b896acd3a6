//! Frames in a row: the same for any number of threads, of any size, of any scene.

use std::sync::Arc;

use glam::Vec3;
use rayburst_render::{
    RenderError,
    realtime::{FrameMode, FrameRenderer, FrameSettings, History, Quality, Technique},
};
use rayburst_scene::{Camera, FlatScene, Material, Primitive, Scene};

use crate::scenes::{built_in, flat, zoo};

#[test]
fn threads_do_not_show() {
    let (scene, camera) = zoo();
    for mode in [FrameMode::Hybrid, FrameMode::Path] {
        for reflections in [Technique::Rays, Technique::Raster] {
            let techniques = FrameSettings {
                reflections,
                ambient_occlusion: reflections,
                ..FrameSettings::default()
            };
            let settings = FrameSettings { size: (61, 43), mode, max_depth: 4, ..techniques };
            let pictures = [1, 2, 5].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut renderer = FrameRenderer::new(settings).unwrap();
                    let mut history = History::new();
                    for _ in 0..2 {
                        renderer.frame(&scene, &camera, &mut history).unwrap();
                    }
                    let frame = renderer.frame(&scene, &camera, &mut history).unwrap();
                    (frame.picture.to_image(), frame.rays())
                })
            });
            assert!(pictures[0] == pictures[1] && pictures[0] == pictures[2], "{mode:?}");
        }
    }
}

#[test]
fn frames_have_any_size_and_scale() {
    let (scene, camera) = built_in("cornell");
    for mode in [FrameMode::Hybrid, FrameMode::Path] {
        for size in [(1, 1), (2, 1), (1, 9), (7, 3), (17, 16), (33, 31)] {
            for render_scale in [1.0, 0.5, 0.7] {
                let settings = FrameSettings { size, render_scale, mode, ..Default::default() };
                let mut renderer = FrameRenderer::new(settings).unwrap();
                let frame = renderer.frame(&scene, &camera, &mut History::new()).unwrap();
                let expected = settings.render_size();
                assert_eq!(frame.picture.size(), expected);
                assert!(expected.0 >= 1 && expected.0 <= size.0 && expected.1 <= size.1.max(1));
                assert!(frame.picture.to_image().pixels.iter().all(|p| p.is_finite()));
            }
        }
    }
    for wrong in [0.4, 1.5, f32::NAN] {
        let settings = FrameSettings { render_scale: wrong, ..Default::default() };
        let error = FrameRenderer::new(settings).unwrap_err();
        assert!(matches!(error, RenderError::Setting { name: "render scale", .. }), "{error}");
    }
    assert!(FrameRenderer::new(FrameSettings { size: (0, 4), ..Default::default() }).is_err());
}

#[test]
fn half_the_scale_is_a_quarter_of_the_pixels() {
    let settings = FrameSettings { size: (640, 360), render_scale: 0.5, ..Default::default() };
    assert_eq!(settings.render_size(), (320, 180));
}

#[test]
fn scenes_with_nothing_or_nonsense_in_them_do_not_fail() {
    let camera = Camera::look_at(Vec3::new(0.0, 1.0, 4.0), Vec3::ZERO, Vec3::Y, 0.8);
    let empty = flat(&Scene::default());
    let triangle = |points: [Vec3; 3], material| Primitive {
        positions: points.to_vec(),
        indices: vec![[0, 1, 2]],
        material,
        ..Primitive::default()
    };
    let corners = [Vec3::new(-1.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.5, 0.0)];
    let mut dark = Scene::default();
    let grey = dark.add_material("grey", Material::diffuse(Vec3::splat(0.5)));
    dark.add_mesh("triangle", vec![triangle(corners, grey)]);
    let mut broken = dark.clone();
    let nan = f32::NAN;
    for points in [
        [Vec3::splat(nan), Vec3::ZERO, Vec3::ONE],
        [Vec3::splat(f32::INFINITY), Vec3::ZERO, Vec3::ONE],
        [Vec3::ZERO; 3],
    ] {
        broken.add_mesh("broken", vec![triangle(points, grey)]);
    }
    let odd = Material {
        base_color: [nan, -1.0, 1e30, nan],
        roughness: nan,
        metallic: f32::INFINITY,
        ior: nan,
        emissive: [nan, 1e30, -5.0],
        ..Material::diffuse(Vec3::ONE)
    };
    let odd = broken.add_material("odd", odd);
    let shifted = corners.map(|p| p + Vec3::new(0.3, 0.1, 0.5));
    broken.add_mesh("odd", vec![triangle(shifted, odd)]);
    let mut only_broken = Scene::default();
    let grey = only_broken.add_material("grey", Material::diffuse(Vec3::splat(0.5)));
    only_broken.add_mesh("nothing", vec![triangle([Vec3::splat(nan); 3], grey)]);
    for (name, scene) in [
        ("empty", empty),
        ("dark", flat(&dark)),
        ("broken", flat(&broken)),
        ("only broken", flat(&only_broken)),
    ] {
        for mode in [FrameMode::Hybrid, FrameMode::Path] {
            for technique in [Technique::Raster, Technique::Rays, Technique::Auto] {
                let settings = FrameSettings {
                    size: (33, 20),
                    mode,
                    gbuffer: technique,
                    reflections: technique,
                    ambient_occlusion: technique,
                    shadows: technique,
                    quality: Quality::Fast,
                    ..Default::default()
                };
                let mut renderer = FrameRenderer::new(settings).unwrap();
                let mut history = History::new();
                for _ in 0..3 {
                    let frame = renderer.frame(&scene, &camera, &mut history).unwrap();
                    if name != "broken" {
                        let black =
                            frame.picture.to_image().pixels.iter().all(|p| *p == Vec3::ZERO);
                        assert!(black, "{name}: there is no light");
                    }
                }
            }
        }
    }
}

#[test]
fn histories_begin_anew_where_frames_do_not_follow() {
    let (scene, camera) = built_in("cornell");
    let (other, _) = zoo();
    let mut history = History::new();
    let small = FrameSettings { size: (16, 16), ..Default::default() };
    let mut renderer = FrameRenderer::new(small).unwrap();
    let frame = |renderer: &mut FrameRenderer, scene: &Arc<FlatScene>, history: &mut History| {
        let frame = renderer.frame(scene, &camera, history).unwrap();
        let picture = frame.picture.to_image();
        (picture, history.frames())
    };
    let first = frame(&mut renderer, &scene, &mut history);
    assert_eq!(first.1, 1);
    assert_eq!(frame(&mut renderer, &scene, &mut history).1, 2);
    // A cut.
    history.reset();
    assert_eq!(history.frames(), 0);
    assert!(frame(&mut renderer, &scene, &mut history) == first);
    // Another scene.
    assert_eq!(frame(&mut renderer, &other, &mut history).1, 1);
    assert_eq!(frame(&mut renderer, &other, &mut history).1, 2);
    assert!(frame(&mut renderer, &scene, &mut history) == first);
    // Another size.
    renderer.set_settings(FrameSettings { size: (20, 10), ..small }).unwrap();
    assert_eq!(frame(&mut renderer, &scene, &mut history).1, 1);
    renderer.set_settings(small).unwrap();
    assert!(frame(&mut renderer, &scene, &mut history) == first);
}

#[test]
fn the_hybrid_frame_takes_about_two_and_a_quarter_rays_a_pixel() {
    let (scene, camera) = built_in("city");
    let settings = FrameSettings { size: (96, 64), ..Default::default() };
    let mut renderer = FrameRenderer::new(settings).unwrap();
    let frame = renderer.frame(&scene, &camera, &mut History::new()).unwrap();
    let secondary: u64 =
        frame.passes.iter().filter(|p| p.name != "visibility").map(|p| p.rays.total()).sum();
    let rays = frame.rays();
    assert_eq!(rays.camera, 96 * 64);
    assert_eq!(secondary, rays.shadow + rays.indirect);
    assert!(rays.shadow > rays.indirect && rays.indirect > 0);
    let per_pixel = secondary as f64 / (96.0 * 64.0);
    assert!((0.5..=2.25).contains(&per_pixel), "{per_pixel}");
    let names: Vec<&str> = frame.passes.iter().map(|pass| pass.name).collect();
    for name in [
        "visibility",
        "gbuffer",
        "direct",
        "polygon_lights",
        "reflections",
        "indirect",
        "ambient_occlusion",
        "transparency",
        "composite",
    ] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
    assert!(frame.passes.iter().all(|pass| pass.seconds >= 0.0));
}
