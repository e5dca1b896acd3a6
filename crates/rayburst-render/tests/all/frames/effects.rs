//! Single passes against closed forms.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;
use rayburst_image::RgbImage;
use rayburst_render::realtime::{
    FrameMode, FrameRenderer, FrameSettings, History, Passes, PixelKind, Technique,
};
use rayburst_scene::{Camera, Light, LightKind, Material, Scene, shapes::Shape};

use super::{channels, mean_of, mean_of_frames};
use crate::scenes::{flat, floor};

fn quad(corners: [[f32; 3]; 4]) -> Shape {
    let mut shape = Shape::default();
    shape.add_quad(corners.map(Vec3::from_array));
    shape
}

/// A floor and whatever else, seen from above.
fn over_a_floor(parts: Vec<(Shape, Material)>) -> Scene {
    let mut scene = Scene::default();
    let grey = scene.add_material("grey", Material::diffuse(Vec3::splat(0.5)));
    scene.add_mesh("floor", vec![floor(20.0, 0.0).into_primitive(grey)]);
    for (shape, material) in parts {
        let material = scene.add_material("part", material);
        scene.add_mesh("part", vec![shape.into_primitive(material)]);
    }
    scene
}

fn lamp(y: f32) -> (Shape, Material) {
    let shape = quad([[-1.0, y, -1.0], [1.0, y, -1.0], [1.0, y, 1.0], [-1.0, y, 1.0]]);
    (shape, Material { flags: 0, ..Material::emitter(Vec3::splat(10.0)) })
}

#[test]
fn light_without_occluders_has_no_noise() {
    let scene = flat(&over_a_floor(vec![lamp(2.0)]));
    let camera = Camera::look_at(Vec3::new(3.0, 1.5, 0.0), Vec3::ZERO, Vec3::Y, 0.8);
    let settings =
        FrameSettings { size: (40, 24), jitter: false, max_depth: 2, ..Default::default() };
    let mut renderer = FrameRenderer::new(settings).unwrap();
    let mut history = History::new();
    let mut first: Option<RgbImage> = None;
    for _ in 0..4 {
        let frame = renderer.frame(&scene, &camera, &mut history).unwrap();
        for y in 0..24 {
            assert!(frame.signals.shadow.row(y).iter().all(|&share| share == 1.0));
        }
        let analytic = frame.signals.analytic_diffuse.to_image();
        assert!(channels(&analytic).x > 0.1);
        assert_eq!(first.get_or_insert_with(|| analytic.clone()), &analytic);
    }
    // And it is what sampling finds.
    let sampled = FrameSettings { mode: FrameMode::Path, ..settings };
    let a = channels(&mean_of_frames(&scene, camera, &settings, 8));
    let b = channels(&mean_of_frames(&scene, camera, &sampled, 256));
    assert!(((a - b) / b).abs().max_element() < 0.01, "{a} {b}");
}

#[test]
fn light_with_occluders_is_right_on_average() {
    let blocker = quad([[-0.4, 1.0, -0.4], [-0.4, 1.0, 0.4], [0.4, 1.0, 0.4], [0.4, 1.0, -0.4]]);
    let parts = vec![lamp(2.0), (blocker, Material::diffuse(Vec3::ZERO))];
    let scene = flat(&over_a_floor(parts));
    let camera = Camera::look_at(Vec3::new(3.0, 2.5, 0.0), Vec3::ZERO, Vec3::Y, 0.8);
    let settings = FrameSettings { size: (40, 24), max_depth: 2, ..Default::default() };
    let sampled = FrameSettings { mode: FrameMode::Path, ..settings };
    let a = channels(&mean_of_frames(&scene, camera, &settings, 128));
    let b = channels(&mean_of_frames(&scene, camera, &sampled, 256));
    assert!(((a - b) / b).abs().max_element() < 0.02, "{a} {b}");
}

#[test]
fn ambient_occlusion_of_a_wedge() {
    // A wall of height h along x = 0: a point of the floor at the distance d sees ½(1 + d/√(d² + h²)).
    let wall = quad([[0.0, 0.0, -20.0], [0.0, 0.0, 20.0], [0.0, 2.0, 20.0], [0.0, 2.0, -20.0]]);
    let scene = flat(&over_a_floor(vec![(wall, Material::diffuse(Vec3::splat(0.5)))]));
    for (d, by_rays) in [(0.3f32, true), (1.0, true), (3.0, true), (1.0, false)] {
        let at = Vec3::new(d, 0.0, 0.0);
        let camera = Camera::look_at(at + Vec3::new(4.0, 4.0, 0.0), at, Vec3::Y, 1.0);
        let technique = if by_rays { Technique::Rays } else { Technique::Raster };
        let settings = FrameSettings {
            size: (63, 63),
            jitter: false,
            ao_radius: Some(50.0),
            ambient_occlusion: technique,
            ..Default::default()
        };
        let frames = if by_rays { 256 } else { 16 };
        let picture = mean_of(&scene, camera, &settings, frames, |frame| {
            RgbImage::from_fn(63, 63, |x, y| Vec3::splat(frame.signals.ambient_occlusion.get(x, y)))
        });
        let mut sum = 0.0;
        for y in 29..34 {
            for x in 29..34 {
                sum += picture.get(x, y).x / 25.0;
            }
        }
        let expected = 0.5 * (1.0 + d / (d * d + 4.0f32).sqrt());
        // What is off screen is open to the depth buffer.
        let bound = if by_rays { 0.02 } else { 0.12 };
        assert!((sum - expected).abs() < bound, "{technique:?} at {d}: {sum}, not {expected}");
    }
}

