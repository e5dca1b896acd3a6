//! Rasterised primary hits against traced ones: built-in scenes, and every real scene that is here.

#![allow(clippy::print_stdout, reason = "what is skipped and how much differs is said")]

use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};
use rayburst_accel::{BuildOptions, IsaLevel};
use rayburst_math::{Hit, hash};
use rayburst_render::realtime::{FrameView, PrimaryRaster, rasterise, trace_primary};
use rayburst_scene::{
    Camera, FlatScene, Flattener, Pose, Projection,
    import::{LoadOptions, load},
};

use crate::scenes::{built_in, zoo};

const SIZE: (u32, u32) = (320, 180);

/// What a hit is of.
fn ids(hit: &Hit) -> [u32; 3] {
    [hit.instance, hit.geometry, hit.primitive]
}

/// Whether a triangle's edge passes a pixel's centre within a hundredth of a pixel.
fn is_at_edge(scene: &FlatScene, camera: &Camera, jitter: Vec2, hit: &Hit, pixel: Vec2) -> bool {
    if !hit.is_hit() {
        return false;
    }
    let points = scene.world_triangle(hit.instance, hit.geometry, hit.primitive).points;
    let [r, u, v] = camera.frame().map(|axis| axis.as_dvec3());
    let (half, parallel) = match camera.projection {
        Projection::Perspective { fov } => (f64::from((0.5 * fov).tan()), false),
        Projection::Orthographic { half_height } => (f64::from(half_height), true),
    };
    let scale = 0.5 * f64::from(SIZE.1) / half;
    let corners = points.map(|p| {
        let d = p.as_dvec3() - camera.eye().as_dvec3();
        let w = if parallel { 1.0 } else { d.dot(v) };
        let centre = 0.5 * Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
        let off = (centre - pixel - jitter).as_dvec2() * w;
        glam::DVec3::new(d.dot(r) * scale + off.x, -d.dot(u) * scale + off.y, w)
    });
    (0..3).any(|i| {
        let edge = corners[i].cross(corners[(i + 1) % 3]);
        edge.z.abs() <= 1e-2 * edge.truncate().length()
    })
}

/// Both ways from one view; asserts what must hold and returns how many pixels differ.
fn compare(
    name: &str,
    raster: &mut PrimaryRaster,
    scene: &FlatScene,
    camera: &Camera,
    jitter: Vec2,
) -> usize {
    let keys: Vec<u32> = (0..SIZE.0 * SIZE.1).map(|i| hash::words(&[7, i])).collect();
    let (mut drawn, mut traced) = (Vec::new(), Vec::new());
    let view = FrameView::new(*camera, SIZE, jitter);
    rasterise(raster, scene, &view, &keys, &mut drawn).expect("draws");
    trace_primary(scene, &view, &keys, &mut traced);
    assert_eq!((drawn.len(), traced.len()), (57_600, 57_600));
    let at = |x: u32, y: u32| (y * SIZE.0 + x) as usize;
    let mut differ = 0;
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let (a, b) = (&drawn[at(x, y)], &traced[at(x, y)]);
            if ids(a) == ids(b) {
                assert_eq!(a, b, "{name}: not the values of the ray");
                continue;
            }
            differ += 1;
            let near = |other: &[Hit], id: [u32; 3]| {
                let columns = || x.saturating_sub(1)..(x + 2).min(SIZE.0);
                let rows = y.saturating_sub(1)..(y + 2).min(SIZE.1);
                rows.flat_map(|y| columns().map(move |x| (x, y)))
                    .any(|(x, y)| ids(&other[at(x, y)]) == id)
            };
            let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            // Surfaces that lie in each other are as deep but for rounding.
            let as_deep = (a.t - b.t).abs() <= 1e-5 * a.t;
            assert!(
                near(&traced, ids(a))
                    || near(&drawn, ids(b))
                    || as_deep
                    || is_at_edge(scene, camera, jitter, a, pixel)
                    || is_at_edge(scene, camera, jitter, b, pixel),
                "{name} ({x}, {y}): {a:?} {b:?}"
            );
        }
    }
    differ
}

/// Cameras of a scene, or one that sees all of it.
fn cameras(scene: &rayburst_scene::Scene, flat: &FlatScene) -> Vec<Camera> {
    let mut cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    cameras.truncate(2);
    let bounds = flat.bounds;
    let eye = bounds.centre() + 0.9 * bounds.diagonal() * Vec3::new(0.4, 0.35, 0.85);
    cameras.push(Camera::look_at(eye, bounds.centre(), Vec3::Y, 0.8));
    cameras
}

