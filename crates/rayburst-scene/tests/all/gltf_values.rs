//! Exact values out of small files.

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use rayburst_scene::{
    AlphaMode, LightKind, Pose, Primitive, Projection, Scene, ShadingModel, TextureSlot, WrapMode,
};
use serde_json::json;

use super::glb::{F32, Glb, I8, I16, PIXEL, U8, U16, U32};

fn only(scene: &Scene) -> &Primitive {
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.meshes[0].primitives.len(), 1);
    &scene.meshes[0].primitives[0]
}

fn five_points() -> (Glb, usize) {
    let mut file = Glb::new();
    let points: Vec<f32> = (0..5).flat_map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    let position = file.floats(&points, "VEC3");
    (file, position)
}

#[test]
fn lists_strips_and_fans() {
    let cases = [
        (4, vec![[0, 1, 2]], 1),
        (5, vec![[0, 1, 2], [1, 3, 2], [2, 3, 4]], 0),
        (6, vec![[1, 2, 0], [2, 3, 0], [3, 4, 0]], 0),
    ];
    for (mode, triangles, warnings) in cases {
        let (mut file, position) = five_points();
        file.primitive(json!({"attributes": {"POSITION": position}, "mode": mode}));
        let scene = file.load().unwrap();
        assert_eq!(only(&scene).indices, triangles, "mode {mode}");
        assert_eq!(scene.warnings.len(), warnings, "{:?}", scene.warnings);
    }
    let (mut file, position) = five_points();
    let indices = file.indices(&[4, 3, 2, 1]);
    file.primitive(json!({"attributes": {"POSITION": position}, "indices": indices, "mode": 5}));
    for mode in [0, 1, 2, 3] {
        file.primitive(json!({"attributes": {"POSITION": position}, "mode": mode}));
    }
    let scene = file.load().unwrap();
    assert_eq!(only(&scene).indices, [[4, 3, 2], [3, 1, 2]]);
    assert_eq!(only(&scene).positions.len(), 5);
    assert_eq!(scene.warnings.len(), 2, "one for points, one for lines: {:?}", scene.warnings);
}

#[test]
fn every_component_type_is_converted() {
    let cases: [(u32, bool, &[u8], [f32; 3]); 9] = [
        (I8, false, &[127, 129, 0], [127.0, -127.0, 0.0]),
        (I8, true, &[127, 128, 64], [1.0, -1.0, 64.0 / 127.0]),
        (U8, false, &[255, 1, 0], [255.0, 1.0, 0.0]),
        (U8, true, &[255, 51, 0], [1.0, 0.2, 0.0]),
        (I16, false, &[255, 127, 0, 128, 1, 0], [32_767.0, -32_768.0, 1.0]),
        (I16, true, &[255, 127, 0, 128, 0, 0], [1.0, -1.0, 0.0]),
        (U16, false, &[255, 255, 1, 0, 0, 1], [65_535.0, 1.0, 256.0]),
        (U16, true, &[255, 255, 0, 0, 51, 51], [1.0, 0.0, 0.2]),
        (U32, false, &[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], [1.0, 256.0, 65_536.0]),
    ];
    for (component, normalized, bytes, expected) in cases {
        let mut file = Glb::new();
        let padded = bytes.repeat(3);
        let position = file.accessor(&padded, component, "VEC3", 3);
        file.json["accessors"][position]["normalized"] = normalized.into();
        file.primitive(json!({"attributes": {"POSITION": position}}));
        let scene = file.load().unwrap();
        assert_eq!(only(&scene).positions[2], Vec3::from(expected), "{component} {normalized}");
    }
}

