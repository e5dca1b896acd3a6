//! Broken and hostile files: one clear error or a warning, never a panic, a hang or a large
//! allocation.

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    time::{Duration, Instant},
};

use rayburst_scene::{
    FlattenError, Flattener, Pose,
    import::{ImportError, LoadOptions, load},
};
use serde_json::{Value, json};

use super::{
    glb::{F32, Glb, PIXEL, U16, U32},
    gltf::check_invariants,
    gltf_values::creature,
};

fn triangle() -> Glb {
    let mut file = Glb::new();
    file.triangle();
    file
}

/// Sets a value by JSON pointer.
fn with(mut file: Glb, pointer: &str, value: Value) -> Glb {
    *file.json.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value;
    file
}

#[test]
fn required_extensions_are_named_with_a_way_out() {
    let cases = [
        ("KHR_draco_mesh_compression", "gltf-transform/cli copy input.glb output.glb"),
        ("EXT_meshopt_compression", "gltf-transform/cli copy input.glb output.glb"),
        ("KHR_texture_basisu", "gltf-transform/cli ktxdecompress input.glb output.glb"),
        ("EXT_texture_webp", "gltf-transform/cli png input.glb output.glb"),
        ("KHR_materials_pbrSpecularGlossiness", "gltf-transform/cli metalrough"),
        ("VENDOR_thing", "extensionsRequired"),
    ];
    for (name, way_out) in cases {
        let mut file = triangle();
        file.json["extensionsRequired"] = json!(["KHR_texture_transform", name]);
        let error = file.load().unwrap_err();
        assert!(matches!(&error, ImportError::UnsupportedExtension { name: n, .. } if n == name));
        assert!(error.to_string().contains(way_out), "{error}");
    }
}

#[test]
fn every_promise_is_checked() {
    let base = triangle;
    let huge = 4_000_000_000u64;
    let cases = [
        (with(base(), "/accessors/0/count", json!(4)), "4 elements need 48 bytes"),
        (with(base(), "/accessors/0/count", json!(u64::MAX)), "more than can be addressed"),
        (with(base(), "/accessors/0/componentType", json!(5124)), "unknown component type"),
        (with(base(), "/accessors/0/type", json!("VEC2")), "type VEC3 is needed"),
        (with(base(), "/accessors/0/bufferView", json!(9)), "there is no such buffer view"),
        (with(base(), "/bufferViews/0/byteLength", json!(40)), "beyond the end of buffer 0"),
        (with(base(), "/bufferViews/0/byteOffset", json!(u64::MAX)), "beyond the end of buffer 0"),
        (with(base(), "/bufferViews/0/buffer", json!(1)), "there is no buffer 1"),
        (with(base(), "/buffers/0/byteLength", json!(huge)), "4000000000 bytes are promised"),
        (with(base(), "/asset/version", json!("1.0")), "glTF version 1.0; only 2.0"),
        (with(base(), "/scene", json!(5)), "there is no scene 5"),
        (with(base(), "/nodes/0/mesh", json!(-1)), "not valid glTF JSON"),
        (with(base(), "/meshes/0/primitives/0/attributes/POSITION", json!(7)), "no such accessor"),
        (with(base(), "/buffers/0", json!({"byteLength": 4, "uri": "gone.bin"})), "gone.bin"),
        (
            with(base(), "/buffers/0", json!({"byteLength": 4, "uri": "/etc/passwd"})),
            "leaves the scene's folder",
        ),
        (
            with(
                base(),
                "/accessors/0",
                json!({"componentType": F32, "type": "VEC3", "count": huge}),
            ),
            "bytes that the file does not hold exceeds the limit",
        ),
    ];
    for (file, text) in cases {
        assert!(file.error().contains(text), "{text}: {}", file.error());
    }
    let mut file = base();
    file.json["bufferViews"][0]["byteStride"] = json!(0);
    assert!(file.error().contains("a stride of 0"), "{}", file.error());
    let mut file = base();
    let indices = file.indices(&[0, 1, 3]);
    file.json["meshes"][0]["primitives"][0]["indices"] = indices.into();
    let error = file.error();
    assert!(error.contains("index 3 at position 2 is out of range, there are 3"), "{error}");
    let file = with(creature(), "/skins/0/joints", json!([2]));
    assert!(file.error().contains("name joint 1, the skin has 1"), "{}", file.error());
    let options = LoadOptions { max_geometry_bytes: 50, ..LoadOptions::default() };
    assert!(matches!(base().load_with(&options), Err(ImportError::TooLarge { .. })));
}

