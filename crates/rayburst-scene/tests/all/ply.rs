//! PLY in all its encodings, in files of a few lines.

use std::fs;

use glam::{Vec2, Vec3, Vec4};
use rayburst_scene::{
    Primitive, Scene,
    import::{ImportError, LoadOptions, load},
};

use crate::real_meshes::assert_valid;

fn read_bytes(bytes: &[u8]) -> Result<Scene, ImportError> {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("a.ply");
    fs::write(&path, bytes).expect("file");
    let scene = load(&path, &LoadOptions::default())?;
    assert_valid(&scene);
    Ok(scene)
}

fn read(text: &str) -> Primitive {
    let scene = read_bytes(text.as_bytes()).unwrap_or_else(|e| panic!("{e}\n{text}"));
    (*scene.meshes[0].primitives[0]).clone()
}

const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                      property float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n";
const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

#[test]
fn ascii_squares_are_cut_and_get_normals() {
    let primitive = read(&format!("{HEADER}{SQUARE}4 0 1 2 3"));
    assert_eq!(primitive.indices, [[0, 1, 2], [0, 2, 3]]);
    assert!(primitive.normals.expect("normals").iter().all(|n| n.dot(Vec3::Z) > 0.9999));
    assert!(primitive.colors.is_none() && primitive.uvs.is_empty());
}

/// A binary file with every type, a list before and after what counts, and an unknown element first.
fn binary(big: bool) -> Vec<u8> {
    let name = if big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{name}_endian 1.0\nelement junk 2\nproperty list ushort double d\n\
         property char c\nelement face 2\nproperty uchar intensity\n\
         property list uint ushort vertex_indices\nproperty list uchar float extra\n\
         element vertex 3\nproperty double z\nproperty short q\nproperty float x\n\
         property list uchar uchar l\nproperty float y\nproperty uchar red\nproperty uchar green\n\
         property uchar blue\nproperty float s\nproperty float t\nend_header\n"
    )
    .into_bytes();
    let mut put = |little: &[u8]| {
        let mut word = little.to_vec();
        if big {
            word.reverse();
        }
        bytes.extend(word);
    };
    for items in [1_u16, 0] {
        put(&items.to_le_bytes());
        (0..items).for_each(|_| put(&1.5_f64.to_le_bytes()));
        put(&[7]);
    }
    for order in [[0_u16, 1, 2], [2, 1, 0]] {
        put(&[9]);
        put(&3_u32.to_le_bytes());
        order.iter().for_each(|i| put(&i.to_le_bytes()));
        put(&[1]);
        put(&2.5_f32.to_le_bytes());
    }
    for i in 0..3_u8 {
        put(&f64::from(i).to_le_bytes());
        put(&(-5_i16).to_le_bytes());
        put(&(f32::from(i) * 0.5).to_le_bytes());
        put(&[2]);
        put(&[1]);
        put(&[2]);
        put(&(f32::from(i % 2)).to_le_bytes());
        (0..3).for_each(|c| put(&[if c == i { 255 } else { 0 }]));
        put(&0.25_f32.to_le_bytes());
        put(&0.75_f32.to_le_bytes());
    }
    bytes
}

#[test]
fn binary_of_both_byte_orders_with_every_type() {
    for big in [false, true] {
        let scene = read_bytes(&binary(big)).unwrap_or_else(|e| panic!("{e}"));
        let primitive = &scene.meshes[0].primitives[0];
        assert_eq!(primitive.indices, [[0, 1, 2], [2, 1, 0]]);
        assert_eq!(
            primitive.positions,
            [Vec3::ZERO, Vec3::new(0.5, 1.0, 1.0), Vec3::new(1.0, 0.0, 2.0)]
        );
        let colors = primitive.colors.as_ref().expect("colours");
        assert_eq!(colors[1], Vec4::new(0.0, 1.0, 0.0, 1.0));
        assert_eq!(primitive.uvs[0], [Vec2::new(0.25, 0.25); 3]);
        assert_eq!(scene.materials[0].base_color, [1.0; 4]);
    }
}

