//! Scenes whose light is known in closed form.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, PI};

use glam::Vec3;
use rayburst_render::{IntegratorKind, LightSampling};
use rayburst_scene::{Camera, Environment, Light, LightKind, Material, Scene, shapes::Shape};

use crate::scenes::{flat, floor, look_at_origin, mean, picture, pixel_centre, render, settings};

#[test]
fn a_point_light_over_a_plane_follows_the_inverse_square() {
    let mut scene = Scene::default();
    let grey = scene.add_material("grey", Material::diffuse(Vec3::new(0.8, 0.5, 0.2)));
    scene.add_mesh("floor", vec![floor(10.0, 0.0).into_primitive(grey)]);
    let (position, intensity) = (Vec3::new(0.5, 1.5, -0.25), Vec3::new(10.0, 20.0, 30.0));
    scene.world_lights.push(Light { intensity, kind: LightKind::Point { position } });
    let camera = Camera::look_at(Vec3::new(0.0, 4.0, 1.0), Vec3::ZERO, Vec3::Y, 0.7);
    let scene = flat(&scene);
    for integrator in [IntegratorKind::Path, IntegratorKind::Direct, IntegratorKind::Whitted] {
        let mut settings = settings((24, 16), 1);
        settings.filter_radius = Some(1e-3);
        settings.integrator = integrator;
        let picture = picture(&scene, camera, &settings);
        for y in 0..16 {
            for x in 0..24 {
                let (ray, _) = camera.ray(pixel_centre(x, y), (24, 16), Default::default());
                let p = ray.at(-ray.origin.y / ray.direction.y);
                let to = position - p;
                let cos = to.y / to.length();
                let expected =
                    Vec3::new(0.8, 0.5, 0.2) * FRAC_1_PI * intensity * cos / to.length_squared();
                let error = (picture.get(x, y) - expected).abs() / expected;
                assert!(error.max_element() < 2e-3, "{integrator:?} ({x}, {y}): {error}");
            }
        }
    }
}

#[test]
fn a_square_light_gives_its_form_factor() {
    // A square of side 2·half, centred at height h over the point, facing down: four corner squares,
    // each with the form factor of a parallel rectangle over its corner.
    let (half, h) = (0.8f32, 1.3f32);
    let a = half / h;
    let root = (1.0 + a * a).sqrt();
    let corner = FRAC_1_PI * 0.5 * 2.0 * (a / root) * (a / root).atan();
    let expected = 0.6 * 5.0 * 4.0 * corner;
    let mut scene = Scene::default();
    let grey = scene.add_material("grey", Material::diffuse(Vec3::splat(0.6)));
    scene.add_mesh("floor", vec![floor(10.0, 0.0).into_primitive(grey)]);
    let mut light = Shape::default();
    light.add_quad([
        Vec3::new(-half, h, -half),
        Vec3::new(half, h, -half),
        Vec3::new(half, h, half),
        Vec3::new(-half, h, half),
    ]);
    let mut lamp = Material::emitter(Vec3::splat(5.0));
    lamp.flags = 0;
    let lamp = scene.add_material("lamp", lamp);
    scene.add_mesh("lamp", vec![light.into_primitive(lamp)]);
    let scene = flat(&scene);
    let camera = Camera::look_at(Vec3::new(3.0, 0.5, 0.0), Vec3::ZERO, Vec3::Y, 1e-3);
    for light_sampling in [LightSampling::Both, LightSampling::LightOnly, LightSampling::BsdfOnly] {
        let mut settings = settings((4, 4), 4096);
        settings.light_sampling = light_sampling;
        let measured = mean(&picture(&scene, camera, &settings)) as f32;
        let error = measured / expected - 1.0;
        assert!(error.abs() < 0.01, "{light_sampling:?}: {measured} instead of {expected}");
    }
}

#[test]
fn a_small_sun_gives_its_illuminance() {
    let mut scene = Scene::default();
    let grey = scene.add_material("grey", Material::diffuse(Vec3::splat(0.5)));
    scene.add_mesh("floor", vec![floor(10.0, 0.0).into_primitive(grey)]);
    let direction = Vec3::new(0.6, -0.8, 0.0);
    let kind = LightKind::Directional { direction, angular_radius: 0.005 };
    scene.world_lights.push(Light { intensity: Vec3::splat(1000.0), kind });
    let measured = mean(&picture(&flat(&scene), look_at_origin(), &settings((4, 4), 256)));
    assert!((measured / (0.5 / f64::from(PI) * 800.0) - 1.0).abs() < 0.003, "{measured}");
}

