//! Files come back as they were written, in every format and by every writer.

use std::path::Path;

use glam::Vec3;
use rayburst_image::{
    Channel, Layer, LayeredImage, PictureFormat, Precision, RgbImage, decode_exr, encode_exr,
    read_exr, read_picture, write_exr, write_linear,
};
use rayburst_math::hash::Rng;

pub(crate) fn layered(width: u32, height: u32) -> LayeredImage {
    let mut rng = Rng::new(2);
    let n = (width * height) as usize;
    let mut values = |scale: f32| -> Vec<Vec3> { (0..n).map(|_| rng.vec3() * scale).collect() };
    let mut image = LayeredImage {
        width,
        height,
        layers: vec![
            Layer::from_vec3("", ["R", "G", "B"], &values(100.0), Precision::Float),
            Layer::from_vec3("albedo", ["R", "G", "B"], &values(1.0), Precision::Half),
            Layer::from_vec3("light.sun", ["R", "G", "B"], &values(1e20), Precision::Float),
            Layer::from_scalar("depth", "Z", values(5.0).iter().map(|v| v.x).collect()),
        ],
        attributes: [
            ("rayburst.samples", "64"),
            ("rayburst.seed", "18446744073709551615"),
            ("comments", "a cornell box"),
            ("software", "Rayburst"),
            ("title", "Größe: 3 × 4"),
            ("a name of more than thirty-one characters", ""),
        ]
        .map(|(k, v)| (k.to_owned(), v.to_owned()))
        .into(),
    };
    // What half floats cannot hold exactly is rounded before the comparison.
    for channel in &mut image.layers[1].channels {
        channel.values.iter_mut().for_each(|v| *v = (*v * 1024.0).floor() / 1024.0);
    }
    image.layers[3].channels[0].values[0] = f32::INFINITY;
    image.layers[3].channels[0].values[1] = -0.0;
    image.layers[3].channels[0].values[2] = 1e-42;
    image
}

#[test]
fn exr_keeps_layers_precision_bits_and_attributes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.exr");
    for (width, height) in [(1, 3), (37, 41), (128, 5)] {
        let mut image = layered(width, height);
        write_exr(&path, &image).unwrap();
        let read = read_exr(&path).unwrap();
        image.layers.sort_by(|a, b| a.name.cmp(&b.name));
        assert_eq!(read, image);
        let bits = |i: &LayeredImage| -> Vec<u32> {
            i.layer("depth").unwrap().channels[0].values.iter().map(|v| v.to_bits()).collect()
        };
        assert_eq!(bits(&read), bits(&image));
    }
}

#[test]
fn bright_values_stay_finite_as_half_floats() {
    let picture = RgbImage::new(2, 2, Vec3::new(1e9, -70_000.0, f32::INFINITY));
    let mut image = LayeredImage::from_rgb(&picture);
    image.layers[0].channels.iter_mut().for_each(|c| c.precision = Precision::Half);
    let read = decode_exr(&encode_exr(&image, "a").unwrap(), "a").unwrap().beauty().unwrap();
    assert_eq!(read.pixels[3], Vec3::new(65_504.0, -65_504.0, f32::INFINITY));
}

#[test]
fn the_same_picture_is_the_same_bytes() {
    let image = layered(33, 20);
    let first = encode_exr(&image, "a").unwrap();
    for _ in 0..20 {
        assert_eq!(encode_exr(&image, "a").unwrap(), first);
    }
}

#[test]
fn what_an_exr_file_cannot_hold_is_said() {
    let mut image = layered(4, 4);
    image.attributes.insert("dataWindow".to_owned(), "4x4".to_owned());
    let text = encode_exr(&image, "a.exr").unwrap_err().to_string();
    assert!(text.contains("a.exr") && text.contains("'dataWindow'"), "{text}");
    assert!(encode_exr(&LayeredImage { width: 1, height: 1, ..Default::default() }, "a").is_err());
    let empty = LayeredImage { width: 0, height: 7, ..layered(4, 4) };
    assert!(encode_exr(&empty, "a").unwrap_err().to_string().contains("0x7"));
}

