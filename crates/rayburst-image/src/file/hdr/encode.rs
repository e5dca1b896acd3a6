//! Writing Radiance pictures with the new run lengths.

use std::io::Write;

use glam::Vec3;

use crate::colour::clamp_bad;
use crate::limits::check_size;
use crate::{ImageError, Result, RgbImage};

/// Encodes a Radiance picture in memory; negative and NaN components become 0, large ones clip.
pub fn encode_hdr(picture: &RgbImage, name: &str) -> Result<Vec<u8>> {
    check_size(name, picture.width.into(), picture.height.into())?;
    let mut bytes = Vec::with_capacity(picture.pixels.len() * 4 + 64);
    let (width, height) = (picture.width, picture.height);
    write!(bytes, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n")
        .map_err(|e| ImageError::Invalid(e.to_string()))?;
    for row in picture.pixels.chunks_exact(width as usize) {
        let row: Vec<[u8; 4]> = row.iter().map(|&p| from_linear(p)).collect();
        if (8..32_768).contains(&width) {
            bytes.extend([2, 2, (width >> 8) as u8, width as u8]);
            for component in 0..4 {
                let values: Vec<u8> = row.iter().map(|p| p[component]).collect();
                pack(&values, &mut bytes);
            }
        } else {
            bytes.extend(row.as_flattened());
        }
    }
    Ok(bytes)
}

/// Runs of at least four equal values, else stretches of up to 128 different ones.
fn pack(values: &[u8], bytes: &mut Vec<u8>) {
    let run_at = |x: usize| values[x..].iter().take(127).take_while(|&&v| v == values[x]).count();
    let mut x = 0;
    while x < values.len() {
        let run = run_at(x);
        if run >= 4 {
            bytes.extend([128 + run as u8, values[x]]);
            x += run;
            continue;
        }
        let begin = x;
        while x < values.len() && x - begin < 128 && run_at(x) < 4 {
            x += 1;
        }
        bytes.push((x - begin) as u8);
        bytes.extend(&values[begin..x]);
    }
}

/// The largest component gets a mantissa from 128 to 255. Mantissas are truncated, since readers
/// take the middle of the step.
fn from_linear(colour: Vec3) -> [u8; 4] {
    let clean = Vec3::from_array(colour.to_array().map(|v| clamp_bad(v, 1e38)));
    let largest = clean.max_element();
    if largest < 1e-38 {
        return [0; 4];
    }
    // frexp: largest = m × 2^exponent with m in [0.5, 1).
    let exponent = (largest.to_bits() >> 23) as i32 - 126;
    let scale = 256.0 * (-(exponent as f32)).exp2();
    let mantissa = |v: f32| (v * scale) as u8;
    // The largest is at least 128, so that no pixel looks like an old run's mark 1 1 1.
    let [r, g, b] = clean.to_array().map(mantissa);
    [r, g, b, (exponent + 128) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::hdr::decode_hdr;
    use rayburst_math::hash::Rng;

    fn noisy(width: u32, height: u32) -> RgbImage {
        let mut rng = Rng::new(9);
        RgbImage::from_fn(width, height, |x, y| {
            if (x / 9 + y / 3) % 2 == 0 {
                return Vec3::splat(0.5 + (x / 9) as f32);
            }
            rng.vec3() * 10f32.powf(rng.range(-20.0, 20.0))
        })
    }

    #[test]
    fn what_is_written_is_read_within_half_a_step() {
        for (width, height) in [(1, 1), (7, 3), (8, 8), (300, 20), (33_000, 1)] {
            let picture = noisy(width, height);
            let bytes = encode_hdr(&picture, "p").unwrap();
            let read = decode_hdr(&bytes, "p").unwrap();
            assert_eq!((read.width, read.height), (width, height));
            for (a, b) in picture.pixels.iter().zip(&read.pixels) {
                let step = a.max_element() / 128.0;
                assert!((*a - *b).abs().max_element() <= 0.501 * step, "{a} {b}");
            }
            // What was read once stays the same for ever.
            assert_eq!(encode_hdr(&read, "p").unwrap(), bytes);
        }
    }

    #[test]
    fn runs_make_flat_pictures_small() {
        let bytes = encode_hdr(&RgbImage::new(1024, 64, Vec3::ONE), "p").unwrap();
        assert!(bytes.len() < 64 * 80, "{}", bytes.len());
    }

    #[test]
    fn unusual_values_stay_in_range() {
        let values = [f32::NAN, -1.0, f32::INFINITY, 1e-45, f32::MAX, 0.0, 1.0];
        let picture = RgbImage::from_fn(7, 1, |x, _| Vec3::splat(values[x as usize]));
        let read = decode_hdr(&encode_hdr(&picture, "p").unwrap(), "p").unwrap();
        assert_eq!(read.pixels[0], Vec3::ZERO);
        assert_eq!(read.pixels[1], Vec3::ZERO);
        assert!(read.pixels[2].x > 9e37 && read.pixels[2].is_finite());
        assert!((read.pixels[6].x - 1.0).abs() < 0.005);
    }
}
