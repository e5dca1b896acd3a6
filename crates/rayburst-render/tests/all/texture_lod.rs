//! Footprints of rays against those of rays traced beside them, and what textures look like by them.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use rayburst_accel::{AcceptAll, TraceOptions};
use rayburst_image::{MipMap, RgbImage, TexelFormat, Texels, metrics::rmse};
use rayburst_math::{Ray, RayCone, RayDifferential};
use rayburst_render::{
    IntegratorKind, RayFootprint, Reference, RenderSettings, View,
    footprint::{Arrival, Turn},
};
use rayburst_scene::{
    Camera, Environment, FlatScene, Footprint, Material, Scene, ShadingOptions, Surface, Texture,
    TextureLod, TextureSlot,
    shapes::{self, Shape},
};

use crate::scenes::{built_in, flat, picture, settings};

const SIZE: (u32, u32) = (160, 120);

/// Adds a white and black checkerboard of 2×2 squares of 64×64 texels.
fn add_checks(scene: &mut Scene) -> u32 {
    let data = (0..128 * 128u32).map(|i| if (i % 128 / 64) == (i / 128 / 64) { 255 } else { 0 });
    let texels = Texels { width: 128, height: 128, channels: 1, data: data.collect() };
    scene.images.push(Arc::new(MipMap::new(texels, TexelFormat::Srgb)));
    scene.textures.push(Texture::new(scene.images.len() as u32 - 1));
    let slot = TextureSlot::new(scene.textures.len() as u32 - 1);
    let checks = Material { base_color_texture: slot, ..Material::diffuse(Vec3::ONE) };
    scene.add_material("checks", checks)
}

/// Two checked planes, a floor and a wall, and something between them and the eye.
fn before_checks(material: Material, shape: Shape) -> Arc<FlatScene> {
    let white = Environment::Constant(Vec3::ONE);
    let mut scene = Scene { environment: Some(white), ..Scene::default() };
    let checks = add_checks(&mut scene);
    let mut planes = Shape::default();
    let corner = |x: f32, y: f32, z: f32| Vec3::new(9.0 * x, 9.0 * y, 9.0 * z);
    let (left, right) = (-1.0, 1.0);
    planes.add_textured_quad(
        [
            corner(left, 0., 1.),
            corner(right, 0., 1.),
            corner(right, 0., -1.),
            corner(left, 0., -1.),
        ],
        1.0,
    );
    planes.add_textured_quad(
        [
            corner(left, 0., -1.),
            corner(right, 0., -1.),
            corner(right, 1., -1.),
            corner(left, 1., -1.),
        ],
        1.0,
    );
    scene.add_mesh("planes", vec![planes.into_primitive(checks)]);
    let between = scene.add_material("between", material);
    scene.add_mesh("between", vec![shape.into_primitive(between)]);
    flat(&scene)
}

fn camera() -> Camera {
    Camera::look_at(Vec3::new(0.4, 2.2, 6.0), Vec3::new(0.0, 1.2, 0.0), Vec3::Y, 0.7)
}

/// A ray on its way through mirrors and glass until it meets the checks.
struct Arrived {
    surface: Surface,
    direction: Vec3,
    /// The two kinds of footprint there.
    seen: [Footprint; 2],
    /// Surfaces met before.
    turns: u32,
}

