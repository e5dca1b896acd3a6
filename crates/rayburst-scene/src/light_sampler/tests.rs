//! Sampled light against traced light, in small scenes.

use std::sync::Arc;

use rayburst_accel::{AcceptAll, BuildOptions, TraceOptions};
use rayburst_image::{MipMap, TexelFormat, Texels};
use rayburst_math::{Ray, hash::Rng, warp};
use rayburst_testkit::statistics::{Moments, test_directions};

use super::*;
use crate::{
    Environment, Flattener, Footprint, Light, Pose, Primitive, Scene, ShadingOptions, Texture,
    TextureSlot, environment::EnvironmentMap,
};

/// A quad of two triangles, its front on the side from which the corners go counter-clockwise.
fn quad(corners: [Vec3; 4], material: u32) -> Primitive {
    Primitive {
        positions: corners.to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        uvs: vec![vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]],
        material,
        ..Primitive::default()
    }
}

fn flatten(scene: &Scene) -> FlatScene {
    Flattener::new(scene, BuildOptions::default()).at(&Pose::rest(scene)).unwrap()
}

/// Lamps of several kinds around the origin, none in front of another.
fn lamps() -> FlatScene {
    let mut scene = Scene::default();
    let one_sided = |radiance| Material { flags: 0, ..Material::emitter(radiance) };
    let ceiling = scene.add_material("ceiling", one_sided(Vec3::new(5.0, 4.0, 3.0)));
    let wall = scene.add_material("wall", Material::emitter(Vec3::splat(2.0)));
    let texels = Texels { width: 2, height: 1, channels: 3, data: vec![255, 255, 255, 30, 30, 30] };
    scene.images.push(Arc::new(MipMap::new(texels, TexelFormat::Srgb)));
    scene.textures.push(Texture::new(0));
    let textured =
        Material { emissive_texture: TextureSlot::new(0), ..one_sided(Vec3::splat(20.0)) };
    let textured = scene.add_material("textured", textured);
    let up = |x: f32, z: f32| Vec3::new(x, 1.5, z);
    scene.add_mesh(
        "lamps",
        vec![
            quad([up(-1.0, -1.0), up(1.0, -1.0), up(1.0, 1.0), up(-1.0, 1.0)], ceiling),
            quad(
                [
                    Vec3::new(2.0, -1.0, -0.5),
                    Vec3::new(2.0, 0.5, -0.5),
                    Vec3::new(2.0, 0.5, 0.8),
                    Vec3::new(2.0, -1.0, 0.8),
                ],
                wall,
            ),
            quad(
                [
                    Vec3::new(-1.0, -0.8, 3.0),
                    Vec3::new(-1.0, 0.8, 3.0),
                    Vec3::new(1.0, 0.8, 3.0),
                    Vec3::new(1.0, -0.8, 3.0),
                ],
                textured,
            ),
        ],
    );
    // A mirrored, scaled instance of a small lamp.
    let node = scene.add_mesh(
        "small",
        vec![quad(
            [
                Vec3::new(-0.4, -1.0, -0.4),
                Vec3::new(-0.4, -1.0, 0.4),
                Vec3::new(0.4, -1.0, 0.4),
                Vec3::new(0.4, -1.0, -0.4),
            ],
            ceiling,
        )],
    );
    let mirrored = glam::Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.5));
    scene.nodes[node as usize].instances =
        vec![mirrored, glam::Affine3A::from_translation(Vec3::new(-3.0, 0.2, 0.0))];
    let texels: Vec<Vec3> = (0..32 * 16).map(|i| Vec3::splat((i % 7) as f32 * 0.3)).collect();
    scene.environment = Some(Environment::Map(EnvironmentMap {
        texels: texels.into(),
        size: (32, 16),
        rotation: 0.5,
        intensity: 1.0,
    }));
    flatten(&scene)
}

fn trace(scene: &FlatScene, direction: Vec3) -> Hit {
    let ray = Ray::new(Vec3::ZERO, direction);
    scene.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll)
}

/// Radiance from a direction and the density with which the sampler finds it.
fn seen(scene: &FlatScene, lights: &LightSampler, direction: Vec3) -> (Vec3, f32) {
    let hit = trace(scene, direction);
    if hit.is_hit() {
        let surface = scene.surface(&hit);
        let point =
            scene.shading_point(&surface, -direction, Footprint::NONE, &ShadingOptions::default());
        (point.emitted, lights.emitter_pdf(scene, &hit, Vec3::ZERO, direction))
    } else {
        (scene.environment.radiance(direction), lights.environment_pdf(scene, direction))
    }
}

#[test]
fn samples_agree_with_what_rays_meet() {
    let scene = lamps();
    let lights = LightSampler::new(&scene);
    let mut rng = Rng::new(31);
    let (mut surfaces, mut hidden, mut edges) = (0, 0, 0);
    for _ in 0..20_000 {
        let choice = rng.f32();
        let Some(s) = lights.sample_from(&scene, Vec3::ZERO, choice, rng.vec2()) else { continue };
        let hit = trace(&scene, s.direction);
        if s.distance.is_infinite() {
            // The environment behind a lamp is sampled, too.
            hidden += u32::from(hit.is_hit());
            continue;
        }
        surfaces += 1;
        if !hit.is_hit() {
            edges += 1;
            continue;
        }
        assert!(s.distance < hit.t && s.distance > 0.999 * hit.t, "{s:?} {hit:?}");
        let (radiance, pdf) = seen(&scene, &lights, s.direction);
        assert!(
            (radiance - s.radiance).abs().max_element() < 0.02 * radiance.max_element().max(1.0)
        );
        // A ray to a point of an edge may meet the neighbour, or nothing.
        edges += u32::from((pdf / s.pdf - 1.0).abs() > 0.01);
    }
    assert!(surfaces > 5000 && hidden > 100 && edges < 10, "{surfaces} {hidden} {edges}");
}

