//! OBJ and MTL, feature by feature, in files of a few lines.

use std::{fs, path::Path};

use glam::{Vec2, Vec3};
use rayburst_image::{Rgb8Image, write_png};
use rayburst_scene::{
    AlphaMode, Material, Primitive, Scene, ShadingModel, WrapMode,
    import::{ImportError, LoadOptions, load},
};
use tempfile::TempDir;

use crate::real_meshes::assert_valid;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn read_files(files: &[(&str, &str)]) -> Result<(Scene, TempDir), ImportError> {
    let dir = tempfile::tempdir().expect("temporary folder");
    for (name, text) in files {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().expect("parent")).expect("folder");
        fs::write(path, text).expect("file");
    }
    let scene = load(&dir.path().join(files[0].0), &LoadOptions::default())?;
    assert_valid(&scene);
    Ok((scene, dir))
}

fn read(text: &str) -> Scene {
    read_files(&[("a.obj", text)]).unwrap_or_else(|e| panic!("{e}\n{text}")).0
}

fn only(scene: &Scene) -> &Primitive {
    let [mesh] = &scene.meshes[..] else { panic!("{} meshes", scene.meshes.len()) };
    let [primitive] = &mesh.primitives[..] else { panic!("{}", mesh.primitives.len()) };
    primitive
}

fn material_of(mtl: &str) -> Material {
    let obj = format!("{SQUARE}mtllib a.mtl\nusemtl m\nf 1 2 3 4\n");
    let mtl = format!("newmtl m\n{mtl}\n");
    read_files(&[("a.obj", &obj), ("a.mtl", &mtl)]).unwrap_or_else(|e| panic!("{e}")).0.materials[0]
}

#[test]
fn shared_corners_become_one_vertex() {
    let scene = read(&format!("{SQUARE}f 1 2 3\nf -4 -2 -1\n"));
    let primitive = only(&scene);
    assert_eq!(primitive.positions, [Vec3::ZERO, Vec3::X, Vec3::new(1., 1., 0.), Vec3::Y]);
    assert_eq!(primitive.indices, [[0, 1, 2], [0, 2, 3]]);
    assert!(primitive.normals.is_none() && primitive.uvs.is_empty());
}

#[test]
fn corners_that_differ_in_uv_or_normal_are_split() {
    let scene = read(&format!(
        "{SQUARE}vt 0 0\nvt 1 0.25\nvn 0 0 2\nvn 0 3 4\nf 1/1/1 2/2/1 3/1/1\nf 1/1/1 3/1/2 4/1/1\n"
    ));
    let primitive = only(&scene);
    assert_eq!(primitive.indices, [[0, 1, 2], [0, 3, 4]]);
    assert_eq!(primitive.positions[2], primitive.positions[3]);
    assert_eq!(primitive.uvs[0][0..2], [Vec2::new(0.0, 1.0), Vec2::new(1.0, 0.75)]);
    let normals = primitive.normals.as_ref().expect("normals");
    assert_eq!(normals[2..4], [Vec3::Z, Vec3::new(0.0, 0.6, 0.8)]);
}

#[test]
fn a_concave_polygon_is_cut_inside() {
    let scene = read("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 1 2 3 4 5\n");
    let primitive = only(&scene);
    let area: f32 = primitive
        .indices
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| primitive.positions[i as usize]);
            let signed = (b - a).cross(c - a).z * 0.5;
            assert!(signed > 0.0);
            signed
        })
        .sum();
    assert_eq!((primitive.indices.len(), area), (3, 10.0));
}

#[test]
fn smoothing_groups_smooth_and_group_zero_stays_flat() {
    // Two faces that meet at a right angle along the edge 1-2.
    let fold = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    let smooth = read(&format!("{fold}s 1\nf 1 2 3\nf 1 4 2\n"));
    let normals = only(&smooth).normals.as_ref().expect("normals");
    assert!(normals[0].dot(Vec3::new(0.0, 1.0, 1.0).normalize()) > 0.9999, "{normals:?}");
    assert_eq!(normals.len(), 4);

    let two_groups = read(&format!("{fold}s 1\nf 1 2 3\ns 2\nf 1 4 2\n"));
    let normals = only(&two_groups).normals.as_ref().expect("normals");
    assert_eq!(normals.len(), 6);
    assert!(normals[0..3].iter().all(|n| n.dot(Vec3::Z) > 0.9999));

    assert!(only(&read(&format!("{fold}f 1 2 3\ns off\nf 1 4 2\n"))).normals.is_none());

    let mixed = read(&format!("{fold}vn 0 0 1\nf 1//1 2//1 3//1\nf 1 4 2\n"));
    let normals = only(&mixed).normals.as_ref().expect("normals");
    assert_eq!((normals[0], normals[3]), (Vec3::Z, Vec3::Y));
}

#[test]
fn normals_without_direction_are_replaced() {
    let scene = read(&format!("{SQUARE}vn 0 0 0\nvn nan 0 0\nvn 0 0 1\nf 1//1 2//2 3//3 4//3\n"));
    let normals = only(&scene).normals.as_ref().expect("normals");
    assert!(normals.iter().all(|&n| n == Vec3::Z), "{normals:?}");
}

