//! Damaged files: truncated, with flipped bits, with extreme numbers. Every outcome but a value or
//! an error is a failure, and so is memory out of proportion.

use std::io::Cursor;

use glam::Vec3;
use rayburst_image::file::hdr::encode_hdr;
use rayburst_image::file::pfm::decode_pfm;
use rayburst_image::{
    RgbImage, decode_exr, decode_hdr, decode_ldr, decode_picture, decode_texture, encode_exr,
};
use rayburst_math::hash::Rng;

use crate::files::{foreign_exr, layered};

/// Damaged variants of each sample.
const VARIANTS: usize = 400;

/// Real samples are a few kilobytes; nothing they may promise takes more than this.
const MOST_MEMORY_KB: u64 = 128 << 10;

fn damage(sample: &[u8], rng: &mut Rng) -> Vec<u8> {
    let mut bytes = sample.to_vec();
    let n = bytes.len() as u32;
    // Half of the damage hits the header.
    let place = |rng: &mut Rng| {
        let end = if rng.below(2) == 0 { n.min(400) } else { n };
        rng.below(end) as usize
    };
    match rng.below(4) {
        0 => bytes.truncate(rng.below(n) as usize),
        1 => {
            for _ in 0..=rng.below(8) {
                let at = place(rng);
                bytes[at] ^= 1 << rng.below(8);
            }
        }
        2 => {
            let words = [0u32, 1, 0x7fff_ffff, u32::MAX, 0x8000_0000, 0xffff, 100_000];
            let word = words[rng.below(words.len() as u32) as usize];
            let at = place(rng).min(bytes.len() - 4);
            let word = if rng.below(2) == 0 { word.to_le_bytes() } else { word.to_be_bytes() };
            bytes[at..at + 4].copy_from_slice(&word);
        }
        _ => {
            // A stretch moved elsewhere, or repeated.
            let (from, to) = (place(rng), place(rng));
            let length = (1 + rng.below(64) as usize).min(bytes.len() - from.max(to));
            bytes.copy_within(from..from + length, to);
        }
    }
    bytes
}

fn try_all(sample: &[u8], decode: impl Fn(&[u8]) -> bool) {
    assert!(decode(sample), "the sample itself must be good");
    let before = peak_memory_kb();
    let mut rng = Rng::new(sample.len() as u64);
    let mut refused = 0;
    for _ in 0..VARIANTS {
        refused += usize::from(!decode(&damage(sample, &mut rng)));
    }
    assert!(refused > VARIANTS / 8, "only {refused} of {VARIANTS} were refused");
    // The system counts in batches, so the figure may be a little less than before.
    let grown = peak_memory_kb().saturating_sub(before);
    assert!(grown < MOST_MEMORY_KB, "memory grew by {grown} KiB");
}

/// The most memory the process ever had; 0 where the system does not tell.
fn peak_memory_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM:"));
    line.and_then(|l| l.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
}

fn picture() -> RgbImage {
    let mut rng = Rng::new(4);
    RgbImage::from_fn(40, 30, |x, _| if x < 20 { Vec3::splat(0.5) } else { rng.vec3() })
}

