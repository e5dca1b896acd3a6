#![allow(clippy::print_stderr, reason = "tests say what they skip")]

use std::path::Path;

use glam::Vec3;
use rayburst_accel::BuildOptions;
use rayburst_math::{
    Hit, HitKind,
    hash::Rng,
    lanes::{F32x16, LANES, Vec3x16},
    warp,
};

use super::*;
use crate::{FlatScene, Flattener, Footprint, Pose, Scene, ShadingOptions, TextureLod, builtin};

fn flatten(scene: &Scene) -> FlatScene {
    Flattener::new(scene, BuildOptions::default()).at(&Pose::rest(scene)).unwrap()
}

fn random_hit(scene: &FlatScene, rng: &mut Rng) -> Hit {
    loop {
        let instance = rng.below(scene.instances.len() as u32);
        let record = &scene.instances[instance as usize];
        if record.geometry_count == 0 {
            continue;
        }
        let geometry = rng.below(record.geometry_count);
        let primitive = &scene.geometries[(record.first_geometry + geometry) as usize].primitive;
        if primitive.indices.is_empty() {
            continue;
        }
        let [u, v] = [rng.f32(), rng.f32()];
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        return Hit {
            t: 1.0,
            u,
            v,
            primitive: rng.below(primitive.indices.len() as u32),
            geometry,
            instance,
            kind: if rng.f32() < 0.5 { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK },
            reserved: 0,
        };
    }
}

/// How far single surfaces and their twins are apart: the greatest differences of colours and of the sines
/// of normals.
fn compare(scene: &FlatScene, groups: u32, seed: u64) -> [f32; 2] {
    let mut rng = Rng::new(seed);
    let mut worst = [0.0f32; 2];
    for group in 0..groups {
        let mut hits = [Hit::MISS; LANES];
        let (mut wo, mut width) = (Vec3x16::ZERO, F32x16::ZERO);
        for lane in 0..LANES {
            hits[lane] = random_hit(scene, &mut rng);
            wo.set_lane(lane, warp::uniform_sphere(rng.vec2()));
            width.0[lane] = scene.bounds.diagonal() * 1e-4 * rng.f32().powi(2) * 30.0;
        }
        let (taps, lod) = match group % 4 {
            0 => (1, TextureLod::Cones),
            1 => (16, TextureLod::Differentials),
            2 => (4, TextureLod::Mip0),
            _ => (4, TextureLod::Cones),
        };
        let options =
            ShadingOptions { lod, most_taps: taps, most_detail_taps: 1, ..Default::default() };
        let wide = scene.surface16(&hits);
        let mut axes = [Vec3x16::ZERO; 2];
        for axis in &mut axes {
            for lane in 0..LANES {
                let step = width.0[lane] * (rng.vec3() - 0.5);
                axis.set_lane(lane, step.reject_from(wide.geometric_normal.lane(lane)));
            }
        }
        let footprint = match lod {
            TextureLod::Differentials => Footprint16::axes(axes),
            _ => Footprint16::cones(width),
        };
        let points = scene.shading_point16(&wide, wo, &footprint, &options);
        for lane in 0..LANES {
            let surface = scene.surface(&hits[lane]);
            assert_eq!((surface.material, surface.node), (wide.material[lane], wide.node[lane]));
            assert_eq!(surface.front, wide.front.lane(lane));
            let scale = scene.bounds.extent().length();
            let near = |a: Vec3, b: Vec3, bound: f32| {
                assert!((a - b).length() <= bound, "{a} {b}, lane {lane} of {group}");
            };
            near(surface.position, wide.position.lane(lane), 1e-6 * scale);
            let error = surface.error;
            near(error, wide.error.lane(lane), 0.01 * error.length() + f32::MIN_POSITIVE);
            near(surface.geometric_normal, wide.geometric_normal.lane(lane), 1e-4);
            near(surface.shading_normal, wide.shading_normal.lane(lane), 1e-4);
            let seen = match lod {
                TextureLod::Differentials => {
                    Footprint::axes(axes[0].lane(lane), axes[1].lane(lane))
                }
                _ => Footprint::cone(width.0[lane]),
            };
            let point = scene.shading_point(&surface, wo.lane(lane), seen, &options);
            let colours = [
                point.base_color - points.base_color.lane(lane),
                (point.emitted - points.emitted.lane(lane)) / (1.0 + point.emitted.length()),
                Vec3::new(
                    point.metallic - points.metallic.0[lane],
                    point.roughness - points.roughness.0[lane],
                    0.0,
                ),
            ];
            for difference in colours {
                worst[0] = worst[0].max(difference.abs().max_element());
            }
            worst[1] = worst[1].max((point.frame.normal - points.normal.lane(lane)).length());
            let geometric = surface.normal_towards(wo.lane(lane));
            near(geometric, points.geometric_normal.lane(lane), 1e-4);
        }
    }
    worst
}

#[test]
fn sixteen_surfaces_are_sixteen_times_one() {
    for builtin::BuiltinScene { name, .. } in builtin::list() {
        if ["hairball", "terrain"].contains(name) {
            continue;
        }
        let scene = flatten(&builtin::build(name).unwrap());
        let [colour, normal] = compare(&scene, 200, 7);
        assert!(colour <= 1e-3 && normal <= 2e-3, "{name}: {colour} {normal}");
    }
}

#[test]
fn sixteen_textured_surfaces_of_real_scenes_are_sixteen_times_one() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    for file in ["sponza/sponza.gltf", "lost_empire/lost_empire.obj"] {
        let path = shared.join(file);
        if !path.exists() {
            eprintln!("skipped: {file} is not beside the repository");
            continue;
        }
        let scene = flatten(&crate::import::load(&path, &Default::default()).unwrap());
        let [colour, normal] = compare(&scene, 1000, 8);
        eprintln!("{file}: {colour} {normal}");
        assert!(colour <= 2e-3 && normal <= 5e-3, "{file}: {colour} {normal}");
    }
}
