//! Broken files through the command line: one clear line and exit code 1 or 2, or a picture.

use std::time::{Duration, Instant};

use rayburst::math::hash::Rng;

use crate::program::Place;

/// A triangle with a texture, a camera and an animation, in glTF.
const GLTF: &str = r#"{"asset":{"version":"2.0"},
"buffers":[{"uri":"tri.bin","byteLength":152}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6},
{"buffer":0,"byteOffset":44,"byteLength":24},{"buffer":0,"byteOffset":68,"byteLength":8},
{"buffer":0,"byteOffset":76,"byteLength":24}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"},
{"bufferView":2,"componentType":5126,"count":3,"type":"VEC2"},
{"bufferView":3,"componentType":5126,"count":2,"type":"SCALAR","min":[0],"max":[1]},
{"bufferView":4,"componentType":5126,"count":2,"type":"VEC3"}],
"images":[{"uri":"dot.png"}],"samplers":[{}],"textures":[{"source":0,"sampler":0}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":2},"indices":1,"material":0}]}],
"cameras":[{"type":"perspective","perspective":{"yfov":0.8,"znear":0.1}}],
"animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}],
"samplers":[{"input":3,"output":4}]}],
"nodes":[{"mesh":0,"children":[1]},{"camera":0,"translation":[0.3,0.3,2]}],
"scenes":[{"nodes":[0]}],"scene":0}"#;

const OBJ: &str = "mtllib tri.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl red\nf 1/1/1 2/1/1 3/1/1\n";
const MTL: &str = "newmtl red\nKd 0.8 0.1 0.1\nNs 10\nmap_Kd dot.png\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
const VIEW: &str = r#"{"metres_per_unit":1,"cameras":[{"name":"a","eye":[0,0,3],"target":[0,0,0],"up":[0,1,0],"fov":40}],"environment":"sky","exposure":0}"#;

fn binary() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut floats = |values: &[f32]| {
        for v in values {
            bytes.extend(v.to_le_bytes());
        }
    };
    floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bytes.extend([0u8, 0, 1, 0, 2, 0, 0, 0]);
    for v in [0f32, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0] {
        bytes.extend(v.to_le_bytes());
    }
    bytes.resize(152, 0);
    bytes
}

fn place() -> Place {
    let place = Place::new();
    place.write("tri.gltf", GLTF);
    place.write("tri.bin", binary());
    place.write("tri.mtl", MTL);
    place.write("tri.obj", OBJ);
    place.write("tri.ply", PLY);
    place.good("render --size 4x4 --spp 1 --integrator normal -o dot.png");
    place.good("render --size 8x4 --spp 1 --integrator normal -o sky.hdr");
    place
}

/// A render of a broken scene ends soon, in a picture or in one line.
fn survives(place: &Place, line: &str, what: &str) -> bool {
    let start = Instant::now();
    let ran = place.run(&format!("render {line} --size 4x4 --spp 1 -o out.png"));
    assert!(start.elapsed() < Duration::from_secs(20), "{what} hangs");
    let picture = place.path("out.png").exists();
    match ran.code {
        Some(0) => assert!(picture, "{what}: {ran:?}"),
        Some(1 | 2) => {
            assert!(!picture, "{what}: {ran:?}");
            assert!(ran.complaint(what).len() > 20, "{what}: {ran:?}");
        }
        _ => panic!("{what}: {ran:?}"),
    }
    assert!(place.files().iter().all(|f| !f.contains(".part")), "{what}: {:?}", place.files());
    if picture {
        std::fs::remove_file(place.path("out.png")).unwrap();
    }
    ran.code == Some(0)
}

#[test]
fn the_samples_are_good_before_they_are_broken() {
    let place = place();
    for scene in ["tri.gltf", "tri.obj", "tri.ply"] {
        assert!(survives(&place, scene, scene));
    }
    place.write("tri.view.json", VIEW);
    assert!(survives(&place, "tri.ply", "a view file"));
    assert!(survives(&place, "tri.ply --environment sky.hdr", "an environment"));
}

