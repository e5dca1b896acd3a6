use std::{collections::HashMap, sync::LazyLock};

use glam::Vec3;
use rayburst_math::hash;

use super::*;
use crate::{Material, Primitive, ShadingModel, shapes};

/// Every scene at a size that tests can afford, built once.
static SMALL: LazyLock<Vec<Scene>> = LazyLock::new(|| list().iter().map(build_small).collect());

fn build_small(scene: &BuiltinScene) -> Scene {
    let spec = match scene.parameters.first() {
        Some(Parameter { name: "triangles", .. }) => format!("{}:20000", scene.name),
        Some(Parameter { name: "rows", .. }) => format!("{}:3", scene.name),
        _ => scene.name.to_owned(),
    };
    build(&spec).unwrap()
}

fn small_scenes() -> impl Iterator<Item = (&'static BuiltinScene, &'static Scene)> {
    list().iter().zip(&*SMALL)
}

fn primitives(scene: &Scene) -> impl Iterator<Item = &Primitive> {
    scene.meshes.iter().flat_map(|m| &m.primitives).map(|p| &**p)
}

fn bits(v: Vec3) -> [u32; 3] {
    // Adding 0 makes −0 equal to 0.
    (v + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// How often each directed edge occurs; vertices at the same place count as one.
fn edges<'a>(parts: impl Iterator<Item = &'a Primitive>) -> HashMap<([u32; 3], [u32; 3]), i32> {
    let mut edges = HashMap::new();
    for part in parts {
        for t in &part.indices {
            let corner = t.map(|i| bits(part.positions[i as usize]));
            for k in 0..3 {
                *edges.entry((corner[k], corner[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
    }
    edges
}

/// Every edge is passed as often one way as the other: the surface is closed and evenly wound.
fn assert_closed(name: &str, part: &Primitive) {
    let edges = edges(std::iter::once(part));
    let open = edges.iter().filter(|((a, b), n)| edges.get(&(*b, *a)) != Some(n)).count();
    assert_eq!(open, 0, "{name}: {open} of {} edges are open", edges.len());
}

#[test]
fn every_scene_is_sound() {
    for (entry, scene) in small_scenes() {
        let name = entry.name;
        assert_eq!(scene.name, name);
        assert!(!scene.views.is_empty(), "{name} has no view");
        assert!(scene.has_light(), "{name} is dark");
        assert!(scene.placed_triangles() > 0);
        assert_eq!(scene.materials.len(), scene.material_names.len());
        for part in primitives(scene) {
            assert!((part.material as usize) < scene.materials.len(), "{name}");
            let vertices = part.positions.len();
            assert!(part.positions.iter().all(|p| p.is_finite()), "{name}");
            assert!(part.indices.iter().flatten().all(|&i| (i as usize) < vertices), "{name}");
            assert!(part.uvs.iter().all(|uv| uv.len() == vertices), "{name}");
            assert!(part.colors.iter().all(|c| c.len() == vertices), "{name}");
        }
    }
}

#[test]
fn normals_are_unit_and_agree_with_the_winding() {
    for (entry, scene) in small_scenes() {
        for part in primitives(scene) {
            let Some(normals) = &part.normals else { continue };
            assert_eq!(normals.len(), part.positions.len());
            assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4), "{}", entry.name);
            let against = part.indices.iter().filter(|t| {
                let [a, b, c] = t.map(|i| part.positions[i as usize]);
                let face = (b - a).cross(c - a);
                let mean: Vec3 = t.iter().map(|&i| normals[i as usize]).sum();
                face.normalize_or_zero().dot(mean) < -1e-3
            });
            // A coarse height field has a few ridges too sharp for its smoothed normals.
            let (against, all) = (against.count(), part.indices.len());
            assert!(against * 1000 <= all, "{}: {against} of {all} against normals", entry.name);
        }
    }
}

#[test]
fn materials_reflect_no_more_than_they_receive() {
    for (entry, scene) in small_scenes() {
        for material in &scene.materials {
            let fits = |v: f32| (0.0..=1.0).contains(&v);
            assert!(material.base_color.iter().all(|&c| fits(c)), "{}", entry.name);
            assert!(fits(material.roughness) && fits(material.metallic));
            assert!(material.ior >= 1.0);
            assert!(material.emissive.iter().all(|&e| (0.0..1e6).contains(&e)));
        }
    }
}

#[test]
fn two_builds_are_equal() {
    let fingerprint = |scene: &Scene| {
        primitives(scene).fold(0, |h, part| {
            let floats = part.positions.iter().chain(part.normals.iter().flatten());
            let h = floats.fold(h, |h, v| hash::words(&[h, hash::words(&bits(*v))]));
            part.indices.iter().flatten().fold(h, |h, &i| hash::combine(h, i))
        })
    };
    for (entry, a) in small_scenes() {
        let b = build_small(entry);
        assert_eq!(fingerprint(a), fingerprint(&b), "{}", entry.name);
        assert_eq!(a.materials, b.materials, "{}", entry.name);
    }
}

#[test]
fn sizes_are_met_and_bounded() {
    for entry in list() {
        let Some(Parameter { name: "triangles", kind, .. }) = entry.parameters.first() else {
            continue;
        };
        for size in [20_000u32, 150_000] {
            let count = build(&format!("{}:{size}", entry.name)).unwrap().placed_triangles();
            let ratio = count as f64 / f64::from(size);
            assert!((0.8..1.25).contains(&ratio), "{}:{size} has {count} triangles", entry.name);
        }
        let ParameterKind::Number { max, .. } = kind else { panic!("a size is a number") };
        let error = build(&format!("{}:{}", entry.name, max * 2.0)).unwrap_err();
        assert!(error.to_string().contains("expected a number from"), "{error}");
    }
}

#[test]
fn wrong_specifications_say_what_is_right() {
    let says = |spec: &str, part: &str| {
        let message = build(spec).unwrap_err().to_string();
        assert!(message.contains(part), "{spec}: {message}");
    };
    says("cornel", "did you mean 'cornell'");
    says("", "There are: cornell, ");
    says("spheres:7", "takes none");
    says("furnace:colour=red", "takes material, roughness");
    says("furnace:wood", "expected one of diffuse, metal");
    says("furnace:roughness=nan", "expected a number from 0 to 1");
    says("furnace:roughness=1e9", "expected a number from 0 to 1");
    assert!(build("furnace:metal,roughness=0.25").is_ok());
}

#[test]
fn the_default_scene_is_listed_first() {
    assert_eq!(list()[0].name, DEFAULT);
}

#[test]
fn cornell_has_the_measured_colours() {
    let scene = build("cornell").unwrap();
    let color = |name: &str| {
        let index = scene.material_names.iter().position(|n| n == name).unwrap();
        Vec3::from_slice(&scene.materials[index].base_color)
    };
    let (white, red, green) = (color("white"), color("red"), color("green"));
    assert!(white.min_element() > 0.68 && white.max_element() < 0.78, "{white}");
    assert!(red.x > 0.4 && red.y < 0.1 && red.z < 0.1, "{red}");
    assert!(green.y > 0.3 && green.x < 0.2 && green.z < 0.2, "{green}");
}

#[test]
fn emitters_of_rooms_face_the_room() {
    for name in ["cornell", "hemisphere-room"] {
        let scene = build(name).unwrap();
        let eye = Vec3::from(scene.views[0].camera.transform.translation);
        let mut found = 0;
        for part in primitives(&scene) {
            if scene.materials[part.material as usize].is_emissive() {
                for t in &part.indices {
                    let [a, b, c] = t.map(|i| part.positions[i as usize]);
                    assert!((b - a).cross(c - a).dot(eye - a) > 0.0, "{name}");
                    found += 1;
                }
            }
        }
        assert!(found > 0, "{name}");
    }
}

#[test]
fn glass_is_closed() {
    for (entry, scene) in small_scenes() {
        for part in primitives(scene) {
            let material: &Material = &scene.materials[part.material as usize];
            if material.model() == ShadingModel::Dielectric {
                assert_closed(entry.name, part);
            }
        }
    }
    assert_closed("glass sphere", primitives(&build("furnace:glass").unwrap()).next().unwrap());
}

#[test]
fn solids_are_closed() {
    let closed = |name: &str, shape: shapes::Shape| assert_closed(name, &shape.into_primitive(0));
    let mut cuboid = shapes::Shape::default();
    cuboid.add_box(Vec3::ZERO, Vec3::ONE);
    closed("box", cuboid);
    closed("sphere", shapes::sphere(Vec3::ONE, 2.0, 3));
    closed("hemisphere", shapes::hemisphere(Vec3::ONE, 2.0, 24));
    closed("teapot", shapes::teapot(7));
    let mut tube = shapes::Shape::default();
    let line = [Vec3::ZERO, Vec3::X, Vec3::new(1.5, 1.0, 0.2), Vec3::new(0.0, 2.0, 1.0)];
    shapes::tube(&mut tube, &line, |_| 0.1, 5);
    assert_eq!(tube.indices.len(), 2 * 5 * 4);
    closed("tube", tube);
}

#[test]
fn the_teapot_has_newells_measures() {
    let pot = shapes::teapot(16);
    let (min, max) = pot
        .positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)));
    // The handle's bulge at x = −3, the spout's lip, the body's radius 2, the knob at 3.15.
    assert!((min - Vec3::new(-3.0, 0.0, -2.0)).abs().max_element() < 0.02, "{min}");
    assert!((max - Vec3::new(3.434, 3.15, 2.0)).abs().max_element() < 0.02, "{max}");
    // Volume by the divergence theorem, f64: positive when wound outwards.
    let volume: f64 = pot
        .indices
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| pot.positions[i as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        })
        .sum();
    assert!((20.0..30.0).contains(&volume), "{volume}");
}