#[test]
fn strides_offsets_and_index_types() {
    let mut file = Glb::new();
    // Positions and 8-bit UVs interleaved at 16 bytes, after 8 bytes of something else.
    let mut bytes = vec![0xff; 8];
    for i in 0..4u8 {
        for x in [f32::from(i), 10.0, -f32::from(i)] {
            bytes.extend(x.to_le_bytes());
        }
        bytes.extend([i * 51, 255, 0xee, 0xee]);
    }
    let view = file.view(&bytes);
    file.json["bufferViews"][view]["byteStride"] = 16.into();
    let position = file.push(
        "accessors",
        json!({"bufferView": view, "byteOffset": 8, "componentType": F32, "type": "VEC3", "count": 4}),
    );
    let uv = file.push(
        "accessors",
        json!({"bufferView": view, "byteOffset": 20, "componentType": U8, "type": "VEC2",
               "count": 4, "normalized": true}),
    );
    for (component, bytes) in [
        (U8, vec![3, 1, 0]),
        (U16, vec![3, 0, 1, 0, 0, 0]),
        (U32, vec![3, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]),
    ] {
        let mut file = file.clone();
        let indices = file.accessor(&bytes, component, "SCALAR", 3);
        file.primitive(json!({
            "attributes": {"POSITION": position, "TEXCOORD_0": uv}, "indices": indices,
        }));
        let scene = file.load().unwrap();
        let primitive = only(&scene);
        let [a, b, c] = primitive.indices[0].map(|i| i as usize);
        let positions = [a, b, c].map(|i| primitive.positions[i].to_array());
        assert_eq!(positions, [[3.0, 10.0, -3.0], [1.0, 10.0, -1.0], [0.0, 10.0, 0.0]]);
        assert!(primitive.uvs[0][a].abs_diff_eq(Vec2::new(0.6, 1.0), 1e-7));
    }
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut file = Glb::new();
    let indices = file.view(&[1, 0, 2, 0]);
    let values: Vec<u8> = [1f32, 2., 3., 4., 5., 6.].iter().flat_map(|x| x.to_le_bytes()).collect();
    let values = file.view(&values);
    let sparse = json!({
        "count": 2,
        "indices": {"bufferView": indices, "componentType": U16},
        "values": {"bufferView": values},
    });
    let base = file.floats(&[9.0; 9], "VEC3");
    for with_base in [true, false] {
        let mut file = file.clone();
        file.json["accessors"][base]["sparse"] = sparse.clone();
        if !with_base {
            file.json["accessors"][base].as_object_mut().unwrap().remove("bufferView");
        }
        file.primitive(json!({"attributes": {"POSITION": base}}));
        let scene = file.load().unwrap();
        let first = if with_base { Vec3::splat(9.0) } else { Vec3::ZERO };
        let expected = [first, Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)];
        assert_eq!(only(&scene).positions, expected);
    }
    file.json["accessors"][base]["sparse"] = sparse;
    file.json["accessors"][base]["sparse"]["count"] = 3.into();
    file.primitive(json!({"attributes": {"POSITION": base}}));
    assert!(
        file.error().contains("/accessors/0/sparse: its indices go beyond"),
        "{}",
        file.error()
    );
}

#[test]
fn primitives_keep_what_they_use_of_a_shared_buffer() {
    let mut file = Glb::new();
    let points: Vec<f32> = (0..100).flat_map(|i| [i as f32, 0.0, 0.0]).collect();
    let position = file.floats(&points, "VEC3");
    let normal = file.floats(&points, "VEC3");
    let indices = file.indices(&[90, 7, 50, 50, 7, 8]);
    file.primitive(json!({
        "attributes": {"POSITION": position, "NORMAL": normal}, "indices": indices,
    }));
    let scene = file.load().unwrap();
    let primitive = only(&scene);
    let x: Vec<f32> = primitive.positions.iter().map(|p| p.x).collect();
    assert_eq!(x, [7.0, 8.0, 50.0, 90.0]);
    assert_eq!(primitive.indices, [[3, 0, 2], [2, 0, 1]]);
    assert_eq!(primitive.normals.as_deref(), Some(&[Vec3::X; 4][..]));
}

#[test]
fn colours_come_with_and_without_alpha() {
    let cases: [(u32, &str, Vec<u8>, Vec4); 3] = [
        (U8, "VEC3", [255, 0, 51].repeat(3), Vec4::new(1.0, 0.0, 0.2, 1.0)),
        (U8, "VEC4", [255, 0, 51, 102].repeat(3), Vec4::new(1.0, 0.0, 0.2, 0.4)),
        (U16, "VEC4", [255, 255, 0, 0, 51, 51, 102, 102].repeat(3), Vec4::new(1.0, 0.0, 0.2, 0.4)),
    ];
    for (component, kind, bytes, expected) in cases {
        let mut file = Glb::new();
        file.triangle();
        let color = file.accessor(&bytes, component, kind, 3);
        file.json["accessors"][color]["normalized"] = true.into();
        file.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = color.into();
        let scene = file.load().unwrap();
        assert!(only(&scene).colors.as_ref().unwrap()[1].abs_diff_eq(expected, 1e-6));
    }
}