#[test]
fn broken_gltf_files_do_no_harm() {
    let place = place();
    // What is replaced, by what, and whether it must be an error.
    let cases: &[(&str, &str, bool)] = &[
        (r#""version":"2.0""#, r#""version":"1.0""#, true),
        (r#""asset""#, r#""acid""#, true),
        (r#""uri":"tri.bin""#, r#""uri":"gone.bin""#, true),
        (r#""uri":"tri.bin""#, r#""uri":"../../../../etc/passwd""#, true),
        (r#""uri":"tri.bin""#, r#""uri":"file:///etc/passwd""#, true),
        (r#""uri":"tri.bin""#, r#""uri":"https://example.org/tri.bin""#, true),
        (r#""uri":"tri.bin""#, r#""uri":"data:application/octet-stream;base64,@@@@""#, true),
        (r#""uri":"tri.bin","byteLength":152"#, r#""byteLength":152"#, true),
        (r#""byteLength":152"#, r#""byteLength":99999999999"#, true),
        (r#""byteOffset":0,"byteLength":36"#, r#""byteOffset":140,"byteLength":36"#, true),
        (r#""count":3,"type":"VEC3""#, r#""count":4000000000,"type":"VEC3""#, true),
        (r#""count":3,"type":"VEC3""#, r#""count":-1,"type":"VEC3""#, true),
        (
            r#""componentType":5126,"count":3,"type":"VEC3""#,
            r#""componentType":9,"count":3,"type":"VEC3""#,
            true,
        ),
        (r#""type":"SCALAR"},"#, r#""type":"MAT9"},"#, true),
        (r#""POSITION":0"#, r#""POSITION":77"#, true),
        (r#""POSITION":0"#, r#""POSITION":1"#, false),
        (r#""indices":1"#, r#""indices":0"#, false),
        (r#""indices":1"#, r#""indices":99"#, true),
        (r#""material":0"#, r#""material":5"#, true),
        (r#""mesh":0"#, r#""mesh":3"#, true),
        (r#""children":[1]"#, r#""children":[0]"#, true),
        (r#""children":[1]"#, r#""children":[1,1]"#, false),
        (r#""children":[1]"#, r#""children":[9]"#, true),
        (r#""scenes":[{"nodes":[0]}]"#, r#""scenes":[{"nodes":[4]}]"#, true),
        (r#""scene":0"#, r#""scene":7"#, true),
        (r#""yfov":0.8"#, r#""yfov":-1"#, false),
        (r#""yfov":0.8"#, r#""yfov":1e99"#, false),
        (r#""translation":[0.3,0.3,2]"#, r#""scale":[0,0,0]"#, false),
        (r#""translation":[0.3,0.3,2]"#, r#""translation":[1e38,1e38,1e38]"#, false),
        (r#""translation":[0.3,0.3,2]"#, r#""translation":[1,2]"#, true),
        (r#""uri":"dot.png""#, r#""uri":"gone.png""#, false),
        (r#""uri":"dot.png""#, r#""uri":"tri.bin""#, false),
        (r#""uri":"dot.png""#, r#""uri":"../x/dot.png""#, false),
        (r#""source":0"#, r#""source":12"#, false),
        (r#""index":0"#, r#""index":12"#, false),
        (r#""node":0"#, r#""node":12"#, false),
        (r#""input":3"#, r#""input":30"#, false),
        (r#""output":4"#, r#""output":0"#, false),
        (
            r#""scene":0}"#,
            r#""scene":0,"extensionsRequired":["KHR_draco_mesh_compression"],"extensionsUsed":["KHR_draco_mesh_compression"]}"#,
            true,
        ),
        (r#""scene":0}"#, r#""scene":0"#, true),
    ];
    for (from, to, must_fail) in cases {
        let broken = GLTF.replacen(from, to, 1);
        assert_ne!(broken, GLTF, "{from}");
        place.write("broken.gltf", &broken);
        let what = format!("{from} → {to}");
        let drawn = survives(&place, "broken.gltf", &what);
        assert!(!(drawn && *must_fail), "{what} should be an error");
    }
    place.write("broken.gltf", GLTF.replace("tri.bin", "nan.bin"));
    let mut numbers = binary();
    numbers[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
    numbers[16..20].copy_from_slice(&f32::INFINITY.to_le_bytes());
    place.write("nan.bin", &numbers);
    survives(&place, "broken.gltf", "positions that are no numbers");
    numbers[36..42].copy_from_slice(&[0xFF; 6]);
    place.write("nan.bin", &numbers);
    survives(&place, "broken.gltf", "indices out of range");
}

#[test]
fn damaged_bytes_do_no_harm() {
    let place = place();
    let mut rng = Rng::new(2601);
    let samples: [(&str, Vec<u8>, &str); 6] = [
        ("x.gltf", GLTF.into(), "x.gltf"),
        ("x.glb", glb(), "x.glb"),
        ("x.obj", OBJ.into(), "x.obj"),
        ("x.ply", PLY.into(), "x.ply"),
        ("x.view.json", VIEW.into(), "tri.ply --view x.view.json"),
        ("x.hdr", place.read("sky.hdr"), "tri.ply --environment x.hdr"),
    ];
    for (name, whole, line) in samples {
        for round in 0..8 {
            let mut bytes = whole.clone();
            if round < 3 {
                bytes.truncate(rng.below(whole.len() as u32) as usize);
            } else {
                for _ in 0..round {
                    let at = rng.below(bytes.len() as u32) as usize;
                    bytes[at] ^= 1 << rng.below(8);
                }
            }
            place.write(name, &bytes);
            survives(&place, line, &format!("{name}, round {round}"));
        }
        std::fs::remove_file(place.path(name)).unwrap();
    }
}

#[test]
fn broken_meshes_views_and_environments_do_no_harm() {
    let place = place();
    let huge = PLY.replace("vertex 3", "vertex 4000000000");
    for (name, content) in [
        ("a.obj", "f 1 2 3\n"),
        ("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
        ("c.obj", "v nan 0 0\nv 1 inf 0\nv 0 1 0\nf 1 2 3\n"),
        ("d.obj", "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\nf 0 1 2\n"),
        ("e.obj", "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf -3 -2 -1\n"),
        ("f.obj", "mtllib ../../outside.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("g.obj", ""),
        ("h.ply", "ply\n"),
        ("i.ply", "ply\nformat ascii 1.0\nend_header\n"),
        ("j.ply", &huge),
        ("k.ply", &PLY.replace("3 0 1 2", "3 0 1 7")),
        ("l.ply", &PLY.replace("3 0 1 2", "99 0 1 2")),
        ("m.ply", &PLY.replace("ascii", "binary_little_endian")),
        ("n.gltf", "{}"),
        ("o.gltf", "[[[[[["),
        ("p.glb", "glTF\u{2}\0\0\0\u{7f}\u{7f}\u{7f}\u{7f}"),
        ("q.gltf", ""),
    ] {
        place.write(name, content);
        survives(&place, name, name);
    }
    for content in [
        "",
        "{",
        "[]",
        r#"{"cameras":3}"#,
        r#"{"cameras":[{"name":"a"}]}"#,
        r#"{"cameras":[{"name":"a","eye":[0,0,0],"target":[0,0,0],"up":[0,0,0],"fov":0}]}"#,
        r#"{"environment":"gone.hdr"}"#,
        r#"{"environment":"../../../etc/passwd"}"#,
        r#"{"metres_per_unit":0}"#,
        r#"{"metres_per_unit":-1}"#,
        r#"{"exposure":"bright"}"#,
        r#"{"sun":{"direction":[0,0,0],"illuminance":1e30}}"#,
        r#"{"lights":[{"type":"laser"}]}"#,
    ] {
        place.write("bad.view.json", content);
        survives(&place, "tri.ply --view bad.view.json", content);
    }
    survives(&place, "tri.ply --view gone.view.json", "a view that is not there");
    for (name, content) in [
        ("a.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 0\n"),
        ("b.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999999 +X 99999999\n"),
        ("c.exr", "v/1\u{1}"),
        ("d.hdr", ""),
    ] {
        place.write(name, content);
        assert!(!survives(&place, &format!("tri.ply --environment {name}"), name));
    }
    assert!(!survives(&place, ".", "a folder"));
    assert!(!survives(&place, "tri.bin", "something else"));
}

/// The glTF sample in its binary form.
fn glb() -> Vec<u8> {
    let mut json = GLTF.replace(r#""uri":"tri.bin","#, "").into_bytes();
    while !json.len().is_multiple_of(4) {
        json.push(b' ');
    }
    let data = binary();
    let total = 12 + 8 + json.len() + 8 + data.len();
    let mut bytes = b"glTF".to_vec();
    let word = |bytes: &mut Vec<u8>, n: usize| bytes.extend((n as u32).to_le_bytes());
    word(&mut bytes, 2);
    word(&mut bytes, total);
    word(&mut bytes, json.len());
    bytes.extend(b"JSON");
    bytes.extend(json);
    word(&mut bytes, data.len());
    bytes.extend(b"BIN\0");
    bytes.extend(data);
    bytes
}