/// The eye ray through a point of the picture; where it may, it goes through rather than back, if
/// `through`.
fn follow(scene: &FlatScene, pixel: Vec2, through: bool) -> Option<Arrived> {
    let (mut ray, cone) = camera().ray(pixel, SIZE, Vec2::ZERO);
    let mut carried = [TextureLod::Cones, TextureLod::Differentials]
        .map(|lod| RayFootprint::of_eye(lod, &camera(), pixel, SIZE, Vec2::ZERO, cone));
    for turns in 0..8 {
        let hit = scene.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        if !hit.is_hit() {
            return None;
        }
        let surface = scene.surface(&hit);
        let wo = -ray.direction;
        let point = scene.shading_point(&surface, wo, Footprint::NONE, &ShadingOptions::default());
        if !point.bsdf.is_delta() {
            let seen = carried.map(|c| c.at(&ray, &hit, &surface));
            return Some(Arrived { surface, direction: ray.direction, seen, turns });
        }
        let local = point.frame.to_local(wo);
        let refracted = point.bsdf.specular_refraction(local).filter(|_| through);
        let transmitted = refracted.is_some();
        let path = refracted.or(point.bsdf.specular_reflection(local))?;
        let wi = point.frame.to_world(path.wi).normalize();
        let arrival = Arrival { scene, ray: &ray, hit: &hit, surface: &surface };
        carried = carried.map(|c| c.turned(&arrival, &Turn::specular(&point, wi, transmitted)));
        ray = Ray::new(surface.spawn(wi), wi);
    }
    None
}

/// What a footprint is in UV: the mip level of its area, and its longest side.
fn in_uv(surface: &Surface, axes: [Vec3; 2]) -> (f32, f32) {
    let [a, b] = surface.barycentric_change(axes).map(|w| surface.uv_change(0, w));
    (0.5 * a.perp_dot(b).abs().log2(), (a.length_squared() + b.length_squared()).sqrt().log2())
}

/// Of all pixels whose rays meet the checks after some turns: how many, and the shares of them whose
/// level by cones' areas, by differentials' areas, and by differentials' lengths is within half a level
/// of what rays half a pixel away say.
fn agreement(scene: &FlatScene, through: bool) -> (usize, [f64; 3]) {
    let (mut count, mut within) = (0, [0usize; 3]);
    for i in 0..SIZE.0 * SIZE.1 {
        let pixel = Vec2::new((i % SIZE.0) as f32 + 0.5, (i / SIZE.0) as f32 + 0.5);
        let at = |x: f32, y: f32| follow(scene, pixel + Vec2::new(x, y), through);
        let Some(centre) = at(0.0, 0.0).filter(|c| c.turns > 0) else { continue };
        let others = [at(0.5, 0.0), at(-0.5, 0.0), at(0.0, 0.5), at(0.0, -0.5)];
        let normal = centre.surface.geometric_normal;
        // The same turns and the same plane, and not along it.
        let same = |other: &Option<Arrived>| {
            other.as_ref().filter(|o| {
                o.turns == centre.turns && o.surface.geometric_normal.dot(normal) > 0.999
            })?;
            other.as_ref().map(|o| o.surface.position)
        };
        let [Some(right), Some(left), Some(below), Some(above)] = others.each_ref().map(same)
        else {
            continue;
        };
        if normal.dot(centre.direction).abs() < 0.15 {
            continue;
        }
        let surface = &centre.surface;
        let (level, longest) = in_uv(surface, [right - left, below - above]);
        let wo = -centre.direction;
        let [cone, differential] = centre.seen.map(|f| in_uv(surface, f.on(surface, wo)));
        count += 1;
        let errors = [cone.0 - level, differential.0 - level, differential.1 - longest];
        for (within, error) in within.iter_mut().zip(errors) {
            *within += usize::from(error.abs() <= 0.5);
        }
    }
    (count, within.map(|n| n as f64 / count as f64))
}

fn quad(corners: [[f32; 3]; 4]) -> Shape {
    let mut shape = Shape::default();
    shape.add_quad(corners.map(Vec3::from));
    shape
}

