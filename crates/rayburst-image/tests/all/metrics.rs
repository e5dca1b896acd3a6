//! Our metrics against flip-evaluator 1.7 and scikit-image 0.26 on stored values, which
//! `tests/peers/values.py` printed.

use glam::Vec3;
use rayburst_image::metrics::{Comparison, ExposureRange, relmse};
use rayburst_image::{Metric, RgbImage, StoredAs, compare};

use crate::pictures::{hdr_pair, ldr, noisy, reference, shifted, tinted};

struct Ldr {
    size: (i32, i32),
    test: fn(i32, i32, i32, i32) -> [i32; 3],
    flip: f64,
    /// At 0, 1, 2 and 3 quarters of both sides.
    flip_at: [f32; 4],
    rmse: f64,
    psnr: f64,
    ssim: f64,
}

struct Hdr {
    size: (i32, i32),
    flip: f64,
    flip_at: [f32; 4],
    start: f32,
    stop: f32,
    count: u32,
    rmse: f64,
}

#[rustfmt::skip]
const LDR: [Ldr; 6] = [
    Ldr { size: (96, 64), test: noisy, flip: 0.133296, flip_at: [0.105177, 0.123268, 0.057516, 0.172886], rmse: 0.067489, psnr: 23.415293, ssim: 0.610174 },
    Ldr { size: (96, 64), test: shifted, flip: 0.086846, flip_at: [0.000000, 0.000000, 0.190805, 0.359389], rmse: 0.136988, psnr: 17.266332, ssim: 0.839049 },
    Ldr { size: (96, 64), test: tinted, flip: 0.108759, flip_at: [0.037223, 0.125237, 0.152801, 0.093567], rmse: 0.020248, psnr: 33.872495, ssim: 0.996918 },
    Ldr { size: (37, 23), test: noisy, flip: 0.148211, flip_at: [0.108139, 0.066909, 0.128412, 0.128216], rmse: 0.067326, psnr: 23.436374, ssim: 0.813237 },
    Ldr { size: (37, 23), test: shifted, flip: 0.113306, flip_at: [0.000000, 0.001744, 0.162672, 0.406820], rmse: 0.150525, psnr: 16.447845, ssim: 0.804301 },
    Ldr { size: (37, 23), test: tinted, flip: 0.112651, flip_at: [0.042779, 0.133300, 0.138264, 0.107853], rmse: 0.020217, psnr: 33.885621, ssim: 0.998820 },
];

#[rustfmt::skip]
const HDR: [Hdr; 2] = [
    Hdr { size: (96, 64), flip: 0.094192, flip_at: [0.001630, 0.067989, 0.108578, 0.125515], start: -8.424656, stop: 1.661720, count: 11, rmse: 11.516578 },
    Hdr { size: (37, 23), flip: 0.119968, flip_at: [0.176836, 0.388919, 0.073813, 0.110257], start: -8.424656, stop: 4.456099, count: 13, rmse: 29.729480 },
];

/// Ten times closer than promised.
const TOLERANCE: f64 = 1e-4;

fn check(what: &str, ours: f64, theirs: f64, tolerance: f64) {
    assert!((ours - theirs).abs() < tolerance, "{what}: ours {ours}, theirs {theirs}");
}

fn check_map(comparison: &Comparison, (w, h): (i32, i32), theirs: [f32; 4]) {
    for (i, theirs) in (0..).zip(theirs) {
        let ours = comparison.map[(h * i / 4 * w + w * i / 4) as usize];
        check("a pixel of the map", ours.into(), theirs.into(), 3e-4);
    }
}

#[test]
fn ldr_metrics_agree_with_the_peers() {
    for case in LDR {
        let (a, b) = (ldr(case.size, reference), ldr(case.size, case.test));
        let run = |metric| compare(metric, &a, &b, StoredAs::Srgb).unwrap();
        let flip = run(Metric::Flip);
        check("flip", flip.value, case.flip, TOLERANCE);
        check_map(&flip, case.size, case.flip_at);
        check("rmse", run(Metric::Rmse).value, case.rmse, TOLERANCE);
        check("psnr", run(Metric::Psnr).value, case.psnr, 1e-3);
        check("ssim", run(Metric::Ssim).value, case.ssim, TOLERANCE);
    }
}

#[test]
fn hdr_metrics_agree_with_the_peers() {
    for case in HDR {
        let [a, b] = hdr_pair(case.size);
        let range = ExposureRange::of(&a);
        check("start", range.start.into(), case.start.into(), TOLERANCE);
        check("stop", range.stop.into(), case.stop.into(), TOLERANCE);
        assert_eq!(range.count, case.count);
        let flip = compare(Metric::HdrFlip, &a, &b, StoredAs::Linear).unwrap();
        check("hdr-flip", flip.value, case.flip, TOLERANCE);
        check_map(&flip, case.size, case.flip_at);
        let rmse = compare(Metric::Rmse, &a, &b, StoredAs::Linear).unwrap().value;
        check("rmse", rmse, case.rmse, 1e-3);
    }
}

#[test]
fn equal_pictures_have_the_best_value() {
    let a = ldr((40, 30), noisy);
    for (name, metric) in Metric::ALL {
        assert_eq!(Metric::from_name(name), Some(metric));
        assert_eq!(metric.name(), name);
        let result = compare(metric, &a, &a, StoredAs::Srgb).unwrap();
        let best = match metric {
            Metric::Psnr => f64::INFINITY,
            Metric::Ssim => 1.0,
            _ => 0.0,
        };
        assert!(result.value == best || (result.value - best).abs() < 1e-12, "{name}");
        assert!(result.map.iter().all(|v| v.abs() < 1e-6), "{name}");
        assert_eq!(result.heat_map().data[..3], [0, 0, 4], "{name}");
    }
}

#[test]
fn relative_error_by_hand() {
    let (a, b) = (RgbImage::new(2, 2, Vec3::splat(3.0)), RgbImage::new(2, 2, Vec3::splat(3.3)));
    check("relmse", relmse(&a, &b), 0.09 / 9.01, 1e-6);
}

#[test]
fn what_cannot_be_compared_is_said() {
    let a = RgbImage::new(8, 8, Vec3::ONE);
    let mut b = a.clone();
    let text = compare(Metric::Ssim, &a, &b, StoredAs::Srgb).unwrap_err().to_string();
    assert!(text.contains("at least 11x11"), "{text}");
    b.pixels[10].y = f32::NAN;
    let text = compare(Metric::Rmse, &a, &b, StoredAs::Linear).unwrap_err().to_string();
    assert!(text.contains("1 pixels") && text.contains("(2, 1)"), "{text}");
    let c = RgbImage::new(8, 9, Vec3::ONE);
    assert!(compare(Metric::Flip, &a, &c, StoredAs::Srgb).is_err());
}

#[test]
fn black_references_have_an_exposure_range() {
    let black = RgbImage::new(12, 12, Vec3::ZERO);
    let mut mostly = black.clone();
    mostly.pixels[5] = Vec3::splat(2.0);
    for reference in [&black, &mostly] {
        let range = ExposureRange::of(reference);
        assert!(range.start.is_finite() && range.stop >= range.start && range.count == 2);
        let flip = compare(Metric::HdrFlip, reference, &mostly, StoredAs::Linear).unwrap();
        assert!(flip.value.is_finite() && (flip.value > 0.0) == (reference == &black));
    }
}