#[test]
fn each_material_of_each_object_is_a_primitive() {
    let obj = format!(
        "mtllib my materials.mtl\n{SQUARE}o first\nusemtl red\nf 1 2 3\nusemtl Green One\nf 1 3 4\n\
         usemtl red\nf 2 3 4\no second part\nf 1 2 4\nusemtl nowhere\nf 1 2 3\n"
    );
    let mtl = "newmtl red\nKd 1 0 0\nnewmtl Green One\nKd 0 1 0\nnewmtl unused\nmap_Kd x.png\n";
    let (scene, _dir) = read_files(&[("a.obj", &obj), ("my materials.mtl", mtl)]).expect("scene");
    let names: Vec<&str> = scene.nodes.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(names, ["first", "second part"]);
    let counts = |mesh: usize| -> Vec<(usize, u32)> {
        let primitives = &scene.meshes[mesh].primitives;
        primitives.iter().map(|p| (p.indices.len(), p.material)).collect()
    };
    assert_eq!(counts(0), [(2, 0), (1, 1)]);
    assert_eq!(counts(1), [(1, 0), (1, 2)]);
    assert_eq!(scene.material_names, ["red", "Green One", "default"]);
    assert_eq!(scene.materials[1].base_color, [0.0, 1.0, 0.0, 1.0]);
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("nowhere"));
}

#[test]
fn libraries_are_found_in_any_case_and_may_be_missing() {
    let obj = format!("mtllib .\\Lib\\A.MTL missing.mtl\n{SQUARE}usemtl M\nf 1 2 3\n");
    let (scene, _dir) =
        read_files(&[("a.obj", &obj), ("lib/a.mtl", "newmtl m\nKd .5 .5 .5\n")]).expect("scene");
    assert_eq!(scene.materials[0].base_color, [0.5, 0.5, 0.5, 1.0]);
    assert_eq!(scene.warnings.len(), 1);
    assert!(scene.warnings[0].contains("missing.mtl"), "{:?}", scene.warnings);
}

#[test]
fn phong_becomes_metallic_roughness() {
    let matte = material_of("Kd .2 .4 .6\nKs 0 0 0\nNs 40");
    assert_eq!((matte.ior, matte.metallic), (1.0, 0.0));
    assert_eq!(matte.base_color, [0.2, 0.4, 0.6, 1.0]);
    assert!(matte.is_double_sided());

    let plastic = material_of("Kd .5 .5 .5\nKs .5 .5 .5\nNs 30");
    assert!((plastic.ior - 1.5).abs() < 1e-5);
    assert!((plastic.roughness - (2.0_f32 / 32.0).powf(0.25)).abs() < 1e-6);

    let gold = material_of("Kd .3 .2 .1\nKs .9 .7 .3\nNs 100");
    assert_eq!((gold.metallic, gold.base_color), (1.0, [0.9, 0.7, 0.3, 1.0]));
    assert_eq!(material_of("Kd .05 .05 .05\nKs .8 .8 .8").metallic, 1.0);
    assert_eq!(material_of("Kd .8 0 0\nPr 0.25\nPm 1").metallic, 1.0);
    assert_eq!(material_of("Kd .8 0 0\nPr 0.25\nPm 1").roughness, 0.25);

    let lamp = material_of("Kd 1 1 1\nKe 17 12 4");
    assert_eq!(lamp.emissive, [17.0, 12.0, 4.0]);
}

#[test]
fn mirrors_and_glass_are_recognised() {
    let mirror = material_of("Kd .01 .01 .01\nKs .95 .95 .9\nNs 1000\nillum 5");
    assert_eq!(mirror.model(), ShadingModel::Mirror);
    assert_eq!(mirror.base_color, [0.95, 0.95, 0.9, 1.0]);

    let glass = material_of("Kd .01 .01 .01\nKs .3 .3 .3\nTf .1 .1 .025\nNi 1.33\nillum 7");
    assert_eq!((glass.model(), glass.ior), (ShadingModel::Dielectric, 1.33));
    assert_eq!(glass.base_color, [1.0, 1.0, 0.5, 1.0]);

    let pane = material_of("Kd .1 .1 .1\nKs .9 .9 .9\nNi 1.5\nd .3");
    assert_eq!(pane.model(), ShadingModel::Dielectric);
    assert_eq!(material_of("Kd 1 1 1\nNi 1.5\nillum 2").model(), ShadingModel::MetallicRoughness);
}

#[test]
fn dissolve_and_transparency_are_read_both_ways() {
    let alpha = |mtl: &str| {
        let material = material_of(mtl);
        (material.base_color[3], material.alpha_mode())
    };
    assert_eq!(alpha("d 0.75"), (0.75, AlphaMode::Blend));
    assert_eq!(alpha("Tr 0.25"), (0.75, AlphaMode::Blend));
    assert_eq!(alpha("d 1\nTr 0"), (1.0, AlphaMode::Opaque));
    assert_eq!(alpha("Tr 1"), (1.0, AlphaMode::Opaque));
    assert_eq!(alpha("d 1\nTr 1"), (1.0, AlphaMode::Opaque));
}

