//! The tutorial's programs against the engine's own integrators, and what they claim.

use std::sync::Arc;

use rayburst::{
    glam::UVec2,
    image::{MipMap, TexelFormat, Texels},
    prelude::*,
    render::LightSampling,
    scene::{AlphaMode, Texture, TextureLod, TextureSlot, builtin, shapes},
};

use crate::examples::{
    adaptive::{self, Plan},
    animated_instances,
    callables::{self, Style},
    cutouts::{self, Card},
    hello_triangle, path_tracer, procedural_gallery,
    transparency::{self, MOST, Order},
    whitted,
};

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

#[test]
fn tight_cards_give_the_same_picture_with_fewer_calls() {
    let (square, square_calls) = cutouts::render(Card::Square, SIZE, 4).unwrap();
    let (tight, tight_calls) = cutouts::render(Card::Tight, SIZE, 4).unwrap();
    assert!(tight_calls > 0 && 2 * tight_calls < square_calls, "{tight_calls} {square_calls}");
    // Only rounding at edges may differ: a sample in a thousand.
    let pairs = square.pixels.iter().zip(&tight.pixels);
    let different = pairs.filter(|(a, b)| (**a - **b).abs().max_element() > 1e-3).count();
    assert!(different <= square.pixels.len() * 4 / 1000, "{different}");
}

#[test]
fn the_nearest_layers_in_any_hit_are_those_of_sorted_rays() {
    for layers in [1, 2, 3, 5, 8, MOST] {
        let buffer = transparency::render(Order::Buffer, layers, SIZE, 4).unwrap();
        let sorted = transparency::render(Order::Peel, layers, SIZE, 4).unwrap();
        let apart = transparency::greatest_difference(&buffer, &sorted);
        assert!(apart < 5e-3, "{layers}: {apart}");
    }
    let few = transparency::render(Order::Buffer, 2, SIZE, 4).unwrap();
    let all = transparency::render(Order::Buffer, MOST, SIZE, 4).unwrap();
    assert!(transparency::greatest_difference(&few, &all) > 0.05, "layers matter");
}

#[test]
fn five_callable_shaders_are_as_good_as_32_permutations() {
    let (many, permutations) = callables::render(Style::Permutations, SIZE, 4).unwrap();
    let (one, called) = callables::render(Style::Callables, SIZE, 4).unwrap();
    assert_eq!(many.pixels, one.pixels);
    assert_eq!((permutations.groups, permutations.callables, permutations.features), (32, 0, 80));
    assert_eq!((called.groups, called.callables, called.features), (1, 5, 5));
}

#[test]
fn adaptive_rays_are_better_spent() {
    let size = (64, 48);
    let reference = adaptive::render(Plan::Uniform, size, 1024).unwrap().picture;
    let uniform = adaptive::render(Plan::Uniform, size, 16).unwrap();
    let spent = adaptive::render(Plan::Adaptive, size, 16).unwrap();
    let [before, after] = [&uniform, &spent].map(|o| adaptive::rmse(&o.picture, &reference));
    assert!(after < 0.9 * before, "{before} {after}");
    let rays = spent.rays as f64 / uniform.rays as f64;
    assert!((rays - 1.0).abs() < 0.02, "{rays}");
    assert!(spent.samples.iter().max() > spent.samples.iter().min());
}

#[test]
fn dominoes_fall_and_every_shape_is_shown() {
    let (frames, _, seconds) = animated_instances::render(3, SIZE, 2).unwrap();
    assert_eq!((frames.len(), seconds.len()), (3, 3));
    assert!(difference(&frames[0], &frames[2]) > 0.05);
    // 13 shapes of 13 hues.
    let gallery = procedural_gallery::render((160, 80), 4).unwrap();
    let hue = |c: &Vec3| {
        let x = c.x - 0.5 * (c.y + c.z);
        let y = 0.866 * (c.y - c.z);
        let grey = Vec2::new(x, y).length() < 0.2 * c.max_element();
        (!grey).then(|| y.atan2(x).rem_euclid(std::f32::consts::TAU))
    };
    let mut seen = [0; 13];
    for angle in gallery.pixels.iter().filter_map(hue) {
        seen[(angle / std::f32::consts::TAU * 13.0) as usize % 13] += 1;
    }
    assert!(seen.iter().filter(|&&count| count > 5).count() >= 10, "{seen:?}");
}
