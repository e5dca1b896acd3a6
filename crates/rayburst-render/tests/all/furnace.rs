//! White furnaces: in even light, what absorbs nothing is not to be seen.

use glam::Vec3;
use rayburst_render::IntegratorKind;
use rayburst_scene::{Environment, Material, Scene};

use crate::scenes::{flat, floor, look_at_origin, mean, render, settings};

fn furnace(material: Material) -> Scene {
    let mut scene =
        Scene { environment: Some(Environment::Constant(Vec3::ONE)), ..Scene::default() };
    let material = scene.add_material("white", material);
    scene.add_mesh("sheet", vec![floor(1.0, 0.0).into_primitive(material)]);
    scene
}

#[test]
fn white_sheets_vanish() {
    for (name, material) in [
        ("diffuse", Material::diffuse(Vec3::ONE)),
        ("rough metal", Material::metal(Vec3::ONE, 0.7)),
        ("shiny metal", Material::metal(Vec3::ONE, 0.2)),
        ("coated", Material::plastic(Vec3::ONE, 0.4)),
        ("mirror", Material::mirror(Vec3::ONE)),
        ("glass", Material::glass(1.5)),
    ] {
        let renderer = render(&flat(&furnace(material)), look_at_origin(), &settings((8, 8), 1024));
        let error = mean(&renderer.picture()) - 1.0;
        let variance: f64 = renderer.film().variance().iter().map(|&v| f64::from(v)).sum();
        let sigma = variance.sqrt() / 64.0;
        assert!(error.abs() < 0.005, "{name}: {error:+.4} ± {sigma:.4}");
        assert!(error < 3.0 * sigma + 1e-3, "{name} gains energy: {error:+.4} ± {sigma:.4}");
    }
}

#[test]
fn rough_metal_needs_its_energy_compensation() {
    let scene = flat(&furnace(Material::metal(Vec3::ONE, 0.9)));
    let mut settings = settings((8, 8), 256);
    settings.energy_compensation = false;
    let without = mean(&render(&scene, look_at_origin(), &settings).picture());
    assert!((0.3..0.95).contains(&without), "{without}");
}

#[test]
fn a_glass_ball_vanishes() {
    let (scene, camera) = crate::scenes::built_in("furnace:material=glass");
    let mut settings = settings((12, 12), 256);
    settings.max_depth = 64;
    let error = mean(&render(&scene, camera, &settings).picture()) - 1.0;
    assert!(error.abs() < 0.005, "{error:+.4}");
}

#[test]
fn whitted_and_direct_know_the_furnace_too() {
    for integrator in [IntegratorKind::Whitted, IntegratorKind::Direct] {
        for material in [Material::diffuse(Vec3::ONE), Material::mirror(Vec3::ONE)] {
            let mut settings = settings((4, 4), 1024);
            settings.integrator = integrator;
            let picture = render(&flat(&furnace(material)), look_at_origin(), &settings).picture();
            let error = mean(&picture) - 1.0;
            assert!(error.abs() < 0.005, "{integrator:?}: {error:+.4}");
        }
    }
}