#[test]
fn materials_are_read_with_their_extensions() {
    let mut file = Glb::new();
    file.triangle();
    file.json["meshes"][0]["primitives"][0]["material"] = 0.into();
    file.push("images", json!({"uri": PIXEL}));
    file.push(
        "samplers",
        json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9985}),
    );
    file.push("textures", json!({"source": 0, "sampler": 0}));
    file.push(
        "materials",
        json!({
            "name": "paint",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.6,
                "baseColorTexture": {
                    "index": 0, "texCoord": 1,
                    "extensions": {"KHR_texture_transform": {
                        "offset": [0.25, 0.5], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 3],
                        "texCoord": 0,
                    }},
                },
                "metallicRoughnessTexture": {"index": 0},
            },
            "emissiveFactor": [1, 0.5, 0], "emissiveTexture": {"index": 0, "texCoord": 1},
            "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
            "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 8},
                "KHR_materials_ior": {"ior": 1.33},
                "KHR_materials_sheen": {}, "KHR_materials_clearcoat": {"clearcoatFactor": 1},
            },
        }),
    );
    file.push(
        "materials",
        json!({"extensions": {"KHR_materials_unlit": {}}, "alphaMode": "BLEND"}),
    );
    let scene = file.load().unwrap();
    let [paint, unlit] = &scene.materials[..] else { panic!("{}", scene.materials.len()) };
    assert_eq!(scene.material_names[0], "paint");
    assert_eq!(paint.base_color, [0.1, 0.2, 0.3, 0.4]);
    assert_eq!((paint.metallic, paint.roughness, paint.ior), (0.5, 0.6, 1.33));
    assert_eq!(paint.emissive, [8.0, 4.0, 0.0]);
    assert_eq!((paint.alpha_mode(), paint.alpha_cutoff), (AlphaMode::Mask, 0.25));
    assert!(paint.is_double_sided() && !unlit.is_double_sided());
    assert_eq!((unlit.model(), unlit.alpha_mode()), (ShadingModel::Unlit, AlphaMode::Blend));

    // The same image as colour and as data is two images; colour twice is one.
    assert_eq!((scene.images.len(), scene.textures.len()), (2, 2));
    assert_eq!(paint.base_color_texture.texture, paint.emissive_texture.texture);
    assert_ne!(paint.base_color_texture.texture, paint.metallic_roughness_texture.texture);
    assert_eq!(scene.textures[0].wrap, [WrapMode::ClampToEdge, WrapMode::MirroredRepeat]);

    // u' = cos·2u + sin·3v + 0.25, v' = −sin·2u + cos·3v + 0.5
    assert_eq!(paint.base_color_texture.uv_set, 0);
    assert_eq!(paint.emissive_texture.uv_set, 1);
    let moved = paint.base_color_texture.apply(Vec2::new(0.5, 0.125));
    assert!(moved.abs_diff_eq(Vec2::new(0.625, -0.5), 1e-6), "{moved}");

    assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("KHR_materials_clearcoat"), "{:?}", scene.warnings);
}

#[test]
fn high_uv_sets_move_to_the_front() {
    let mut file = Glb::new();
    file.triangle();
    let uv = file.floats(&[0.5; 6], "VEC2");
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = uv.into();
    primitive["material"] = 0.into();
    let other = file.floats(&[0.75; 6], "VEC2");
    file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_3"] = other.into();
    file.push("images", json!({"uri": PIXEL}));
    file.push("textures", json!({"source": 0}));
    file.push("materials", json!({"emissiveTexture": {"index": 0, "texCoord": 3}}));
    let scene = file.load().unwrap();
    assert_eq!(scene.materials[0].emissive_texture.uv_set, 0);
    assert_eq!(only(&scene).uvs, [vec![Vec2::splat(0.75); 3]]);
}

#[test]
fn pictures_that_cannot_be_read_leave_a_warning() {
    let cases = [
        (json!({"uri": "missing.png"}), "missing.png"),
        (json!({"uri": "../../secret.png"}), "leaves the scene's folder"),
        (json!({"uri": "https://example.org/a.png"}), "never fetched"),
        (json!({"uri": "data:image/png;base64,AAAA"}), "image 0"),
    ];
    for (image, text) in cases {
        let mut file = Glb::new();
        file.triangle();
        file.json["meshes"][0]["primitives"][0]["material"] = 0.into();
        file.push("images", image);
        file.push("textures", json!({"source": 0}));
        let glow = json!({
            "normalTexture": {"index": 0}, "emissiveTexture": {"index": 0},
            "emissiveFactor": [1, 1, 1],
        });
        file.push("materials", glow);
        let scene = file.load().unwrap();
        assert_eq!(scene.materials[0].normal_texture, TextureSlot::NONE);
        assert!(!scene.materials[0].is_emissive(), "all of it would glow");
        // Once as data, once as colour.
        assert!(scene.warnings.len() <= 2, "{:?}", scene.warnings);
        assert!(scene.warnings[0].contains(text), "{:?}", scene.warnings);
    }
}

