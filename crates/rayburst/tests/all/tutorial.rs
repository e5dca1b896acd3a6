//! The tutorial's programs against the engine's own integrators, and what they claim.

use std::sync::Arc;

use rayburst::{
    glam::UVec2,
    image::{MipMap, TexelFormat, Texels},
    prelude::*,
    render::LightSampling,
    scene::{AlphaMode, Texture, TextureLod, TextureSlot, builtin, shapes},
};

use crate::examples::{hello_triangle, path_tracer, whitted};

const SIZE: (u32, u32) = (48, 36);

/// Root mean square of the difference as a part of that of the picture.
fn difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let square = |v: Vec3| f64::from(v.length_squared());
    let apart: f64 = a.pixels.iter().zip(&b.pixels).map(|(&a, &b)| square(a - b)).sum();
    let whole: f64 = b.pixels.iter().map(|&b| square(b)).sum();
    (apart / whole).sqrt()
}

fn built_in(scene: &Scene, integrator: IntegratorKind, spp: u32) -> RgbImage {
    let settings = RenderSettings {
        size: SIZE,
        spp,
        integrator,
        texture_lod: TextureLod::Mip0,
        ..RenderSettings::default()
    };
    assert_eq!(settings.light_sampling, LightSampling::Both);
    rayburst::picture(scene, settings).unwrap()
}

/// A floor under a bright sky; in front of it a fence of cut-out holes and a thin veil.
fn fence() -> Scene {
    let mut scene = Scene {
        environment: Some(Environment::Constant(Vec3::new(3.0, 4.0, 6.0))),
        ..Scene::default()
    };
    let data = (0..64).flat_map(|i| [220, 140, 60, if (i + i / 8) % 2 == 0 { 255 } else { 0 }]);
    let texels = Texels { width: 8, height: 8, channels: 4, data: data.collect() };
    scene.images.push(Arc::new(MipMap::new(texels, TexelFormat::Srgb)));
    scene.textures.push(Texture::new(0));
    let white = scene.add_material("white", Material::diffuse(Vec3::splat(0.8)));
    let cut = Material {
        alpha_mode: AlphaMode::Mask as u32,
        base_color_texture: TextureSlot::new(0),
        ..Material::diffuse(Vec3::ONE)
    };
    let cut = scene.add_material("fence", cut);
    let veil = Material {
        alpha_mode: AlphaMode::Blend as u32,
        base_color: [0.9, 0.2, 0.3, 0.4],
        ..Material::diffuse(Vec3::ONE)
    };
    let veil = scene.add_material("veil", veil);
    for (z, height, material) in [(0.0, 1.5, cut), (-1.0, 2.5, veil)] {
        let corners = [(-2.0, 0.0), (2.0, 0.0), (2.0, height), (-2.0, height)];
        let mut wall = shapes::Shape::default();
        wall.add_textured_quad(corners.map(|(x, y)| Vec3::new(x, y, z)), 0.25);
        scene.add_mesh("wall", vec![wall.into_primitive(material)]);
    }
    let mut floor = shapes::Shape::default();
    let corners = [(-4.0, 4.0), (4.0, 4.0), (4.0, -4.0), (-4.0, -4.0)];
    floor.add_textured_quad(corners.map(|(x, z)| Vec3::new(x, 0.0, z)), 1.0);
    scene.add_mesh("floor", vec![floor.into_primitive(white)]);
    scene.world_lights.push(Light {
        intensity: Vec3::splat(20.0),
        kind: LightKind::Directional {
            direction: Vec3::new(0.4, -1.0, -0.6).normalize(),
            angular_radius: 0.0,
        },
    });
    let camera = Camera::look_at(Vec3::new(1.0, 2.0, 6.0), Vec3::new(0.0, 0.8, 0.0), Vec3::Y, 0.7);
    scene.views.push(rayburst::scene::View { name: String::new(), camera });
    scene
}

#[test]
fn the_triangle_is_in_the_middle() {
    let picture = hello_triangle::render((40, 30), 4).unwrap();
    let at = |x, y| picture.pixels[(y * 40 + x) as usize];
    let UVec2 { x, y } = UVec2::new(20, 18);
    assert!((at(x, y).element_sum() - 1.0).abs() < 1e-4, "barycentric coordinates sum to one");
    assert!(at(1, 1).z > at(1, 1).x && at(1, 1).element_sum() < 0.9, "the backdrop is dark blue");
}

#[test]
fn whitted_with_shaders_is_the_built_in_whitted() {
    let scene = builtin::build("spheres").unwrap();
    let ours = whitted::render(&scene, SIZE, 4).unwrap();
    let apart = difference(&ours, &built_in(&scene, IntegratorKind::Whitted, 4));
    assert!(apart < 1e-5, "{apart}");
}

#[test]
fn paths_with_shaders_are_the_built_in_paths() {
    for (scene, spp) in [(builtin::build("cornell").unwrap(), 16), (fence(), 16)] {
        let ours = path_tracer::render(&scene, SIZE, spp).unwrap();
        let theirs = built_in(&scene, IntegratorKind::Path, spp);
        let apart = difference(&ours, &theirs);
        assert!(apart < 1e-4, "{}: {apart}", scene.name);
        // The bound means something: other random numbers are farther away.
        let fewer = built_in(&scene, IntegratorKind::Path, spp / 2);
        assert!(difference(&fewer, &theirs) > 1e-2, "{}", scene.name);
    }
}