#[test]
fn little_is_wrong_and_much_is_shown() {
    let mut file = triangle();
    let position = file.floats(&[f32::NAN, 0., 0., 1., f32::INFINITY, 0., 0., 1., 0.], "VEC3");
    file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = position.into();
    let scene = file.load().unwrap();
    assert_eq!(scene.placed_triangles(), 1);
    assert!(scene.warnings[0].contains("(2 times"), "{:?}", scene.warnings);

    let mut file = triangle();
    let empty = file.accessor(&[], F32, "VEC3", 0);
    file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = empty.into();
    let scene = file.load().unwrap();
    assert_eq!((scene.placed_triangles(), scene.nodes[0].mesh), (0, None));
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    let mut file = Glb::new();
    file.json["meshes"] = json!([{}]);
    assert_eq!(file.load().unwrap().placed_triangles(), 0);
}

#[test]
fn containers_are_checked() {
    let good = triangle().bytes();
    let mut version = good.clone();
    version[4] = 1;
    let mut chunk = good.clone();
    chunk[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    let mut kind = good.clone();
    kind[16] = b'X';
    let mut text = good.clone();
    text[30] = 0xff;
    let deep = format!("{}{}", r#"{"asset":{"version":"2.0"},"extras":"#, "[".repeat(1_000_000));
    let nested = format!("{}{}", r#"{"scenes":"#, "[".repeat(1_000_000));
    let cases: [(&[u8], &str); 9] = [
        (&good[..good.len() - 5], "it is cut off"),
        (&good[..10], "the header is cut off"),
        (&version, "container version 1"),
        (&chunk, "goes beyond the file's end"),
        (&kind, "there is no JSON chunk"),
        (&text, "not valid glTF JSON"),
        (b"", "not valid glTF JSON"),
        (deep.as_bytes(), "not valid glTF JSON"),
        (nested.as_bytes(), "not valid glTF JSON"),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file.gltf");
    for (bytes, text) in cases {
        fs::write(&path, bytes).unwrap();
        let error = load(&path, &LoadOptions::default()).unwrap_err().to_string();
        assert!(error.contains(text), "{text}: {error}");
    }
    // Without an extension the content tells the format.
    let bare = folder.path().join("scene");
    fs::write(&bare, &good).unwrap();
    assert_eq!(load(&bare, &LoadOptions::default()).unwrap().placed_triangles(), 1);
    fs::write(&bare, b"\x7fELF").unwrap();
    let error = load(&bare, &LoadOptions::default()).unwrap_err();
    assert!(matches!(error, ImportError::UnknownFormat { .. }));
    let error = load(&folder.path().join("none.glb"), &LoadOptions::default()).unwrap_err();
    assert!(matches!(error, ImportError::Io { .. }));
    assert!(load(folder.path(), &LoadOptions::default()).is_err());
}

/// SplitMix64 (G. L. Steele et al., 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }
}

/// A file that uses everything that is read.
fn everything() -> Glb {
    let mut file = creature();
    let uv = file.floats(&[0., 0., 1., 0., 0., 1.], "VEC2");
    let normal = file.floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1.], "VEC3");
    let color = file.floats(&[1.0; 12], "VEC4");
    let indices = file.indices(&[0, 1, 2, 2, 1, 0]);
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = uv.into();
    primitive["attributes"]["NORMAL"] = normal.into();
    primitive["attributes"]["COLOR_0"] = color.into();
    primitive["indices"] = indices.into();
    primitive["material"] = 0.into();
    let sparse = file.view(&[1, 0]);
    let value = file.view(&[0; 12]);
    file.json["accessors"][normal]["sparse"] = json!({
        "count": 1,
        "indices": {"bufferView": sparse, "componentType": U16},
        "values": {"bufferView": value},
    });
    file.push("images", json!({"uri": PIXEL}));
    file.push("samplers", json!({"wrapS": 33071, "minFilter": 9984}));
    file.push("textures", json!({"source": 0, "sampler": 0}));
    let transform =
        json!({"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1, "texCoord": 0}});
    file.push(
        "materials",
        json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [1, 1, 1, 0.5],
                "baseColorTexture": {"index": 0, "extensions": transform},
            },
            "normalTexture": {"index": 0, "scale": 2}, "alphaMode": "MASK", "alphaCutoff": 0.1,
            "emissiveFactor": [1, 1, 1],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3},
                           "KHR_materials_ior": {"ior": 1.4}},
        }),
    );
    // A second mesh of strips, in instances, with a camera and a light.
    let strip = json!({"attributes": {"POSITION": 0, "TEXCOORD_0": uv}, "mode": 5, "material": 0});
    let mesh = file.push("meshes", json!({"primitives": [strip]}));
    let node = json!({
        "mesh": mesh, "camera": 0, "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 1,2,3,1],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}},
                       "KHR_lights_punctual": {"light": 0}},
    });
    let node = file.push("nodes", node);
    file.json["scenes"][0]["nodes"] = json!([0, node]);
    file.push("cameras", json!({"perspective": {"yfov": 1}}));
    file.json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 5}]}});
    file.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    file
}