#[test]
fn direct_light_equals_that_of_uniform_directions() {
    let scene = lamps();
    let lights = LightSampler::new(&scene);
    let mut rng = Rng::new(32);
    let sampled = Moments::of((0..60_000).map(|_| {
        let choice = rng.f32();
        let Some(s) = lights.sample_from(&scene, Vec3::ZERO, choice, rng.vec2()) else {
            return 0.0;
        };
        let blocked = trace(&scene, s.direction).t < s.distance;
        if blocked { 0.0 } else { f64::from(luminance(s.radiance) / s.pdf) }
    }));
    let uniform = Moments::of((0..200_000).map(|_| {
        let (radiance, _) = seen(&scene, &lights, warp::uniform_sphere(rng.vec2()));
        f64::from(luminance(radiance) * 4.0 * PI)
    }));
    let error = sampled.standard_error().hypot(uniform.standard_error());
    assert!((sampled.mean - uniform.mean).abs() < 4.5 * error, "{sampled:?} {uniform:?}");
}

#[test]
fn directions_follow_their_density() {
    let mut scene = lamps();
    scene.environment = Environment::None;
    let lights = LightSampler::new(&scene);
    let test = test_directions(
        200_000,
        33,
        |rng| {
            let choice = rng.f32();
            lights.sample_from(&scene, Vec3::ZERO, choice, rng.vec2()).map(|s| s.direction)
        },
        |d| seen(&scene, &lights, d).1,
    );
    // Edges of lamps cut through the bins of the test, whose expectations are then a little off.
    assert!(test.statistic < 1.6 * test.degrees as f64, "{test:?}");
}

#[test]
fn backs_of_one_sided_lamps_are_dark() {
    let mut scene = Scene::default();
    let lamp = Material { flags: 0, ..Material::emitter(Vec3::ONE) };
    let lamp = scene.add_material("lamp", lamp);
    let up = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    scene.add_mesh(
        "lamp",
        vec![quad([up(-1.0, 1.0), up(1.0, 1.0), up(1.0, -1.0), up(-1.0, -1.0)], lamp)],
    );
    let scene = flatten(&scene);
    let lights = LightSampler::new(&scene);
    let mut rng = Rng::new(1);
    for _ in 0..100 {
        let choice = rng.f32();
        assert_eq!(lights.sample_from(&scene, Vec3::ZERO, choice, rng.vec2()), None);
        let above = lights.sample_from(&scene, Vec3::Y * 2.0, choice, rng.vec2()).unwrap();
        assert!(above.direction.y < 0.0);
    }
    let (radiance, pdf) = seen(&scene, &lights, Vec3::Y);
    assert_eq!((radiance, pdf), (Vec3::ZERO, 0.0));
}

#[test]
fn thin_lamps_shine_by_their_coverage() {
    let mut scene = Scene::default();
    let lamp = Material {
        base_color: [0.0, 0.0, 0.0, 0.25],
        alpha_mode: crate::AlphaMode::Blend as u32,
        ..Material::emitter(Vec3::splat(8.0))
    };
    scene.add_material("lamp", lamp);
    let up = |x: f32, z: f32| Vec3::new(x, 1.0, z);
    scene.add_mesh(
        "lamp",
        vec![quad([up(-1.0, 1.0), up(1.0, 1.0), up(1.0, -1.0), up(-1.0, -1.0)], 0)],
    );
    let scene = flatten(&scene);
    let lights = LightSampler::new(&scene);
    let sample = lights.sample_from(&scene, Vec3::ZERO, 0.3, Vec2::splat(0.4)).unwrap();
    assert_eq!(sample.radiance, Vec3::splat(2.0));
}

#[test]
fn every_kind_of_light_has_its_share() {
    let mut scene = lamps();
    scene.lights = vec![
        Light {
            intensity: Vec3::splat(1e5),
            kind: LightKind::Directional { direction: -Vec3::Y, angular_radius: 0.004_65 },
        },
        Light { intensity: Vec3::ONE, kind: LightKind::Point { position: Vec3::splat(0.5) } },
    ];
    let lights = LightSampler::new(&scene);
    let mut rng = Rng::new(2);
    let (mut sun, mut point, mut lamp, mut sky) = (0, 0, 0, 0);
    for _ in 0..10_000 {
        let choice = rng.f32();
        match lights.sample_from(&scene, Vec3::ZERO, choice, rng.vec2()) {
            Some(s) if s.delta && s.distance.is_infinite() => sun += 1,
            Some(s) if s.delta => point += 1,
            Some(s) if s.distance.is_infinite() => sky += 1,
            Some(_) => lamp += 1,
            None => {}
        }
    }
    assert!(sun > 5000 && sky > 1500 && lamp > 500 && point > 5, "{sun} {sky} {lamp} {point}");
    assert!(lights.sun_radiance(&scene, Vec3::Y).x > 1e9);
    assert_eq!(lights.sun_radiance(&scene, Vec3::X), Vec3::ZERO);
}

#[test]
fn dark_scenes_have_nothing_to_sample() {
    let scene = flatten(&Scene::default());
    let lights = LightSampler::new(&scene);
    assert!(lights.is_empty());
    assert_eq!(lights.sample_from(&scene, Vec3::ZERO, 0.5, Vec2::splat(0.5)), None);
    assert_eq!(lights.environment_pdf(&scene, Vec3::Y), 0.0);
}