#[test]
fn levels_are_those_of_rays_traced_beside() {
    let mirror = Material::mirror(Vec3::ONE);
    let standing = quad([[-2., 0., 1.], [2., 0., 0.4], [2., 3., 0.2], [-2., 3., 0.8]]);
    let ball = shapes::sphere(Vec3::new(0.0, 1.2, 0.0), 1.2, 6);
    let mut block = Shape::default();
    block.add_box(Vec3::new(-1.5, 0.01, -0.5), Vec3::new(1.5, 2.5, 0.5));
    for (name, material, shape, through, least) in [
        ("flat mirror", mirror, standing, false, [1.0, 1.0, 1.0]),
        ("mirror ball", mirror, ball.clone(), false, [0.97, 0.99, 0.99]),
        ("block of glass", Material::glass(1.5), block, true, [0.97, 0.99, 0.99]),
        ("ball of glass", Material::glass(1.5), ball, true, [0.97, 0.99, 0.99]),
    ] {
        let scene = before_checks(material, shape);
        let (count, shares) = agreement(&scene, through);
        assert!(count > 500, "{name}: {count} pixels");
        for (share, least) in shares.iter().zip(least) {
            assert!(*share >= least, "{name}: {shares:?}");
        }
    }
}

#[test]
fn paths_carry_little() {
    assert_eq!(size_of::<RayCone>(), 8);
    assert_eq!(size_of::<RayDifferential>(), 48);
}

/// The mean change from frame to frame of a camera that moves sideways, and of the finest detail.
fn shimmer(scene: &Arc<FlatScene>, lod: TextureLod, integrator: IntegratorKind) -> f64 {
    let settings = RenderSettings {
        integrator,
        texture_lod: lod,
        filter_radius: Some(1e-3),
        ..settings((120, 80), 1)
    };
    let frames: Vec<RgbImage> = (0..6)
        .map(|frame| {
            let aside = Vec3::X * (0.013 * frame as f32);
            let still = camera();
            let moved = Camera {
                transform: glam::Affine3A::from_translation(aside) * still.transform,
                ..still
            };
            picture(scene, moved, &settings)
        })
        .collect();
    frames.windows(2).map(|pair| rmse(&pair[0], &pair[1])).sum::<f64>() / 5.0
}

#[test]
fn filtered_textures_shimmer_less() {
    let ball = shapes::sphere(Vec3::new(0.0, 1.2, 0.0), 1.2, 5);
    let scene = before_checks(Material::mirror(Vec3::ONE), ball);
    for integrator in [IntegratorKind::Inspect(View::Albedo), IntegratorKind::Whitted] {
        let [mip0, cones, differentials] =
            TextureLod::ALL.map(|(_, lod)| shimmer(&scene, lod, integrator));
        assert!(cones < 0.6 * mip0, "{cones} {mip0}");
        assert!(differentials < 0.6 * mip0, "{differentials} {mip0}");
    }
}

#[test]
fn batches_carry_what_the_reference_carries() {
    let (scene, camera) = built_in("hemisphere-room");
    for (name, texture_lod) in TextureLod::ALL {
        let settings = RenderSettings { texture_lod, max_depth: 6, ..settings((40, 30), 2) };
        let batched = picture(&scene, camera, &settings);
        let twin = Reference::new(&scene, &camera, &settings).ray_trace_image();
        for (i, (a, b)) in batched.pixels.iter().zip(&twin.pixels).enumerate() {
            let error = (*a - *b).abs().max_element() / (1e-3 + b.max_element());
            assert!(error < 1e-4, "{name}, pixel {i}: {a} instead of {b}");
        }
    }
}

#[test]
fn filtering_comes_nearer_to_the_truth_than_the_finest_level() {
    let (scene, camera) = built_in("hemisphere-room");
    let picture_of = |texture_lod, filter_radius, spp| {
        let settings = RenderSettings {
            integrator: IntegratorKind::Whitted,
            texture_lod,
            filter_radius,
            ..settings((96, 72), spp)
        };
        picture(&scene, camera, &settings)
    };
    let truth = picture_of(TextureLod::Mip0, None, 256);
    let [mip0, cones, differentials] =
        TextureLod::ALL.map(|(_, lod)| rmse(&truth, &picture_of(lod, Some(1e-3), 1)));
    assert!(mip0 > 1.2 * cones && cones >= differentials, "{mip0} {cones} {differentials}");
}
