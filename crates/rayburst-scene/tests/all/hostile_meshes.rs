//! Damaged and malicious OBJ, MTL, PLY and view files: an error or a valid scene, never a panic, a
//! hang or memory that the file does not pay for. The same files every time.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use rayburst_math::hash::Rng;
use rayburst_scene::import::{LoadOptions, load};

use crate::real_meshes::assert_valid;

const OBJ: &str = "# comment\nmtllib a.mtl\no thing\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
                   v 0.5 0.25 1e-3\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 0 1 0\nusemtl m\ns 1\n\
                   f 1/1/1 2/2/1 3/3/2\nf -1//1 -2//2 -3//1 -4//1\ns off\nf 1 2 \\\n 5 3 4\nusemtl n\n\
                   g other\nf 1 3 5\n";
const MTL: &str = "newmtl m\nKd 0.5 0.25 1\nKs .3 .3 .3\nNs 100\nd 0.5\nillum 7\nNi 1.5\n\
                   map_Kd -s 2 2 a.png\nbump -bm 0.5 b.png\nnewmtl n\nKe 5 5 5\nTr 0.25\nmap_d c.png\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                   property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
                   element face 2\nproperty list uchar int vertex_indices\nend_header\n\
                   0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 255\n0 1 0 9 9 9\n3 0 1 2\n4 0 1 2 3\n";
const VIEW: &str = r#"{ "metres_per_unit": 2, "exposure": 1, "cameras": [{ "eye": [0, 0, 5],
    "target": [0, 0, 0], "fov": 40 }], "lights": [{ "type": "point", "position": [1, 2, 3],
    "intensity": 5 }], "sun": { "direction": [0, -1, 0] } }"#;

fn binary_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n\
        property float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\n\
        end_header\n"
        .to_vec();
    for i in 0..9_u8 {
        bytes.extend(f32::from(i * i % 7).to_le_bytes());
    }
    for face in [[0_u32, 1, 2], [2, 1, 0]] {
        bytes.push(3);
        face.iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    }
    bytes
}

/// Loads, and checks what comes out; every file must be dealt with quickly.
fn survives(path: &Path, what: &str) -> bool {
    let start = Instant::now();
    let result = load(path, &LoadOptions::default());
    let elapsed = start.elapsed();
    assert!(elapsed < Duration::from_secs(10), "{what}: {elapsed:?}");
    match result {
        Ok(scene) => {
            assert_valid(&scene);
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains("a."), "{what}: the message names no file: {text}");
            false
        }
    }
}

fn pick(rng: &mut Rng, count: usize) -> usize {
    rng.below(count.max(1) as u32) as usize
}

/// Damages bytes at random: cuts, flipped bits, overwritten, repeated and removed stretches, words
/// replaced by hostile ones.
fn mutate(original: &[u8], rng: &mut Rng) -> Vec<u8> {
    const WORDS: [&[u8]; 20] = [
        b"1e999",
        b"-1e999",
        b"nan",
        b"inf",
        b"0",
        b"-1",
        b"4294967295",
        b"4294967296",
        b"9223372036854775807",
        b"-9223372036854775808",
        b"18446744073709551615",
        b"1e-45",
        b"",
        b"/",
        b"//",
        b"\\\n",
        b"\n",
        b"\xff\xfe\x00",
        b"3.4e38",
        b"999999999999999999999999",
    ];
    let mut bytes = original.to_vec();
    for _ in 0..=pick(rng, 3) {
        if bytes.is_empty() {
            break;
        }
        let at = pick(rng, bytes.len());
        let length = pick(rng, 16).min(bytes.len() - at);
        match pick(rng, 6) {
            0 => bytes.truncate(at),
            1 => bytes[at] ^= 1 << pick(rng, 8),
            2 => bytes[at..at + length].fill_with(|| rng.u32() as u8),
            3 => {
                let stretch = bytes[at..at + length].to_vec();
                let to = pick(rng, bytes.len());
                bytes.splice(to..to, stretch);
            }
            4 => drop(bytes.drain(at..at + length)),
            _ => {
                let is_blank = |b: &u8| b.is_ascii_whitespace();
                let start = bytes[..at].iter().rposition(is_blank).map_or(0, |i| i + 1);
                let end = bytes[at..].iter().position(is_blank).map_or(bytes.len(), |i| at + i);
                let word = WORDS[pick(rng, WORDS.len())];
                bytes.splice(start.min(end)..end, word.iter().copied());
            }
        }
    }
    bytes
}

#[test]
fn randomly_damaged_files_are_errors_or_valid_scenes() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let file = |name: &str| dir.path().join(name);
    let binary = binary_ply();
    let write_originals = || {
        fs::write(file("a.obj"), OBJ).expect("obj");
        fs::write(file("a.mtl"), MTL).expect("mtl");
        fs::write(file("a.view.json"), VIEW).expect("view");
    };
    write_originals();
    fs::write(file("a.ply"), PLY).expect("ply");
    assert!(survives(&file("a.obj"), "the undamaged files") && survives(&file("a.ply"), "PLY"));

    let mut rng = Rng::new(26);
    let (mut read, mut total) = (0, 0);
    for (name, original, load_as) in [
        ("a.obj", OBJ.as_bytes(), "a.obj"),
        ("a.mtl", MTL.as_bytes(), "a.obj"),
        ("a.view.json", VIEW.as_bytes(), "a.obj"),
        ("a.ply", PLY.as_bytes(), "a.ply"),
        ("a.ply", &binary, "a.ply"),
    ] {
        write_originals();
        for round in 0..400 {
            let bytes = mutate(original, &mut rng);
            fs::write(file(name), &bytes).expect("file");
            let what = format!("{name} {round}: {:?}", String::from_utf8_lossy(&bytes));
            read += usize::from(survives(&file(load_as), &what));
            total += 1;
        }
    }
    assert!(total >= 2000 && read > 100 && read < total, "{read} of {total} were read");
}