/// One EXR file as other programs write them.
pub(crate) fn foreign_exr(
    compression: exr::prelude::Compression,
    tiles: Option<usize>,
    offset: (i32, i32),
) -> Vec<u8> {
    use exr::prelude::*;
    let (width, height) = (45usize, 33usize);
    let value = |x: usize, y: usize| (x * 7 + y) as f32 / 64.0;
    let plane = |f: &dyn Fn(f32) -> f32| -> Vec<f32> {
        (0..width * height).map(|i| f(value(i % width, i / width))).collect()
    };
    let half = plane(&|v| v).iter().map(|&v| f16::from_f32(v)).collect();
    let ids = plane(&|v| v * 64.0).iter().map(|&v| v as u32).collect();
    let channels = AnyChannels::sort(
        [
            AnyChannel::new("R", FlatSamples::F32(plane(&|v| v))),
            AnyChannel::new("G", FlatSamples::F16(half)),
            AnyChannel::new("B", FlatSamples::F32(plane(&|v| 2.0 * v))),
            AnyChannel::new("id.index", FlatSamples::U32(ids)),
        ]
        .into_iter()
        .collect(),
    );
    let encoding = Encoding {
        compression,
        blocks: tiles.map_or(Blocks::ScanLines, |t| Blocks::Tiles(Vec2(t, t))),
        line_order: LineOrder::Increasing,
    };
    let layer_position = Vec2(offset.0, offset.1);
    let attributes = LayerAttributes { layer_position, ..Default::default() };
    let layer = Layer::new((width, height), attributes, encoding, channels);
    let mut image = Image::from_layer(layer);
    image.attributes.display_window = IntegerBounds::from_dimensions((width, height));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn foreign_exr_files_are_read() {
    use exr::prelude::Compression::*;
    let lossless = [Uncompressed, RLE, ZIP1, ZIP16, PIZ];
    for compression in lossless.into_iter().chain([PXR24, DWAA(None), DWAB(None)]) {
        for tiles in [None, Some(16), Some(64)] {
            let image = decode_exr(&foreign_exr(compression, tiles, (0, 0)), "foreign").unwrap();
            let picture = image.beauty().unwrap();
            assert_eq!((picture.width, picture.height), (45, 33));
            let expected = (44 * 7 + 32) as f32 / 64.0;
            let error = picture.get(44, 32) - Vec3::new(expected, expected, 2.0 * expected);
            assert!(error.abs().max_element() < 1e-2, "{compression:?} {tiles:?} {error}");
            let ids = image.layer("id").unwrap().channel("index").unwrap();
            assert_eq!(ids[45 * 33 - 1], (44 * 7 + 32) as f32);
        }
    }
    // A data window that reaches out of the display window, as crops and overscans have it.
    let moved = decode_exr(&foreign_exr(ZIP16, None, (-5, 3)), "moved").unwrap().beauty().unwrap();
    assert_eq!((moved.width, moved.height), (45, 33));
    assert_eq!(moved.get(0, 2), Vec3::ZERO);
    assert_eq!(moved.get(0, 3).x, 35.0 / 64.0);
    assert_eq!(moved.get(44, 10), Vec3::ZERO);
}

#[test]
fn pictures_are_written_by_extension_and_read_by_content() {
    let folder = tempfile::tempdir().unwrap();
    let picture = RgbImage::from_fn(20, 10, |x, y| Vec3::new(x as f32, y as f32, 0.25));
    for (name, tolerance) in [("a.exr", 0.0), ("a.hdr", 0.2), ("a.PFM", 0.0)] {
        let path = folder.path().join(name);
        assert!(PictureFormat::from_path(&path).unwrap().is_linear());
        write_linear(&path, &picture).unwrap();
        let renamed = folder.path().join("renamed.png");
        std::fs::rename(&path, &renamed).unwrap();
        let read = read_picture(&renamed).unwrap();
        for (a, b) in picture.pixels.iter().zip(&read.pixels) {
            assert!((*a - *b).abs().max_element() <= tolerance, "{name}");
        }
    }
    assert!(write_linear(Path::new("a.png"), &picture).is_err());
    let text = read_picture(Path::new("/nowhere/a.exr")).unwrap_err().to_string();
    assert!(text.starts_with("cannot read /nowhere/a.exr"), "{text}");
}

#[test]
fn a_full_disk_leaves_the_old_file() {
    if cfg!(target_os = "linux") {
        assert!(write_exr(Path::new("/dev/full"), &layered(30, 30)).is_err());
        assert!(write_linear(Path::new("/dev/full"), &RgbImage::new(9, 9, Vec3::ONE)).is_err());
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kept.exr");
    write_exr(&path, &layered(4, 4)).unwrap();
    let before = std::fs::read(&path).unwrap();
    let mut bad = layered(4, 4);
    bad.layers[0].channels.push(Channel {
        name: "A".into(),
        values: vec![],
        precision: Precision::Half,
    });
    assert!(write_exr(&path, &bad).is_err());
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
