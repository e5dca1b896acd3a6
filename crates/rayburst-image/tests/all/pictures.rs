//! Test pictures from integer formulas; `tests/peers/values.py` has the same in Python.

use glam::Vec3;
use rayburst_image::RgbImage;
use rayburst_image::colour::srgb_table;
use rayburst_math::hash::pcg;

type Bytes = [i32; 3];

pub(crate) fn reference(w: i32, h: i32, x: i32, y: i32) -> Bytes {
    if (x - w / 3).pow(2) + (y - h / 2).pow(2) < (h / 4).pow(2) {
        return [220, 60, 40];
    }
    if x > 2 * w / 3 && ((x + y) / 3) % 2 == 0 {
        return [30, 40, 200];
    }
    [255 * x / (w - 1), 255 * y / (h - 1), (4 * (x ^ y)) & 255]
}

pub(crate) fn noisy(w: i32, h: i32, x: i32, y: i32) -> Bytes {
    let c = reference(w, h, x, y);
    let noise = |i: usize| (pcg((3 * (y * w + x) + i as i32) as u32) % 61) as i32 - 30;
    std::array::from_fn(|i| (c[i] + noise(i)).clamp(0, 255))
}

pub(crate) fn shifted(w: i32, h: i32, x: i32, y: i32) -> Bytes {
    if 2 * y > h { reference(w, h, (x - 1).max(0), y) } else { reference(w, h, x, y) }
}

pub(crate) fn tinted(w: i32, h: i32, x: i32, y: i32) -> Bytes {
    let c = reference(w, h, x, y);
    [(c[0] + 9).min(255), c[1], c[2]]
}

fn radiance(w: i32, h: i32, x: i32, y: i32) -> Vec3 {
    if (x - 3 * w / 4).pow(2) + (y - h / 4).pow(2) < 20 {
        return Vec3::new(900.0, 700.0, 500.0);
    }
    let scale = 2f32.powi(x / 12 % 8 - 5) / 64.0;
    Vec3::from_array(reference(w, h, x, y).map(|v| v as f32)) * scale
}

fn grainy(w: i32, h: i32, x: i32, y: i32) -> Vec3 {
    if (x, y) == (w / 5, h / 5) {
        return Vec3::new(300.0, 300.0, 250.0);
    }
    let grain = |i: i32| {
        let noise = pcg((3 * (y * w + x) + i + 7) as u32) % 33;
        1.0 + (noise as f32 - 16.0) / 64.0
    };
    radiance(w, h, x, y) * Vec3::new(grain(0), grain(1), grain(2))
}

/// A picture of sRGB bytes, as linear values.
pub(crate) fn ldr((w, h): (i32, i32), f: fn(i32, i32, i32, i32) -> Bytes) -> RgbImage {
    let table = srgb_table();
    RgbImage::from_fn(w as u32, h as u32, |x, y| {
        Vec3::from_array(f(w, h, x as i32, y as i32).map(|v| table[v as usize]))
    })
}

/// A linear picture of many stops, and one with grain and a firefly.
pub(crate) fn hdr_pair((w, h): (i32, i32)) -> [RgbImage; 2] {
    [radiance, grainy]
        .map(|f| RgbImage::from_fn(w as u32, h as u32, |x, y| f(w, h, x as i32, y as i32)))
}
