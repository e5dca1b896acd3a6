//! Lamps of scenes as polygon lights: what is found, what belongs to them, which matter, and that no
//! light is lost or counted twice between them and the light sampler.

use std::{collections::HashSet, sync::Arc};

use rayburst_accel::{AcceptAll, BuildOptions, TraceOptions};
use rayburst_image::{MipMap, TexelFormat, Texels, colour::luminance};
use rayburst_math::{
    Aabb, Frame, Ray,
    glam::{Affine3A, Vec2, Vec3},
    hash::Rng,
    warp,
};
use rayburst_scene::{
    Bsdf, FlatScene, Flattener, LightKinds, LightSampler, Material, Pose, Primitive, Scene,
    Texture, TextureSlot,
    ltc::{PolygonLight, PolygonLightLimits, PolygonLights, PolygonShading, SurfaceBounds},
    shapes,
};
use rayburst_testkit::statistics::Moments;

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
    Flattener::new(scene, BuildOptions::default()).at(&Pose::rest(scene)).expect("builds")
}

/// A one-sided ceiling lamp of eight triangles, a two-sided wall lamp, a textured lamp, and a lamp
/// placed twice, once mirrored. None is in front of another as seen from the origin.
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
    let grid: Vec<Vec3> =
        (0..9).map(|i| Vec3::new((i % 3) as f32 - 1.0, 1.5, (i / 3) as f32 - 1.0)).collect();
    let cells = [0, 1, 3, 4].into_iter().flat_map(|c| [[c, c + 1, c + 4], [c, c + 4, c + 3]]);
    let ceiling_lamp = Primitive {
        positions: grid,
        indices: cells.collect(),
        material: ceiling,
        ..Primitive::default()
    };
    let c = Vec3::new;
    scene.add_mesh(
        "lamps",
        vec![
            ceiling_lamp,
            quad(
                [c(2.0, -1.0, -0.5), c(2.0, 0.5, -0.5), c(2.0, 0.5, 0.8), c(2.0, -1.0, 0.8)],
                wall,
            ),
            quad(
                [c(-1.0, -0.8, 3.0), c(-1.0, 0.8, 3.0), c(1.0, 0.8, 3.0), c(1.0, -0.8, 3.0)],
                textured,
            ),
        ],
    );
    let small = [c(-0.4, -1.0, -0.4), c(-0.4, -1.0, 0.4), c(0.4, -1.0, 0.4), c(0.4, -1.0, -0.4)];
    let node = scene.add_mesh("small", vec![quad(small, ceiling)]);
    let mirrored = Affine3A::from_scale(c(-2.0, 1.0, 1.5));
    let moved = Affine3A::from_translation(c(-3.0, 0.2, 0.0));
    scene.nodes[node as usize].instances = vec![mirrored, moved];
    flatten(&scene)
}