fn png(path: &Path, size: u32, texel: impl Fn(u32, u32) -> [u8; 3]) {
    let data = (0..size * size).flat_map(|i| texel(i % size, i / size)).collect();
    write_png(path, &Rgb8Image { width: size, height: size, data }).expect("png");
}

#[test]
fn maps_are_found_placed_and_combined() {
    let obj = format!("mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3 4\n");
    let mtl = "newmtl m\nKd 0 0 0\nmap_Kd -s 2 4 -o 0.5 0.25 -clamp on C:\\art\\Base Color.PNG\n\
               map_d mask.png\nmap_Pr rough.png\nmap_Pm metal.png\nnorm missing.png\n\
               map_Ke base color.png\nbump mask.png\nmap_Ks mask.png\n";
    let dir = tempfile::tempdir().expect("temporary folder");
    fs::write(dir.path().join("a.obj"), &obj).expect("obj");
    fs::write(dir.path().join("a.mtl"), mtl).expect("mtl");
    png(&dir.path().join("base color.png"), 8, |_, _| [255, 128, 0]);
    png(&dir.path().join("mask.png"), 8, |x, _| [if x < 4 { 0 } else { 255 }; 3]);
    png(&dir.path().join("rough.png"), 8, |x, _| [x as u8 * 10; 3]);
    png(&dir.path().join("metal.png"), 4, |x, _| [x as u8 * 50; 3]);
    let scene = load(&dir.path().join("a.obj"), &LoadOptions::default()).expect("scene");
    assert_valid(&scene);

    let material = scene.materials[0];
    assert_eq!(material.base_color, [1.0; 4]);
    assert_eq!(material.emissive, [1.0; 3]);
    assert_eq!(material.alpha_mode(), AlphaMode::Mask);
    assert_eq!((material.roughness, material.metallic), (1.0, 1.0));
    let base = material.base_color_texture;
    assert_eq!(scene.textures[base.texture as usize].wrap, [WrapMode::ClampToEdge; 2]);
    // MTL: (u, v up) → (2 u + 0.5, 4 v + 0.25); ours has v down.
    let (u, v_up) = (0.125, 0.5);
    let placed = base.apply(Vec2::new(u, 1.0 - v_up));
    assert_eq!(placed, Vec2::new(2.0 * u + 0.5, 1.0 - (4.0 * v_up + 0.25)));
    let combined = material.metallic_roughness_texture;
    let image = &scene.images[scene.textures[combined.texture as usize].image as usize];
    let texel = image.texel(0, 6, 3).map(|x| (x * 255.0).round() as u8);
    assert_eq!(texel[1..3], [60, 150]);
    let warned = |word: &str| scene.warnings.iter().any(|w| w.contains(word));
    assert!(warned("missing.png") && warned("map_Ks"), "{:?}", scene.warnings);
    assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
}

#[test]
fn height_maps_are_told_from_normal_maps() {
    for (blue, expected) in [(250, true), (128, false)] {
        let dir = tempfile::tempdir().expect("temporary folder");
        let obj = format!("mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n");
        fs::write(dir.path().join("a.obj"), obj).expect("obj");
        fs::write(dir.path().join("a.mtl"), "newmtl m\nmap_Bump -bm 0.5 b.png\n").expect("mtl");
        png(&dir.path().join("b.png"), 4, |_, _| [128, 128, blue]);
        let scene = load(&dir.path().join("a.obj"), &LoadOptions::default()).expect("scene");
        let material = scene.materials[0];
        assert_eq!(material.normal_texture.index().is_some(), expected);
        assert_eq!(material.normal_scale, if expected { 0.5 } else { 1.0 });
        assert_eq!(scene.warnings.is_empty(), expected, "{:?}", scene.warnings);
    }
}

#[test]
fn vertex_colours_are_srgb() {
    let scene = read("v 0 0 0 1 0 0.5\nv 1 0 0 1 1 1\nv 0 1 0 0 0 0\nf 1 2 3\n");
    let colors = only(&scene).colors.as_ref().expect("colours");
    assert_eq!(colors[0].truncate(), Vec3::new(1.0, 0.0, rayburst_image::colour::srgb_decode(0.5)));
    assert_eq!(scene.materials[0].base_color, [1.0; 4]);
}

#[test]
fn broken_faces_are_left_out_with_a_warning() {
    let scene = read(&format!("{SQUARE}v 1e999 0 0\nf 1 2 3\nf 1 2 5\nf 1 2 99\nf 0 1 2\nf 1 2\n"));
    assert_eq!(only(&scene).indices.len(), 1);
    assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
}

#[test]
fn files_without_faces_are_errors() {
    for text in ["", "# nothing\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "f 1 2 3\n", "\0\0\0"] {
        let error = read_files(&[("a.obj", text)]).expect_err(text);
        assert!(matches!(error, ImportError::Malformed { .. }), "{error}");
        assert!(error.to_string().contains("a.obj"), "{error}");
    }
}
