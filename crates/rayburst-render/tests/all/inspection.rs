//! Inspection views and AOVs.

use glam::{Vec2, Vec3};
use rayburst_accel::{AcceptAll, TraceOptions};
use rayburst_render::{Aov, Display, IntegratorKind, View, false_colours};

use crate::scenes::{picture, pixel_centre, render, settings, zoo};

const SIZE: (u32, u32) = (32, 24);

#[test]
fn views_and_aovs_show_the_first_hit() {
    let (scene, camera) = zoo();
    let mut settings = settings(SIZE, 1);
    settings.filter_radius = Some(1e-4);
    settings.aovs = Aov::ALL.map(|(_, aov)| aov).to_vec();
    let view = |view: View| {
        let mut settings = settings.clone();
        settings.integrator = IntegratorKind::Inspect(view);
        render(&scene, camera, &settings)
    };
    let depth = view(View::Depth);
    let normals = view(View::GeometricNormal).picture();
    let layers = depth.layers(false);
    let (mut hits, mut misses) = (0, 0);
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let (ray, _) = camera.ray(pixel_centre(x, y), SIZE, Vec2::ZERO);
            let hit = scene.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
            let i = (y * SIZE.0 + x) as usize;
            let value = |layer: &str, channel: &str| {
                layers.layer(layer).unwrap().channel(channel).unwrap()[i]
            };
            if !hit.is_hit() {
                misses += 1;
                assert_eq!(value("depth", "Z"), 0.0);
                assert_eq!(value("instance", "id"), -1.0);
                continue;
            }
            let surface = scene.surface(&hit);
            if value("material", "id") != surface.material as f32 {
                continue; // Through the veil, or just across an edge.
            }
            hits += 1;
            assert!((value("depth", "Z") - hit.t).abs() < 2e-3 * hit.t);
            assert_eq!(value("instance", "id"), surface.node as f32);
            let n = 2.0 * normals.get(x, y) - 1.0;
            assert!(n.dot(ray.direction) < 1e-6);
            let p =
                Vec3::new(value("position", "X"), value("position", "Y"), value("position", "Z"));
            assert!((p - surface.position).length() < 5e-3 * hit.t);
        }
    }
    assert!(hits > 300 && misses > 50, "{hits} {misses}");
}

#[test]
fn the_path_tracer_collects_the_same_aovs() {
    let (scene, camera) = zoo();
    let mut settings = settings(SIZE, 4);
    settings.aovs = Aov::ALL.map(|(_, aov)| aov).to_vec();
    let path = render(&scene, camera, &settings).layers(false);
    settings.integrator = IntegratorKind::Inspect(View::Albedo);
    let inspected = render(&scene, camera, &settings).layers(false);
    for layer in ["albedo", "normal", "depth", "position", "instance", "material"] {
        assert_eq!(path.layer(layer), inspected.layer(layer), "{layer}");
    }
    let variance = path.layer("variance").unwrap().channel("Y").unwrap();
    assert!(variance.iter().all(|v| v.is_finite() && *v >= 0.0));
    assert!(variance.iter().any(|v| *v > 0.0));
}

#[test]
fn nodes_visited_are_few_but_some() {
    let (scene, camera) = zoo();
    let mut settings = settings(SIZE, 1);
    settings.integrator = IntegratorKind::Inspect(View::NodesVisited);
    assert_eq!(settings.integrator.display(), Display::Amounts);
    let nodes = picture(&scene, camera, &settings);
    let total: usize = scene.tlas.stats().nodes
        + scene.tlas.blases().iter().map(|b| b.stats().nodes).sum::<usize>();
    let most = nodes.pixels.iter().map(|p| p.x).fold(0.0, f32::max);
    assert!(most >= 2.0 && most <= total as f32, "{most} of {total}");
    let mean = nodes.pixels.iter().map(|p| p.x).sum::<f32>() / nodes.pixels.len() as f32;
    assert!(mean < 0.5 * total as f32, "{mean} of {total}");
    let (shown, top) = false_colours(&nodes);
    assert!(top > 0.0 && shown.pixels.iter().all(|p| p.max_element() <= 1.0));
}
