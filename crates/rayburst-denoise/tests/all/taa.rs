//! Temporal anti-aliasing: what still pictures converge to, and that nothing stays that is gone.

use glam::{Vec2, Vec3};
use rayburst_denoise::{DenoiseError, TaaSettings, Taps, TemporalAntialiasing};
use rayburst_image::{Plane, Plane3};
use rayburst_math::hash::Rng;
use rayburst_simd::IsaLevel;

use crate::views::{
    SIZES, View, assert_near, assert_same_everywhere, assert_sane, fill3, isa, jitter, mean,
    pattern, pixels3, rmse, spoil3, supersampled,
};

const SIZE: (u32, u32) = (96, 64);

/// A frame of the pattern whose rays go through the pixels at a jitter.
fn frame(size: (u32, u32), jitter: Vec2) -> Plane3 {
    fill3(size, |x, y| pattern(Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + jitter))
}

fn still(frames: u32, settings: &TaaSettings) -> Plane3 {
    let view = View::wall(SIZE.0, SIZE.1);
    let mut taa = TemporalAntialiasing::new(isa());
    let mut out = Plane3::default();
    for i in 0..frames {
        let j = jitter(i);
        taa.resolve(&frame(SIZE, j), &view.guides(), j, None, settings, &mut out).unwrap();
    }
    out
}

/// The kernel that samples count by.
fn kernel(d: Vec2) -> f32 {
    let bell = |d: f32| (1.0 - d * d).max(0.0).powi(2);
    bell(d.x) * bell(d.y)
}

#[test]
fn still_pictures_converge_to_supersampled_ones() {
    let truth = pixels3(&supersampled(SIZE, Vec2::ONE, kernel));
    let error = |frames, settings: &TaaSettings| rmse(&pixels3(&still(frames, settings)), &truth);
    let alone = rmse(&pixels3(&frame(SIZE, Vec2::ZERO)), &truth);
    let default = TaaSettings::default();
    let (few, many) = (error(8, &default), error(64, &default));
    let loose = TaaSettings { deviations: 1e3, longest: 64.0, ..default };
    let exact = error(64, &loose);
    assert!(few < 0.5 * alone && many < 0.25 * alone, "{alone} {few} {many}");
    assert!(exact < 0.1 * alone, "{exact}");
}

#[test]
fn dimmed_pictures_converge_to_the_mean_of_compressed_colours() {
    // Every pixel is bright in one frame of four: its luma is averaged as Y/(1 + kY).
    let view = View::wall(16, 16);
    let settings =
        TaaSettings { dimming: 2.0, deviations: 1e3, longest: 1e3, ..TaaSettings::default() };
    let mut taa = TemporalAntialiasing::new(isa());
    let mut out = Plane3::default();
    for i in 0..200 {
        let colour =
            fill3((16, 16), |x, y| Vec3::splat(if (x + 2 * y + i) % 4 == 0 { 8.0 } else { 0.5 }));
        let result = taa.resolve(&colour, &view.guides(), Vec2::ZERO, None, &settings, &mut out);
        result.unwrap();
    }
    let squeeze = |v: f32| v / (1.0 + 2.0 * v);
    let mean = 0.25 * squeeze(8.0) + 0.75 * squeeze(0.5);
    let expected = mean / (1.0 - 2.0 * mean);
    assert_near(&pixels3(&out), expected, 0.03);
}

#[test]
fn ghosts_go() {
    // A bright square moves over a dark textured wall; motion vectors know nothing of it.
    let view = View::wall(SIZE.0, SIZE.1);
    let ground = |x: u32, y: u32| 0.1 + 0.05 * ((x / 3 + y / 5) % 2) as f32;
    let frame = |left: u32| {
        fill3(SIZE, |x, y| {
            let inside = (left..left + 16).contains(&x) && (20..36).contains(&y);
            Vec3::splat(if inside { 1.0 } else { ground(x, y) })
        })
    };
    let run = |deviations: f32| {
        let settings = TaaSettings { deviations, ..TaaSettings::default() };
        let mut taa = TemporalAntialiasing::new(isa());
        let mut out = Plane3::default();
        for i in 0..40 {
            let left = if i < 32 { 8 } else { 60 };
            let result =
                taa.resolve(&frame(left), &view.guides(), Vec2::ZERO, None, &settings, &mut out);
            result.unwrap();
        }
        let left = (10..22).map(|x| out.get(x, 28).x - ground(x, 28));
        left.fold(0.0f32, |most, off| most.max(off.abs()))
    };
    let (clipped, free) = (run(TaaSettings::default().deviations), run(1e6));
    assert!(clipped < 0.02 && free > 0.3, "{clipped} {free}");
}

#[test]
fn moving_pictures_are_followed() {
    // The whole wall moves by a fraction of a pixel, and the motion says so.
    let mut view = View::wall(SIZE.0, SIZE.1);
    let step = Vec2::new(0.75, -0.5);
    view.motion[0].fill(-step.x);
    view.motion[1].fill(-step.y);
    let smooth = |p: Vec2| Vec3::splat(0.5 + 0.2 * (0.3 * p.x).sin() + 0.2 * (0.25 * p.y).cos());
    let mut rng = Rng::new(4);
    let mut taa = TemporalAntialiasing::new(isa());
    let (mut out, mut clean) = (Plane3::default(), Plane3::default());
    let mut noisy = Plane3::default();
    for i in 0..24 {
        let at = |x, y| Vec2::new(x as f32, y as f32) - step * i as f32;
        clean = fill3(SIZE, |x, y| smooth(at(x, y)));
        noisy = fill3(SIZE, |x, y| smooth(at(x, y)) + Vec3::splat(0.1 * (rng.f32() - 0.5)));
        let settings = TaaSettings::default();
        taa.resolve(&noisy, &view.guides(), Vec2::ZERO, None, &settings, &mut out).unwrap();
    }
    let (before, after) =
        (rmse(&pixels3(&noisy), &pixels3(&clean)), rmse(&pixels3(&out), &pixels3(&clean)));
    assert!(2.0 * after < before, "{before} {after}");
}

