//! Motion vectors against projected positions.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use rayburst_accel::BuildOptions;
use rayburst_render::realtime::{FrameRenderer, FrameSettings, FrameView, History};
use rayburst_scene::{Camera, FlatScene, Flattener, Pose, import};

use crate::scenes::built_in;

/// The largest error of the motion of a second frame after a first one, in pixels, and how many pixels move.
fn error(
    before: (&Arc<FlatScene>, Camera),
    now: (&Arc<FlatScene>, Camera),
    size: (u32, u32),
) -> (f32, u32) {
    let settings = FrameSettings { size, jitter: false, ..Default::default() };
    let mut renderer = FrameRenderer::new(settings).unwrap();
    let mut history = History::new();
    renderer.frame(before.0, &before.1, &mut history).unwrap();
    let old_view = FrameView::new(before.1, size, Vec2::ZERO);
    let frame = renderer.frame(now.0, &now.1, &mut history).unwrap();
    let (mut worst, mut moving) = (0.0f32, 0);
    for y in 0..size.1 {
        for x in 0..size.0 {
            let hit = frame.gbuffer.hits[(y * size.0 + x) as usize];
            if !hit.is_hit() {
                continue;
            }
            // The same point of the same triangle, by its corners in f64.
            let point = |scene: &FlatScene| {
                let points = scene.world_triangle(hit.instance, hit.geometry, hit.primitive).points;
                let [a, b, c] = points.map(|p| p.as_dvec3());
                let (u, v) = (f64::from(hit.u), f64::from(hit.v));
                ((1.0 - u - v) * a + u * b + v * c).as_vec3()
            };
            let (Some(old), Some(new)) =
                (old_view.project(point(before.0)), frame.view.project(point(now.0)))
            else {
                continue;
            };
            let [mx, my] = &frame.gbuffer.motion;
            let motion = Vec2::new(mx.get(x, y), my.get(x, y));
            worst = worst.max((motion - (old - new)).length());
            moving += u32::from(motion.length() > 0.05);
        }
    }
    (worst, moving)
}

#[test]
fn a_moving_camera_moves_every_pixel() {
    let (scene, camera) = built_in("cornell");
    let turned = Camera {
        transform: Affine3A::from_translation(Vec3::new(0.01, 0.005, 0.02)) * camera.transform,
        ..camera
    };
    let (worst, moving) = error((&scene, camera), (&scene, turned), (64, 64));
    assert!(worst < 0.02 && moving > 2000, "{worst}, {moving}");
    let (worst, moving) = error((&scene, camera), (&scene, camera), (64, 64));
    assert_eq!((worst, moving), (0.0, 0));
}

#[test]
fn skins_morphs_and_nodes_move_their_pixels() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    for file in ["cesium_man/CesiumMan.glb", "fox/Fox.glb", "littlest_tokyo/LittlestTokyo.glb"] {
        let path = std::path::Path::new(folder).join(file);
        if !path.is_file() {
            eprintln!("skipped: {} is not there", path.display());
            continue;
        }
        let scene = import::load(&path, &Default::default()).unwrap();
        let animations = scene.default_animations();
        let mut flattener = Flattener::new(&scene, BuildOptions::default());
        let mut at =
            |time: f32| Arc::new(flattener.at(&Pose::at(&scene, &animations, time)).unwrap());
        let (before, now) = (at(0.3), at(0.35));
        let camera = rayburst_scene::framing::default_view(&now.bounds, 1.0).camera;
        let (worst, moving) = error((&before, camera), (&now, camera), (96, 96));
        assert!(worst < 0.05 && moving > 20, "{file}: {worst}, {moving}");
    }
}