#[test]
fn the_file_to_be_broken_is_whole() {
    let scene = everything().load().unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    assert_eq!((scene.meshes.len(), scene.images.len(), scene.placed_triangles()), (2, 2, 5));
}

const ODD_INTEGERS: [u64; 17] = [
    0,
    1,
    2,
    3,
    5,
    7,
    9,
    255,
    65_535,
    5120,
    5121,
    5123,
    5125,
    5126,
    1 << 31,
    u32::MAX as u64,
    u64::MAX,
];
const ODD_NUMBERS: [f64; 7] = [0.0, -1.0, 1e308, -3.5e38, 3e38, 1e-40, 0.5];
const ODD_TEXTS: [&str; 11] = [
    "SCALAR",
    "VEC2",
    "VEC3",
    "VEC4",
    "MAT4",
    "CUBICSPLINE",
    "weights",
    "translation",
    "data:;base64,AAAA",
    "../../etc/passwd",
    "\u{0}",
];

/// Changes something deep inside a JSON value.
fn edit(value: &mut Value, random: &mut Random) {
    let children = match value {
        Value::Array(a) => a.len(),
        Value::Object(o) => o.len(),
        _ => 0,
    };
    let descend = children > 0 && random.below(8) != 0;
    match value {
        Value::Array(array) if descend => {
            let at = random.below(array.len());
            match random.below(24) {
                0 => {
                    array.remove(at);
                }
                1 => array.push(array[at].clone()),
                2 => array.swap(0, at),
                _ => edit(&mut array[at], random),
            }
        }
        Value::Object(object) if descend => {
            let at = random.below(object.len());
            let key = object.keys().nth(at).cloned().unwrap();
            if random.below(24) == 0 {
                object.remove(&key);
            } else {
                edit(&mut object[&key], random);
            }
        }
        _ => {
            // Mostly of the same type, so that more than the parser is tried.
            let numbers = ODD_NUMBERS.map(|x| json!(x));
            let whole = ODD_INTEGERS.map(|x| json!(x));
            let texts = ODD_TEXTS.map(|x| json!(x));
            let others = [json!(null), json!(true), json!([]), json!({}), json!([0, 0, 0])];
            let odd: &[Value] = match value {
                _ if random.below(10) == 0 => &others,
                Value::Number(n) if n.is_u64() => &whole,
                Value::Number(_) => &numbers,
                _ => &texts,
            };
            *value = odd[random.below(odd.len())].clone();
        }
    }
}

/// One broken version of a file.
fn mutate(file: &Glb, random: &mut Random) -> Vec<u8> {
    match random.below(8) {
        0 => {
            let mut bytes = file.bytes();
            bytes.truncate(random.below(bytes.len()));
            bytes
        }
        1 => {
            let mut bytes = file.bytes();
            for _ in 0..=random.below(4) {
                let at = random.below(bytes.len());
                bytes[at] ^= 1 << random.below(8);
            }
            bytes
        }
        2 => {
            // Wild numbers in the data.
            let mut file = file.clone();
            for _ in 0..=random.below(6) {
                let at = random.below(file.binary.len() / 4) * 4;
                let wild = [f32::NAN, f32::INFINITY, -1e38, 0.0, f32::from_bits(u32::MAX)];
                let wild = wild[random.below(wild.len())];
                file.binary[at..at + 4].copy_from_slice(&wild.to_le_bytes());
            }
            file.bytes()
        }
        _ => {
            let mut file = file.clone();
            for _ in 0..=random.below(3) {
                edit(&mut file.json, random);
            }
            file.bytes()
        }
    }
}