#[test]
fn lamps_become_polygons_and_hits_find_them() {
    let scene = lamps();
    let lights = PolygonLights::new(&scene, &PolygonLightLimits::default());
    let found = lights.lights();
    assert_eq!(found.len(), 4, "{found:?}");
    assert!(found.iter().all(|l| l.corners().len() == 4));
    assert_eq!(lights.primitives(&found[0]), [0, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(found.iter().map(|l| l.two_sided).collect::<Vec<_>>(), [false, true, false, false]);
    let areas: Vec<f32> = found.iter().map(|l| l.area).collect();
    for (area, expected) in areas.iter().zip([4.0, 1.95, 1.92, 0.64]) {
        assert!((area - expected).abs() < 1e-4, "{areas:?}");
    }
    // Normals are those of the front, also where an instance mirrors: emission agrees.
    let mut rng = Rng::new(3);
    let mut seen = HashSet::new();
    for _ in 0..4000 {
        let from = 0.3 * (rng.vec3() - Vec3::splat(0.5));
        let direction = warp::uniform_sphere(rng.vec2());
        let ray = Ray::new(from, direction);
        let hit = scene.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        let Some(index) = lights.light_of_hit(&hit) else { continue };
        let light = &found[index as usize];
        assert_eq!((light.instance, light.geometry), (hit.instance, hit.geometry));
        let surface = scene.surface(&hit);
        assert!((surface.geometric_normal.dot(light.normal) - 1.0).abs() < 1e-5);
        let emitted = scene
            .shading_point(&surface, -direction, Default::default(), &Default::default())
            .emitted;
        assert_eq!(emitted, light.radiance_towards(from));
        seen.insert(index);
    }
    assert_eq!(seen.len(), 4);
    // No light on itself.
    assert_eq!(found[1].radiance_towards(found[1].corners()[2]), Vec3::ZERO);
}

#[test]
fn limits_leave_the_strongest_and_dark_scenes_have_none() {
    let scene = lamps();
    let lights = PolygonLights::new(&scene, &PolygonLightLimits { triangles: 128, lights: 2 });
    let radiances: Vec<Vec3> = lights.lights().iter().map(|l| l.radiance).collect();
    assert_eq!(radiances, [Vec3::new(5.0, 4.0, 3.0); 2]);
    assert!(lights.lights()[0].area > lights.lights()[1].area);
    let lights = PolygonLights::new(&scene, &PolygonLightLimits { triangles: 2, lights: 100 });
    assert_eq!(lights.lights().len(), 3, "the ceiling lamp has eight triangles");
    let dark = flatten(&Scene::default());
    let lights = PolygonLights::new(&dark, &PolygonLightLimits::default());
    assert!(lights.is_empty() && lights.light_of(0, 0, 0).is_none());
    // A closed lamp of curved shape: many small polygons, each triangle in one of them.
    let mut scene = Scene::default();
    scene.add_material("lamp", Material::emitter(Vec3::ONE));
    scene.add_mesh("ball", vec![shapes::sphere(Vec3::ZERO, 1.0, 1).into_primitive(0)]);
    let scene = flatten(&scene);
    let lights = PolygonLights::new(&scene, &PolygonLightLimits::default());
    let triangles = scene.geometries[0].primitive.indices.len() as u32;
    assert!((0..triangles).all(|p| lights.light_of(0, 0, p).is_some()));
    assert_eq!(lights.light_of(0, 0, triangles), None);
}

/// Radiosity over π of a white Lambert surface at the origin from sampled lights.
fn sampled(
    scene: &FlatScene,
    normal: Vec3,
    lights: &LightSampler,
    excluded: impl Fn(u32, u32, u32) -> bool,
    seed: u64,
) -> Moments {
    let mut rng = Rng::new(seed);
    Moments::of((0..60_000).map(|_| {
        let choice = rng.f32();
        let sample = lights.sample_except(scene, Vec3::ZERO, choice, rng.vec2(), &excluded);
        sample.map_or(0.0, |s| {
            let cos = s.direction.dot(normal).max(0.0);
            f64::from(luminance(s.radiance) * cos * std::f32::consts::FRAC_1_PI / s.pdf)
        })
    }))
}

/// The same from polygon lights.
fn computed(normal: Vec3, lights: &[&PolygonLight]) -> f64 {
    let bsdf = Bsdf::diffuse(Vec3::ONE);
    let frame = Frame::from_normal(normal);
    let shading = PolygonShading::new(&bsdf, &frame, Vec3::ZERO, normal).expect("scatters");
    let of = |light: &&PolygonLight| {
        let light_there = light.radiance_towards(Vec3::ZERO);
        f64::from(luminance(light_there * shading.integrate(light.corners()).total()))
    };
    lights.iter().map(of).sum()
}

#[test]
fn no_light_is_lost_or_counted_twice() {
    let scene = lamps();
    let lights = PolygonLights::new(&scene, &PolygonLightLimits::default());
    let everything = LightSampler::new(&scene);
    let rest = LightSampler::of_kinds(&scene, LightKinds::ALL, |i, g, p| {
        lights.light_of(i, g, p).is_some()
    });
    let nothing = LightSampler::of_kinds(&scene, LightKinds::ALL, |_, _, _| true);
    assert!(nothing.is_empty() && !rest.is_empty());
    let close = |a: &Moments, b: f64, of_b: f64| {
        let error = a.standard_error().hypot(of_b);
        assert!((a.mean - b).abs() < 4.5 * error + 1e-4 * a.mean, "{a:?} {b} ± {of_b}");
    };
    for (seed, normal) in (0..).zip([Vec3::Y, Vec3::Z, Vec3::new(0.6, 0.0, 0.8)]) {
        let all = sampled(&scene, normal, &everything, |_, _, _| false, seed);
        // All polygons computed, the rest from a sampler that does not know them.
        let left = sampled(&scene, normal, &rest, |_, _, _| false, 10 + seed);
        let polygons = computed(normal, &lights.lights().iter().collect::<Vec<_>>());
        assert!(polygons > 0.1);
        close(&all, polygons + left.mean, left.standard_error());
        // Two of them computed, the rest sampled by one that knows all.
        let chosen = [0u32, 2];
        let is_chosen =
            |i, g, p| lights.light_of(i, g, p).is_some_and(|light| chosen.contains(&light));
        let left = sampled(&scene, normal, &everything, is_chosen, 20 + seed);
        let some = computed(normal, &chosen.map(|i| &lights.lights()[i as usize]));
        close(&all, some + left.mean, left.standard_error());
    }
    // Scattered rays that meet excluded lamps find the density 0, others the one that is sampled.
    let mut rng = Rng::new(8);
    let (mut excluded, mut others) = (0, 0);
    for _ in 0..4000 {
        let direction = warp::uniform_sphere(rng.vec2());
        let ray = Ray::new(Vec3::ZERO, direction);
        let hit = scene.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        if hit.is_hit() {
            let pdf = rest.emitter_pdf(&scene, &hit, Vec3::ZERO, direction);
            if lights.light_of_hit(&hit).is_some() {
                assert_eq!(pdf, 0.0);
                excluded += 1;
            } else {
                assert!(pdf >= everything.emitter_pdf(&scene, &hit, Vec3::ZERO, direction));
                others += 1;
            }
        }
    }
    assert!(excluded > 100 && others > 50, "{excluded} {others}");
}

#[test]
fn importance_bounds_what_arrives_and_orders_lights() {
    let scene = lamps();
    let lights = PolygonLights::new(&scene, &PolygonLightLimits::default());
    let mut rng = Rng::new(17);
    let (mut reached, mut dark) = (0, 0);
    for _ in 0..300 {
        let centre = 6.0 * (rng.vec3() - Vec3::splat(0.5));
        let half = rng.vec3() * rng.range(0.01, 1.0);
        let axis = warp::uniform_sphere(rng.vec2());
        let spread = if rng.f32() < 0.3 { 4.0 } else { rng.range(0.0, 1.2) };
        let positions = Aabb { lower: centre - half, upper: centre + half };
        let surfaces = SurfaceBounds { positions, axis, spread };
        let mut chosen = [(0, 0.0); 3];
        let count = lights.most_important(&surfaces, &mut chosen);
        let importance: Vec<f32> =
            lights.lights().iter().map(|l| PolygonLights::importance(l, &surfaces)).collect();
        let mut sorted: Vec<f32> = importance.iter().copied().filter(|&i| i > 0.0).collect();
        sorted.sort_by(|a, b| b.total_cmp(a));
        sorted.truncate(3);
        assert_eq!(chosen[..count].iter().map(|c| c.1).collect::<Vec<_>>(), sorted);
        assert!(chosen[..count].iter().all(|&(light, i)| importance[light as usize] == i));
        for _ in 0..20 {
            let position = positions.lower + rng.vec3() * positions.extent();
            let normal = Frame::from_normal(axis)
                .to_world(warp::uniform_cone(rng.vec2(), spread.min(std::f32::consts::PI).cos()));
            let bsdf = Bsdf::diffuse(Vec3::splat(1.0));
            let frame = Frame::from_normal(normal);
            let shading = PolygonShading::new(&bsdf, &frame, position, normal).expect("scatters");
            for (light, &bound) in lights.lights().iter().zip(&importance) {
                let arriving = std::f32::consts::PI
                    * luminance(
                        light.radiance_towards(position)
                            * shading.integrate(light.corners()).total(),
                    );
                assert!(
                    arriving <= bound * 1.001 + 1e-6,
                    "{arriving} {bound} {surfaces:?} {light:?}"
                );
                reached += u32::from(arriving > 0.0);
                dark += u32::from(bound == 0.0);
            }
        }
    }
    assert!(reached > 1000 && dark > 1000, "{reached} {dark}");
    let mut none = [];
    let everywhere = SurfaceBounds::of_positions(Aabb::of_point(Vec3::ZERO));
    assert_eq!(lights.most_important(&everywhere, &mut none), 0);
    assert_eq!(
        lights.most_important(&SurfaceBounds::of_positions(Aabb::EMPTY), &mut [(0, 0.0); 4]),
        0
    );
}