#[test]
fn constants_stay() {
    for size in SIZES {
        let view = View::wall(size.0, size.1);
        let colour = fill3(size, |_, _| Vec3::new(0.3, 0.7, 0.1));
        for dimming in [0.0, 1.0] {
            let settings = TaaSettings { dimming, ..TaaSettings::default() };
            let mut taa = TemporalAntialiasing::new(isa());
            let mut out = Plane3::default();
            for i in 0..10 {
                taa.resolve(&colour, &view.guides(), jitter(i), None, &settings, &mut out).unwrap();
                assert!(rmse(&pixels3(&out), &pixels3(&colour)) < 1e-6);
                assert!(
                    pixels3(&out).iter().zip(pixels3(&colour)).all(|(a, b)| (a - b).abs() < 1e-5)
                );
            }
        }
    }
}

#[test]
fn bad_numbers_and_sizes() {
    let settings = TaaSettings::default();
    for size in SIZES {
        let view = View::wall(size.0, size.1).spoilt();
        let colour = spoil3(frame(size, Vec2::ZERO));
        let mut taa = TemporalAntialiasing::new(isa());
        let mut out = Plane3::default();
        for i in 0..5 {
            taa.resolve(&colour, &view.guides(), jitter(i), None, &settings, &mut out).unwrap();
            assert_sane(&pixels3(&out));
        }
    }
    let view = View::wall(8, 8);
    let (small, right) = (Plane3::new(8, 7).unwrap(), Plane3::new(8, 8).unwrap());
    let taps = Plane::new(7, 8).unwrap();
    let mut taa = TemporalAntialiasing::new(isa());
    let mut out = Plane3::default();
    let result = taa.resolve(&small, &view.guides(), Vec2::ZERO, None, &settings, &mut out);
    assert!(matches!(result, Err(DenoiseError::Mismatch { .. })));
    let result = taa.resolve(&right, &view.guides(), Vec2::ZERO, Some(&taps), &settings, &mut out);
    assert!(matches!(result, Err(DenoiseError::Mismatch { .. })));
    let result = taa.resolve(&right, &view.guides(), Vec2::splat(0.6), None, &settings, &mut out);
    assert!(matches!(result, Err(DenoiseError::Setting { .. })));
    // Another size has no history, and does not fail.
    let bright = fill3((8, 8), |_, _| Vec3::ONE);
    taa.resolve(&bright, &view.guides(), Vec2::ZERO, None, &settings, &mut out).unwrap();
    let view = View::wall(20, 5);
    let dark = Plane3::new(20, 5).unwrap();
    taa.resolve(&dark, &view.guides(), Vec2::ZERO, None, &settings, &mut out).unwrap();
    assert_near(&pixels3(&out), 0.0, 0.0);
}

#[test]
fn threads_and_instruction_sets_do_not_matter() {
    let size = (67, 41);
    let mut view = View::wall(size.0, size.1);
    view.motion[0].fill(0.3);
    assert_same_everywhere(|isa: IsaLevel| {
        let mut taa = TemporalAntialiasing::new(isa);
        let mut out = Plane3::default();
        for i in 0..4 {
            let (j, settings) = (jitter(i), TaaSettings::default());
            taa.resolve(&frame(size, j), &view.guides(), j, None, &settings, &mut out).unwrap();
        }
        pixels3(&out)
    });
}

#[test]
fn means_are_kept_where_nothing_is_clipped() {
    let view = View::wall(SIZE.0, SIZE.1);
    let settings = TaaSettings { deviations: 1e6, ..TaaSettings::default() };
    let mut rng = Rng::new(8);
    let mut taa = TemporalAntialiasing::new(isa());
    let (mut out, mut sums) = (Plane3::default(), [0.0; 2]);
    for i in 0..16 {
        let colour = fill3(SIZE, |_, _| rng.vec3());
        taa.resolve(&colour, &view.guides(), jitter(i), None, &settings, &mut out).unwrap();
        sums[0] += mean(&pixels3(&colour)) / 16.0;
    }
    sums[1] = mean(&pixels3(&out));
    assert!((sums[1] / sums[0] - 1.0).abs() < 0.01, "{sums:?}");
}

#[test]
fn a_surface_that_was_not_seen_counts_for_a_frame() {
    // Black before, then white with a little texture; clipping is off.
    let view = View::wall(32, 16);
    let settings = TaaSettings { deviations: 1e6, ..TaaSettings::default() };
    let run = |taps: Option<&Plane<Taps>>| {
        let mut taa = TemporalAntialiasing::new(isa());
        let mut out = Plane3::default();
        for i in 0..9 {
            let value = if i < 8 { 0.0 } else { 1.0 };
            let colour = fill3((32, 16), |x, y| Vec3::splat(value + 0.01 * ((x + y) % 2) as f32));
            taa.resolve(&colour, &view.guides(), Vec2::ZERO, taps, &settings, &mut out).unwrap();
        }
        mean(&pixels3(&out))
    };
    let none = Plane::new(32, 16).unwrap();
    let (seen, unseen) = (run(None), run(Some(&none)));
    assert!(seen < 0.2 && unseen > 0.45, "{seen} {unseen}");
}