#[test]
fn every_truncation_is_survived() {
    let dir = tempfile::tempdir().expect("temporary folder");
    fs::write(dir.path().join("a.mtl"), MTL).expect("mtl");
    for (name, original) in
        [("a.obj", OBJ.as_bytes()), ("a.ply", PLY.as_bytes()), ("a.ply", &binary_ply())]
    {
        let path = dir.path().join(name);
        for length in 0..original.len() {
            fs::write(&path, &original[..length]).expect("file");
            survives(&path, &format!("{name} cut at {length}"));
        }
    }
}

#[test]
fn extreme_files_are_survived() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\n";
    let corners = |n: usize, corner: fn(usize) -> String| -> String {
        (0..n).map(corner).collect::<Vec<_>>().join(" ")
    };
    // A polygon of 10⁶ corners, all different and jagged, and one that repeats four.
    let mut jagged = String::new();
    for i in 0..200_000 {
        let angle = i as f64 / 200_000.0 * std::f64::consts::TAU;
        let radius = if i % 2 == 0 { 1.0 } else { 0.4 };
        jagged += &format!("v {:.6} {:.6} 0\n", angle.cos() * radius, angle.sin() * radius);
    }
    jagged += &format!("f {}\n", corners(200_000, |i| (i + 1).to_string()));
    let objs = [
        (
            "one million corners",
            format!("{vertices}f {}", corners(1_000_000, |i| (i % 4 + 1).to_string())),
        ),
        ("a jagged polygon", jagged),
        ("deep continuation", format!("{vertices}f 1 {}2 3\n", "\\\n".repeat(1_000_000))),
        ("a continuation without end", format!("{vertices}f 1 2 3 {}", "\\\r\n".repeat(500_000))),
        ("one long line", "x".repeat(10_000_000)),
        ("one long number", format!("v {} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", "9".repeat(3_000_000))),
        (
            "one long fraction",
            format!("v 0.{}1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", "0".repeat(3_000_000)),
        ),
        (
            "many objects",
            format!("{vertices}{}", corners(100_000, |i| format!("\no {i}\nf 1 2 3\n"))),
        ),
        (
            "many materials",
            format!("{vertices}{}", corners(100_000, |i| format!("\nusemtl {i}\nf 1 2 3\n"))),
        ),
        (
            "many groups",
            format!("{vertices}{}", corners(100_000, |i| format!("\ns {i}\nf 1 2 3\n"))),
        ),
        (
            "many libraries",
            format!(
                "{vertices}f 1 2 3\n{}",
                corners(20_000, |i| format!("\nmtllib {i}.mtl x y\n"))
            ),
        ),
        ("itself as library", format!("{vertices}mtllib a.obj\nf 1 2 3\n")),
        (
            "indices beyond 32 bits",
            format!("{vertices}f 4294967297 4294967298 4294967299\nf 1 2 3"),
        ),
        ("all at infinity", "v 1e999 0 0\nv 0 nan 0\nv 0 0 -inf\nf 1 2 3\n".to_owned()),
        ("huge and tiny", "v 3e38 -3e38 0\nv 1e-45 3e38 0\nv 0 0 3e38\ns 1\nf 1 2 3\n".to_owned()),
        ("one fan of many uvs", {
            let uvs: String = (0..100_000).map(|i| format!("vt {i} 0\n")).collect();
            let faces: String = (1..=100_000).map(|i| format!("f 1/{i} 2/{i} 3/{i}\n")).collect();
            format!("{vertices}{uvs}{faces}")
        }),
        ("only comments", "# nothing\n".repeat(500_000)),
        ("nothing", String::new()),
    ];
    for (what, text) in objs {
        let path = dir.path().join("a.obj");
        fs::write(&path, text).expect("file");
        survives(&path, what);
    }

    let header =
        |elements: &str| format!("ply\nformat binary_little_endian 1.0\n{elements}end_header\n");
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let list = "property list uint int vertex_indices\n";
    for (what, text) in [
        ("vertices without end", header(&format!("element vertex 18446744073709551615\n{xyz}"))),
        (
            "vertices times size overflow",
            header(&format!("element vertex 1537228672809129302\n{xyz}")),
        ),
        (
            "faces without end",
            header(&format!("element vertex 0\n{xyz}element face 4000000000\n{list}")),
        ),
        (
            "a list without end",
            header(&format!("element face 1\n{list}")) + "\u{7f}\u{7f}\u{7f}\u{7f}",
        ),
        (
            "empty elements without end",
            header("element nothing 18446744073709551615\nelement vertex 1\n"),
        ),
        ("vertices without positions", header("element vertex 1\nproperty uchar red\n") + "a"),
        (
            "many properties",
            header(&format!("element vertex 1\n{}", "property float q\n".repeat(100_000))),
        ),
        ("many elements", header(&"element q 0\n".repeat(100_000))),
        (
            "a header without end",
            "ply\nformat ascii 1.0\n".to_owned() + &"comment x\n".repeat(300_000),
        ),
        ("lists in lists", header("element vertex 1\nproperty list uchar list x\n")),
        (
            "x as a list",
            header("element vertex 1\nproperty list uchar float x\nproperty float y\n") + "\0aaaa",
        ),
    ] {
        let path = dir.path().join("a.ply");
        fs::write(&path, text).expect("file");
        assert!(!survives(&path, what), "{what} was read");
    }
}