#[test]
fn the_default_scene_is_shown_with_parents_first() {
    let mut file = Glb::new();
    file.triangle();
    file.json["scene"] = 1.into();
    file.json["scenes"] = json!([{"nodes": [0]}, {"name": "shown", "nodes": [3, 1]}]);
    file.json["nodes"] = json!([
        {"name": "hidden", "mesh": 0},
        {"name": "b", "camera": 0, "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]},
        {"name": "child", "camera": 1, "translation": [1, 0, 0],
         "extensions": {"KHR_lights_punctual": {"light": 1}}},
        {"name": "a", "children": [2], "rotation": [0, 0, 2, 2], "scale": [2, 2, 2]},
    ]);
    file.json["cameras"] = json!([
        {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 3, "znear": 0, "zfar": 9}},
    ]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 2, "color": [1, 0.5, 0]},
        {"type": "spot", "spot": {"outerConeAngle": 0.5}},
        {"type": "directional"},
    ]}});
    let scene = file.load().unwrap();
    let names: Vec<&str> = scene.nodes.iter().map(|n| n.name.as_str()).collect();
    assert_eq!((scene.name.as_str(), names), ("shown", vec!["a", "child", "b"]));
    assert_eq!(scene.nodes[1].parent, Some(0));
    assert!(scene.meshes.is_empty());
    let pose = Pose::rest(&scene);
    let at = |node: usize| Vec3::from(pose.world[node].translation);
    assert!(at(1).abs_diff_eq(Vec3::new(0.0, 2.0, 0.0), 1e-6), "a quarter turn, twice as large");
    assert_eq!(at(2), Vec3::new(5.0, 6.0, 7.0));
    assert_eq!(scene.cameras[0].projection, Projection::Perspective { fov: 0.5 });
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic { half_height: 3.0 });
    assert_eq!(scene.lights[0].intensity, Vec3::new(2.0, 1.0, 0.0));
    let LightKind::Spot { cos_inner, cos_outer, .. } = scene.lights[1].kind else { panic!() };
    assert_eq!((cos_inner, cos_outer), (1.0, 0.5f32.cos()));
    assert_eq!(scene.nodes[1].light, Some(1));
}

#[test]
fn graphs_that_are_no_trees_are_errors() {
    let cases = [
        (json!([{"children": [1]}, {"children": [2]}, {"children": [1]}]), "child of both"),
        (json!([{"children": [1]}, {"children": [0]}]), "reached twice"),
        (json!([{"children": [0]}]), "reached twice"),
        (json!([{"children": [7]}]), "there is no node 7"),
        (json!([{"mesh": 3}]), "there is no mesh 3"),
        (json!([{"scale": [1e38, 1e38, 1e39]}]), "not finite"),
    ];
    for (nodes, text) in cases {
        let mut file = Glb::new();
        file.triangle();
        file.json["nodes"] = nodes;
        assert!(file.error().contains(text), "{}", file.error());
        file.json.as_object_mut().unwrap().remove("scene");
        file.json.as_object_mut().unwrap().remove("scenes");
        assert!(file.load().is_err());
    }
}

#[test]
fn a_hundred_thousand_levels_are_no_problem() {
    let mut file = Glb::new();
    file.triangle();
    let count = 100_000;
    let nodes: Vec<_> = (0..count)
        .map(|i| if i + 1 < count { json!({"children": [i + 1]}) } else { json!({"mesh": 0}) })
        .collect();
    file.json["nodes"] = nodes.into();
    assert_eq!(file.load().unwrap().nodes.len(), count);
}

#[test]
fn gpu_instances_are_placed() {
    let mut file = Glb::new();
    file.triangle();
    let translation = file.floats(&[1., 0., 0., 0., 2., 0.], "VEC3");
    let rotation = file.accessor(&[0, 0, 0, 127, 0, 127, 0, 0], I8, "VEC4", 2);
    file.json["accessors"][rotation]["normalized"] = true.into();
    file.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {
        "attributes": {"TRANSLATION": translation, "ROTATION": rotation},
    }});
    file.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = file.load().unwrap();
    assert_eq!(scene.placed_triangles(), 2);
    let instances = &scene.nodes[0].instances;
    assert_eq!(instances[0].transform_point3(Vec3::X), Vec3::new(2.0, 0.0, 0.0));
    assert!(instances[1].transform_point3(Vec3::X).abs_diff_eq(Vec3::new(-1.0, 2.0, 0.0), 1e-6));
}