#[test]
fn penumbras_are_as_wide_as_the_sun_makes_them() {
    // The edge of a roof at height h: from full light to none over h·2·tan(r).
    let (height, radius) = (3.0f32, 0.1f32);
    let roof = quad([
        [-90.0, height, -90.0],
        [-90.0, height, 7.0],
        [0.0, height, 7.0],
        [0.0, height, -90.0],
    ]);
    let mut scene = over_a_floor(vec![(roof, Material::diffuse(Vec3::ZERO))]);
    let kind = LightKind::Directional { direction: -Vec3::Y, angular_radius: radius };
    scene.world_lights.push(Light { intensity: Vec3::ONE, kind });
    let scene = flat(&scene);
    // Looks under the roof from the side.
    let camera = Camera::look_at(Vec3::new(0.0, 1.5, 8.0), Vec3::new(0.0, 0.0, 1.0), Vec3::Y, 0.5);
    let settings = FrameSettings { size: (128, 16), max_depth: 2, ..Default::default() };
    let settings = FrameSettings { jitter: false, ..settings };
    let mut renderer = FrameRenderer::new(settings).unwrap();
    let mut history = History::new();
    let (mut light, mut place) = (vec![0.0f32; 128], vec![0.0f32; 128]);
    for _ in 0..512 {
        let frame = renderer.frame(&scene, &camera, &mut history).unwrap();
        for x in 0..128 {
            assert_eq!(frame.gbuffer.kind_at(x, 10), PixelKind::Surface);
            light[x as usize] += frame.signals.direct_diffuse.get(x, 10).x / 512.0;
            place[x as usize] = frame.gbuffer.position.get(x, 10).x;
        }
    }
    let full = light.iter().copied().fold(0.0, f32::max);
    // A disc that is cut by an edge at the part t of its radius.
    let reach = height * radius.tan();
    for (x, light) in place.iter().zip(&light) {
        let t = (x / reach).clamp(-1.0, 1.0);
        let share = 0.5 + (t * (1.0 - t * t).sqrt() + t.asin()) / std::f32::consts::PI;
        assert!((light / full - share).abs() < 0.06, "{x}: {} not {share}", light / full);
    }
    assert!(place.iter().any(|x| x.abs() < 0.3 * reach) && FRAC_PI_2 > reach);
}

#[test]
fn rays_see_what_is_off_the_screen_and_screen_space_does_not() {
    // A mirror floor, and a lamp overhead that the camera does not see.
    let mut scene = Scene::default();
    let shiny = Material { metallic: 1.0, roughness: 0.1, ..Material::diffuse(Vec3::splat(0.9)) };
    let shiny = Material { ior: 1.5, ..shiny };
    let shiny = scene.add_material("shiny", shiny);
    scene.add_mesh("floor", vec![floor(20.0, 0.0).into_primitive(shiny)]);
    let (shape, material) = lamp(6.0);
    let material = scene.add_material("lamp", material);
    scene.add_mesh("lamp", vec![shape.into_primitive(material)]);
    let scene = flat(&scene);
    let camera = Camera::look_at(Vec3::new(0.0, 3.0, 6.0), Vec3::new(0.0, 0.0, 4.0), Vec3::Y, 0.5);
    // Direct light is left out, so that the lamp is found by reflections alone.
    let passes = Passes { direct: false, ..Passes::ALL };
    let reflected = |reflections| {
        let settings = FrameSettings { size: (48, 32), reflections, passes, ..Default::default() };
        let mean = mean_of(&scene, camera, &settings, 16, |frame| {
            frame.signals.indirect_specular.to_image()
        });
        channels(&mean).x
    };
    assert!(reflected(Technique::Rays) > 0.05);
    assert_eq!(reflected(Technique::Raster), 0.0);
}

#[test]
fn the_reflection_of_a_lamp_is_shared_between_passes_without_loss() {
    // Reflected lamps: by the closed form, by sampling both ways, whatever the roughness.
    for roughness in [0.05, 0.2, 0.5, 1.0] {
        let mut scene = Scene::default();
        let metal = Material { metallic: 1.0, roughness, ..Material::diffuse(Vec3::splat(0.8)) };
        let metal = scene.add_material("metal", Material { ior: 1.5, ..metal });
        scene.add_mesh("floor", vec![floor(20.0, 0.0).into_primitive(metal)]);
        let (shape, material) = lamp(3.0);
        let material = scene.add_material("lamp", material);
        scene.add_mesh("lamp", vec![shape.into_primitive(material)]);
        let scene = flat(&scene);
        let camera = Camera::look_at(Vec3::new(0.0, 3.0, 6.0), Vec3::ZERO, Vec3::Y, 0.5);
        let settings = FrameSettings { size: (48, 32), max_depth: 2, ..Default::default() };
        let path = FrameSettings { mode: FrameMode::Path, ..settings };
        let a = channels(&mean_of_frames(&scene, camera, &settings, 256)).x;
        let b = channels(&mean_of_frames(&scene, camera, &path, 256)).x;
        assert!((a / b - 1.0).abs() < 0.04, "roughness {roughness}: {a} {b}");
    }
}