#[test]
fn a_wedge_is_open_as_far_as_its_angle_says() {
    // A plane alone is open; a wall that covers the angle θ above the horizon leaves (1 + cos θ)/2.
    let open = |wall: Option<f32>| {
        let mut scene = Scene::default();
        let grey = scene.add_material("grey", Material::diffuse(Vec3::splat(0.5)));
        let mut shape = floor(100.0, 0.0);
        if let Some(angle) = wall {
            // So close to the origin that nothing shows between.
            let foot = Vec3::new(-0.01, 0.0, 0.0);
            let wall = 100.0 * Vec3::new(-angle.cos(), angle.sin(), 0.0);
            let along = Vec3::new(0.0, 0.0, 100.0);
            shape.add_quad([foot + along, foot - along, foot - along + wall, foot + along + wall]);
        }
        scene.add_mesh("wedge", vec![shape.into_primitive(grey)]);
        let mut settings = settings((8, 8), 1024);
        settings.integrator = IntegratorKind::AmbientOcclusion;
        let camera = Camera::look_at(Vec3::new(1.0, 0.7, 0.0), Vec3::ZERO, Vec3::Y, 1e-5);
        let renderer = render(&flat(&scene), camera, &settings);
        let variance: f64 = renderer.film().variance().iter().map(|&v| f64::from(v)).sum();
        (mean(&renderer.picture()), variance.sqrt() / 64.0)
    };
    assert_eq!(open(None).0, 1.0);
    for angle in [FRAC_PI_4, 2.0 * FRAC_PI_4, 3.0 * FRAC_PI_4] {
        let (measured, sigma) = open(Some(angle));
        let expected = f64::from(0.5 * (1.0 + angle.cos()));
        assert!((measured - expected).abs() < 3.0 * sigma + 1e-3, "{angle}: {measured} {expected}");
    }
}

#[test]
fn occlusion_rays_end_at_their_radius() {
    let mut scene = Scene::default();
    let grey = scene.add_material("grey", Material::diffuse(Vec3::splat(0.5)));
    let mut shape = floor(10.0, 0.0);
    shape.append(&floor(100.0, 2.0));
    scene.add_mesh("slabs", vec![shape.into_primitive(grey)]);
    let scene = flat(&scene);
    let mut settings = settings((4, 4), 64);
    settings.integrator = IntegratorKind::AmbientOcclusion;
    for (radius, expected) in [(1.9, 1.0), (f32::INFINITY, 0.0)] {
        settings.ao_radius = radius;
        assert_eq!(mean(&picture(&scene, look_at_origin(), &settings)), expected);
    }
}

#[test]
fn two_mirrors_reflect_each_other_to_the_depth_limit() {
    // Between two mirrors that shine themselves, each further ray adds once more their radiance.
    let mut scene = Scene { environment: Some(Environment::None), ..Scene::default() };
    let shining = Material { emissive: [1.0; 3], ..Material::mirror(Vec3::splat(0.5)) };
    let mirror = scene.add_material("mirror", shining);
    let mut shape = floor(5.0, 0.0);
    shape.append(&floor(5.0, 2.0));
    scene.add_mesh("mirrors", vec![shape.into_primitive(mirror)]);
    let scene = flat(&scene);
    let camera = Camera::look_at(Vec3::Y, Vec3::new(0.001, 0.0, 0.0), Vec3::Z, 0.01);
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted, IntegratorKind::Direct] {
        for depth in [1u32, 2, 3, 8] {
            let mut settings = settings((4, 4), 1);
            settings.max_depth = depth;
            settings.integrator = integrator;
            settings.russian_roulette = false;
            let renderer = render(&scene, camera, &settings);
            let expected = 2.0 * (1.0 - 0.5f64.powi(depth as i32));
            let measured = mean(&renderer.picture());
            assert!((measured - expected).abs() < 1e-5, "{integrator:?} {depth}: {measured}");
            // The eye ray is the first: depth − 1 more.
            let rays = renderer.rays();
            assert_eq!((rays.camera, rays.indirect), (16, 16 * u64::from(depth - 1)));
        }
    }
}