/// A skinned, morphed, animated triangle.
pub(crate) fn creature() -> Glb {
    let mut file = Glb::new();
    file.triangle();
    let joints = file.accessor(&[0, 1, 9, 9, 1, 0, 0, 0, 0, 0, 0, 0], U8, "VEC4", 3);
    let weights = file.floats(&[3., 1., 0., 0., 2., 0., 0., 0., 0., 0., 0., 0.], "VEC4");
    let delta = file.floats(&[0., 0., 1., 0., 0., 2., 0., 0., 3.], "VEC3");
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = joints.into();
    primitive["attributes"]["WEIGHTS_0"] = weights.into();
    primitive["targets"] = json!([{"POSITION": delta}, {"POSITION": delta}]);
    file.json["meshes"][0]["weights"] = json!([0.5, 0]);
    let shift = Mat4::from_translation(Vec3::new(0.0, -1.0, 0.0)).to_cols_array();
    let bind = file.floats(&[Mat4::IDENTITY.to_cols_array(), shift].concat(), "MAT4");
    file.json["skins"] = json!([{"joints": [2, 1], "inverseBindMatrices": bind}]);
    // The second joint hangs from a node outside the scene.
    file.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "children": [1]}, {"translation": [0, 1, 0]}, {}, {"children": [2]},
    ]);
    let times = file.floats(&[0.0, 2.0], "SCALAR");
    let turn = Quat::from_rotation_z(1.0).to_array();
    let turns = file.floats(&[[0.0, 0.0, 0.0, 1.0], turn].concat(), "VEC4");
    let weights = file.floats(&[0., 1., 1., 0.], "SCALAR");
    // In-tangent, value, out-tangent of two keys.
    let mut moves = [0.0; 18];
    (moves[5], moves[6], moves[13]) = (1.0, 4.0, 2.0);
    let moves = file.floats(&moves, "VEC3");
    file.json["animations"] = json!([{
        "name": "all",
        "samplers": [
            {"input": times, "output": turns},
            {"input": times, "output": weights, "interpolation": "STEP"},
            {"input": times, "output": moves, "interpolation": "CUBICSPLINE"},
        ],
        "channels": [
            {"sampler": 0, "target": {"node": 1, "path": "rotation"}},
            {"sampler": 1, "target": {"node": 0, "path": "weights"}},
            {"sampler": 2, "target": {"node": 2, "path": "translation"}},
        ],
    }]);
    file
}

#[test]
fn skins_morphs_and_animations_meet() {
    let scene = creature().load().unwrap();
    assert_eq!(scene.nodes.len(), 4);
    let skin = only(&scene).skin.as_ref().unwrap();
    assert_eq!(skin[0].weights[..2], [0.75, 0.25]);
    assert_eq!((skin[1].joints[0], skin[1].weights[0]), (1, 1.0));
    assert_eq!(skin[2].weights[0], 1.0, "a vertex without weights follows the first joint");
    let rest = Pose::rest(&scene);
    assert_eq!(rest.weights[0], [0.5, 0.0]);

    assert_eq!(scene.animations[0].duration, 2.0);
    let pose = Pose::at(&scene, &[0], 1.0);
    assert_eq!(pose.weights[0], [0.0, 1.0]);
    let joint = scene.skins[0].joints[1] as usize;
    let turned = pose.world[joint].transform_vector3(Vec3::X);
    let expected = Vec3::new(0.5f32.cos(), 0.5f32.sin(), 0.0);
    assert!(turned.abs_diff_eq(expected, 1e-6), "half of the turn: {turned}");
    // Halfway: half the values, in y: 1/2 · 2; x leaves with 4 · 2 · 1/8, z keeps half of 1.
    let at = pose.world[scene.skins[0].joints[0] as usize].translation;
    assert_eq!(Vec3::from(at), Vec3::new(1.0, 1.0, 0.5));
    let joints = pose.joint_matrices(&scene, 0);
    let bent = rayburst_scene::deform::deform(only(&scene), &pose.weights[0], Some(&joints));
    // The second vertex follows the turned joint alone, after its morph and bind offset.
    let expected = pose.world[joint].transform_point3(Vec3::new(1.0, -1.0, 2.0));
    assert!(bent.positions[1].abs_diff_eq(expected, 1e-6), "{}", bent.positions[1]);
}

#[test]
fn keys_out_of_order_are_left_out() {
    let mut file = creature();
    let times = file.floats(&[1.0, 1.0], "SCALAR");
    file.json["animations"][0]["samplers"][0]["input"] = times.into();
    let scene = file.load().unwrap();
    assert_eq!(scene.animations[0].channels[0].times, [1.0]);
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    file.json["animations"][0]["samplers"][1]["output"] = times.into();
    let scene = file.load().unwrap();
    assert_eq!(scene.animations[0].channels.len(), 2);
    assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
}