fn encoded(picture: image::DynamicImage, format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn bytes_of(picture: &RgbImage) -> image::RgbImage {
    image::RgbImage::from_fn(picture.width, picture.height, |x, y| {
        image::Rgb((picture.get(x, y) * 255.0).to_array().map(|v| v as u8))
    })
}

#[test]
fn damaged_exr_files() {
    let own = encode_exr(&layered(20, 18), "own").unwrap();
    try_all(&own, |bytes| decode_exr(bytes, "own").is_ok());
}

#[test]
fn damaged_foreign_exr_files() {
    use exr::prelude::Compression::*;
    for compression in [Uncompressed, RLE, ZIP1, PIZ, PXR24, DWAA(None)] {
        for tiles in [None, Some(16)] {
            let sample = foreign_exr(compression, tiles, (0, 0));
            try_all(&sample, |bytes| decode_exr(bytes, "foreign").is_ok());
        }
    }
}

#[test]
fn exr_compressions_that_are_not_read_are_named() {
    let sample = foreign_exr(exr::prelude::Compression::B44, None, (0, 0));
    let text = decode_exr(&sample, "b.exr").unwrap_err().to_string();
    assert_eq!(text, "b.exr: B44 compression is not read; save it with ZIP or PIZ");
}

#[test]
fn damaged_hdr_files() {
    let sample = encode_hdr(&picture(), "p").unwrap();
    try_all(&sample, |bytes| decode_hdr(bytes, "hdr").is_ok());
    // The old run lengths: one pixel, then runs.
    let mut old = b"#?RADIANCE\nGAMMA=1\n# a line without an equals sign\n\n-Y 2 +X 300\n".to_vec();
    for _ in 0..2 {
        old.extend([128, 64, 32, 129, 1, 1, 1, 43, 1, 1, 1, 1]);
    }
    assert_eq!(decode_hdr(&old, "old").unwrap().get(299, 1).x, 128.5 / 256.0 * 2.0);
    try_all(&old, |bytes| decode_hdr(bytes, "old").is_ok());
}

#[test]
fn damaged_png_and_jpeg_files() {
    let bytes = bytes_of(&picture());
    let rgba = image::DynamicImage::from(bytes.clone()).into_rgba16();
    let grey = image::DynamicImage::from(bytes.clone()).into_luma8();
    for sample in [
        encoded(bytes.clone().into(), image::ImageFormat::Png),
        encoded(rgba.into(), image::ImageFormat::Png),
        encoded(grey.into(), image::ImageFormat::Png),
        encoded(bytes.into(), image::ImageFormat::Jpeg),
    ] {
        try_all(&sample, |bytes| {
            decode_texture(bytes, "texture").is_ok() && decode_ldr(bytes, "picture").is_ok()
        });
    }
}

#[test]
fn damaged_pfm_files_and_noise() {
    let mut pfm = b"PF\n8 4\n-1.0\n".to_vec();
    pfm.extend([7; 8 * 4 * 12]);
    try_all(&pfm, |bytes| decode_pfm(bytes, "pfm").is_ok());
    let mut rng = Rng::new(8);
    for start in
        [&b""[..], b"#?RADIANCE\n", b"PF\n", b"\x76\x2f\x31\x01\x02\0\0\0", b"\xff\xd8\xff"]
    {
        for length in 0..60 {
            let mut bytes = start.to_vec();
            bytes.extend((0..length).map(|_| rng.u32() as u8));
            assert!(decode_picture(&bytes, "noise").is_err());
        }
    }
}

#[test]
fn promises_that_a_small_file_cannot_keep_are_refused() {
    let text = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16000 +X 16000\n";
    let mut hdr = text.as_bytes().to_vec();
    hdr.extend([1; 100]);
    let error = decode_hdr(&hdr, "bomb.hdr").unwrap_err().to_string();
    assert!(error.contains("256000000"), "{error}");
    let huge = b"#?RADIANCE\n\n-Y 100000 +X 100000\n";
    let error = decode_hdr(huge, "huge.hdr").unwrap_err().to_string();
    assert!(error.contains("10000000000") && error.contains("268435456"), "{error}");
    // The windows of an EXR file, wherever they stand in its header.
    for name in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
        for side in [15_999i32, 99_999, i32::MAX] {
            let mut exr = encode_exr(&layered(20, 18), "own").unwrap();
            let at = exr.windows(name.len()).position(|w| w == name.as_bytes()).unwrap();
            let value = at + name.len() + 4;
            for i in [2, 3] {
                exr[value + 4 * i..][..4].copy_from_slice(&side.to_le_bytes());
            }
            assert!(decode_exr(&exr, "bomb.exr").is_err(), "{name} {side}");
        }
    }
}