/// Reads a file and does with it what a renderer would: whatever happens, no panic.
fn use_file(path: &Path) -> bool {
    // Broken numbers can ask for anything; what is real here is tiny.
    let options = LoadOptions { max_geometry_bytes: 64 << 20, ..LoadOptions::default() };
    let Ok(scene) = load(path, &options) else { return false };
    check_invariants(&scene, "broken");
    let animations = scene.default_animations();
    let mut flattener = Flattener::new(&scene, rayburst_accel::BuildOptions::default());
    for time in [0.0, 0.7, f32::NAN] {
        let flattened = flattener.at(&Pose::at(&scene, &animations, time));
        assert!(matches!(flattened, Ok(_) | Err(FlattenError::Build { .. })));
    }
    true
}

#[test]
fn two_thousand_broken_files_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.glb");
    let whole = [everything(), creature(), triangle()];
    let (mut survived, mut slowest) = (0, (Duration::ZERO, 0));
    let count = 2_000;
    for seed in 0..count {
        let mut random = Random(seed);
        let bytes = mutate(&whole[random.below(whole.len())], &mut random);
        fs::write(&path, &bytes).unwrap();
        let start = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| use_file(&path)));
        slowest = slowest.max((start.elapsed(), seed));
        survived += u64::from(outcome.unwrap_or_else(|_| panic!("seed {seed} panicked")));
    }
    eprintln!("{survived} of {count} broken files could still be read; the slowest, {slowest:?}");
    assert!(survived > count / 10 && survived < count, "{survived} of {count} survived");
    // Far above what any takes, so that a busy machine does not fail the test.
    assert!(slowest.0 < Duration::from_secs(30), "{slowest:?}");
    if let Some(peak) = peak_memory() {
        assert!(peak < 3 << 30, "{peak} bytes of memory at the peak");
    }
}

#[test]
fn real_files_cut_and_flipped_do_no_harm() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.glb");
    for file in ["BoxAnimated.glb", "RiggedSimple.glb", "SimpleInstancing.glb", "Lights.glb"] {
        let Ok(whole) = fs::read(root.join("gltf_tests").join(file)) else {
            eprintln!("skipped: {file} is not there");
            continue;
        };
        for seed in 0..75 {
            let mut random = Random(seed);
            let mut bytes = whole.clone();
            if seed % 3 == 0 {
                bytes.truncate(random.below(whole.len()));
            }
            for _ in 0..seed % 7 {
                let at = random.below(bytes.len());
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << random.below(8);
                }
            }
            fs::write(&path, &bytes).unwrap();
            let outcome = catch_unwind(AssertUnwindSafe(|| use_file(&path)));
            assert!(outcome.is_ok(), "{file}, seed {seed} panicked");
        }
    }
}

/// The most memory that the process has had, where the system tells.
fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes << 10)
}

#[test]
fn many_uses_of_one_buffer_stay_within_the_limit() {
    let mut file = Glb::new();
    let points = vec![0.5; 3 * 60_000];
    let position = file.floats(&points, "VEC3");
    for _ in 0..5_000 {
        file.primitive(json!({"attributes": {"POSITION": position}}));
    }
    let options = LoadOptions { max_geometry_bytes: 64 << 20, ..LoadOptions::default() };
    assert!(matches!(file.load_with(&options), Err(ImportError::TooLarge { .. })));
    // Three indices into it cost three vertices.
    let indices = file.accessor(&[0; 12], U32, "SCALAR", 3);
    for primitive in file.json["meshes"][0]["primitives"].as_array_mut().unwrap() {
        primitive["indices"] = indices.into();
    }
    assert_eq!(file.load_with(&options).unwrap().placed_triangles(), 5_000);
}
