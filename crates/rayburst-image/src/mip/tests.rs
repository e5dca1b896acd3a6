use super::*;
use crate::RgbImage;
use crate::colour::{luminance, srgb_decode};
use rayburst_math::hash::Rng;

fn texels(width: u32, height: u32, channels: u8, mut byte: impl FnMut(u32) -> u8) -> Texels {
    let data = (0..width * height * u32::from(channels)).map(&mut byte).collect();
    Texels { width, height, channels, data }
}

#[test]
fn a_checkerboard_averages_in_linear_light() {
    let board = texels(8, 8, 1, |i| if (i + i / 8) % 2 == 0 { 255 } else { 0 });
    let srgb = MipMap::new(board.clone(), TexelFormat::Srgb);
    // Half the light is sRGB 188, not 128.
    assert!((srgb.texel(1, 0, 0)[0] - srgb_decode(188.0 / 255.0)).abs() < 1e-6);
    let linear = MipMap::new(board, TexelFormat::Linear);
    assert!((linear.texel(1, 0, 0)[0] - 128.0 / 255.0).abs() < 1e-6);
    assert_eq!(linear.levels().len(), 4);
}

#[test]
fn every_size_keeps_its_mean() {
    let mut rng = Rng::new(5);
    for (width, height) in [(1, 1), (1, 9), (7, 1), (5, 3), (31, 17), (64, 48), (13, 128)] {
        let picture = RgbImage::from_fn(width, height, |_, _| rng.vec3());
        let mean = |p: &RgbImage| {
            p.pixels.iter().map(|&c| f64::from(luminance(c))).sum::<f64>() / p.pixels.len() as f64
        };
        let pyramid = RgbPyramid::new(picture);
        let last = pyramid.levels().last().unwrap();
        assert_eq!((last.width, last.height), (1, 1));
        for level in pyramid.levels() {
            assert!((mean(level) - mean(&pyramid.levels()[0])).abs() < 1e-5, "{width}x{height}");
        }
    }
}

#[test]
fn a_constant_texture_stays_constant_in_every_format() {
    for channels in 1..=4u8 {
        for format in [TexelFormat::Srgb, TexelFormat::Linear] {
            for byte in [0u8, 1, 77, 128, 254, 255] {
                let map = MipMap::new(texels(13, 6, channels, |_| byte), format);
                let level = map.levels().len() - 1;
                assert_eq!(map.texel(level, 0, 0), map.texel(0, 12, 5), "{channels} {format:?}");
            }
        }
    }
}

#[test]
fn hidden_colour_does_not_bleed() {
    // A green leaf beside transparent black, and a wholly transparent red corner.
    let mut leaf = texels(4, 4, 4, |i| [0, 0, 0, 0][i as usize % 4]);
    for x in [0, 2] {
        for y in 0..2 {
            leaf.data[(y * 4 + x) * 4..][..4].copy_from_slice(&[20, 200, 30, 255]);
        }
    }
    for (x, y) in [(2, 2), (3, 2), (2, 3), (3, 3)] {
        leaf.data[(y * 4 + x) * 4] = 255;
    }
    let map = MipMap::new(leaf, TexelFormat::Srgb);
    let [_, green, _, alpha] = map.texel(1, 0, 0);
    assert!((green - map.texel(0, 0, 0)[1]).abs() < 0.01, "{green}");
    assert!((alpha - 0.5).abs() < 0.01 && map.alpha(1, 0, 0) == alpha);
    let [red, _, _, alpha] = map.texel(1, 1, 1);
    assert!(red > 0.99 && alpha == 0.0, "{red} {alpha}");
}

#[test]
fn channels_expand_and_cost_what_they_hold() {
    let grey_alpha =
        MipMap::new(texels(2, 1, 2, |i| [51, 102, 153, 204][i as usize]), TexelFormat::Linear);
    let close = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(close(grey_alpha.texel(0, 1, 0), [0.6, 0.6, 0.6, 0.8]));
    let rgb = MipMap::new(texels(1024, 1024, 3, |i| i as u8), TexelFormat::Srgb);
    assert_eq!(rgb.bytes(), 3 * (4u32.pow(11) as usize - 1) / 3);
    assert_eq!(rgb.texel(0, 0, 0)[3], 1.0);
    assert_eq!(rgb.alpha(3, 5, 5), 1.0);
}