#[test]
fn rasterised_hits_are_those_of_rays() {
    let scenes = ["cornell", "city", "stadium", "spheres", "hairball"];
    let mut raster = PrimaryRaster::new(IsaLevel::from_environment().expect("known"));
    let mut compared = 0;
    let named = scenes.iter().filter_map(|name| {
        let known = rayburst_scene::builtin::build(name).is_ok();
        known.then(|| (*name, built_in(name)))
    });
    for (name, (scene, camera)) in named.chain([("zoo", zoo())]) {
        let parallel = Camera {
            projection: Projection::Orthographic { half_height: 0.3 * scene.bounds.diagonal() },
            ..camera
        };
        for camera in [camera, parallel] {
            for jitter in [Vec2::ZERO, Vec2::new(0.31, -0.47)] {
                let differ = compare(name, &mut raster, &scene, &camera, jitter);
                assert!(differ * 1000 < 57_600, "{name}: {differ} pixels differ");
                compared += 1;
            }
        }
    }
    assert!(compared >= 16, "{compared}");
}

#[test]
fn moving_cameras_and_changing_scenes_are_followed() {
    let mut raster = PrimaryRaster::new(IsaLevel::detect());
    let (zoo, camera) = zoo();
    let (cornell, other) = built_in("cornell");
    for frame in 0..6 {
        let mut moved = camera;
        moved.transform.translation.x += 0.3 * frame as f32;
        compare("zoo", &mut raster, &zoo, &moved, Vec2::ZERO);
        if frame % 3 == 2 {
            compare("cornell", &mut raster, &cornell, &other, Vec2::ZERO);
        }
    }
    // Nothing to draw on is refused or empty.
    let mut hits = vec![Hit::MISS; 3];
    assert!(
        rasterise(&mut raster, &zoo, &FrameView::new(camera, (0, 4), Vec2::ZERO), &[], &mut hits)
            .is_err()
    );
    trace_primary(&zoo, &FrameView::new(camera, (0, 4), Vec2::ZERO), &[], &mut hits);
    assert!(hits.is_empty());
    // Missing keys are zeros, for both.
    let (mut drawn, mut traced) = (Vec::new(), Vec::new());
    rasterise(&mut raster, &zoo, &FrameView::new(camera, (40, 30), Vec2::ZERO), &[1], &mut drawn)
        .expect("draws");
    trace_primary(&zoo, &FrameView::new(camera, (40, 30), Vec2::ZERO), &[1], &mut traced);
    let same = drawn.iter().zip(&traced).filter(|(a, b)| a == b).count();
    assert!(same >= 1195, "{same}");
}

#[test]
fn hits_depend_neither_on_threads_nor_on_instruction_sets() {
    let (scene, camera) = zoo();
    let keys: Vec<u32> = (0..SIZE.0 * SIZE.1).collect();
    let mut expected = Vec::new();
    let mut first = PrimaryRaster::new(IsaLevel::detect());
    rasterise(&mut first, &scene, &FrameView::new(camera, SIZE, Vec2::ZERO), &keys, &mut expected)
        .expect("draws");
    for level in IsaLevel::available() {
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
            let hits = pool.install(|| {
                let (mut raster, mut hits) = (PrimaryRaster::new(level), Vec::new());
                rasterise(
                    &mut raster,
                    &scene,
                    &FrameView::new(camera, SIZE, Vec2::ZERO),
                    &keys,
                    &mut hits,
                )
                .expect("draws");
                hits
            });
            assert!(hits == expected, "{} {threads}", level.name());
        }
    }
}

/// All files that may be scenes, by name.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            files(&path, found);
        } else if let Some("gltf" | "glb" | "obj" | "ply") =
            path.extension().and_then(|e| e.to_str())
        {
            found.push(path);
        }
    }
}

#[test]
fn real_scenes_are_rasterised_as_they_are_traced() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes"));
    if !root.is_dir() {
        println!("skipped: the scenes are not here");
        return;
    }
    let mut paths = Vec::new();
    files(root, &mut paths);
    let mut compared = 0;
    for path in paths {
        let name = path.strip_prefix(root).expect("inside").display().to_string();
        let scene = match load(&path, &LoadOptions::default()) {
            Ok(scene) => scene,
            Err(error) => {
                println!("{name} is left out: {error}");
                continue;
            }
        };
        let mut flattener = Flattener::new(&scene, BuildOptions::default());
        let mut raster = PrimaryRaster::new(IsaLevel::from_environment().expect("known"));
        let moves = !scene.animations.is_empty();
        for time in if moves { &[0.0, 0.4][..] } else { &[0.0] } {
            let pose = if moves { Pose::at(&scene, &[0], *time) } else { Pose::rest(&scene) };
            let flat = flattener.at(&pose).expect("flattens");
            for camera in cameras(&scene, &flat) {
                let jitter = Vec2::new(0.13, -0.29);
                let differ = compare(&name, &mut raster, &flat, &camera, jitter);
                println!("{name}: {differ} of 57600 pixels differ");
                assert!(differ * 1000 < 57_600, "{name}: {differ} pixels differ");
                compared += 1;
            }
        }
    }
    assert!(compared > 20, "{compared}");
}