#[test]
fn every_truncation_is_an_error() {
    let whole = binary(false);
    for length in 0..whole.len() {
        assert!(read_bytes(&whole[..length]).is_err(), "{length} of {}", whole.len());
    }
}

#[test]
fn integer_colours_are_srgb_and_floating_ones_linear() {
    let colored = |kind: &str, value: &str| {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nproperty {kind} red\nproperty {kind} green\nproperty {kind} blue\n\
             property {kind} alpha\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 0 {value}\n1 0 0 {value}\n0 1 0 {value}\n3 0 1 2\n"
        );
        read(&text).colors.expect("colours")[0]
    };
    let srgb = rayburst_image::colour::srgb_decode;
    let expected = Vec4::new(srgb(0.2), srgb(0.4), 1.0, 0.2);
    assert!(colored("uchar", "51 102 255 51").abs_diff_eq(expected, 1e-6));
    assert!((colored("ushort", "65535 0 13107 65535").z - srgb(0.2)).abs() < 1e-6);
    assert_eq!(colored("float", "0.2 0.4 1 0.5"), Vec4::new(0.2, 0.4, 1.0, 0.5));
}

#[test]
fn normals_of_the_file_are_kept_and_mended() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                property float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n\
                0 0 0 0 2 0\n1 0 0 0 0 0\n0 1 0 nan 0 1\n3 0 1 2\n";
    let normals = read(text).normals.expect("normals");
    assert_eq!(normals[0], Vec3::Y);
    assert!(normals[1].dot(Vec3::Z) > 0.9999 && normals[2].dot(Vec3::Z) > 0.9999);
}

#[test]
fn uvs_of_faces_split_vertices() {
    let header = HEADER.replace("end_header", "property list uchar float texcoord\nend_header");
    let header = header.replace("element face 1", "element face 2");
    let primitive =
        read(&format!("{header}{SQUARE}3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 0.5 0.5 0 1\n"));
    assert_eq!(primitive.positions.len(), 5);
    assert_eq!(primitive.indices, [[0, 1, 2], [0, 3, 4]]);
    assert_eq!(primitive.uvs[0][2..4], [Vec2::new(1.0, 0.0), Vec2::new(0.5, 0.5)]);
}

#[test]
fn strips_alternate_and_restart() {
    let header =
        HEADER.replace("element face", "element tristrips").replace("uchar int", "int int");
    let primitive = read(&format!("{header}{SQUARE}8 0 1 3 2 -1 0 1 2\n"));
    assert_eq!(primitive.indices, [[0, 1, 3], [3, 1, 2], [0, 1, 2]]);
}

#[test]
fn errors_say_where_and_why() {
    for (bytes, expected) in [
        (format!("{HEADER}{SQUARE}4 0 1 2"), "line 14"),
        (format!("{HEADER}{SQUARE}9 0 1 2 3"), "'face'"),
        (format!("{HEADER}{}4 0 1 2 3\n", SQUARE.replace("1 0 0", "1 x 0")), "line 11"),
        (HEADER.replace("vertex 4", "vertex 99999999999"), "promises 99999999999"),
        (HEADER.replace("vertex 4", "vertex 18446744073709551615"), "promises"),
        (HEADER.replace("vertex 4", "vertex -1"), "line 3"),
        (format!("{HEADER}{SQUARE}3 7 8 9\n"), "none of its 1 faces"),
        (format!("{}{SQUARE}", HEADER.replace("face 1", "face 0")), "cloud of 4 points"),
        ("ply\n".to_owned(), "end_header"),
    ] {
        let error = read_bytes(bytes.as_bytes()).expect_err(&bytes).to_string();
        assert!(error.contains(expected) && error.contains("a.ply"), "{expected}: {error}");
    }
}
