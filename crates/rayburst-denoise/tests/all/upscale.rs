//! Temporal upscaling: what still pictures converge to, and that nothing stays that is gone.

use glam::{Vec2, Vec3};
use rayburst_denoise::{
    DenoiseError, Reprojection, SurfaceTests, TemporalUpscaling, UpscaleSettings,
};
use rayburst_image::{Plane, Plane3};
use rayburst_math::hash::Rng;
use rayburst_simd::IsaLevel;

use crate::views::{
    Eye, SIZES, View, assert_near, assert_same_everywhere, assert_sane, fill3, isa, jitter, mean,
    pattern, pixels3, rmse, spoil3, supersampled,
};

const SIZE: (u32, u32) = (128, 96);

/// A frame of fewer pixels of the pattern, which is given in output pixels.
fn frame(small: (u32, u32), jitter: Vec2) -> Plane3 {
    let scale = scale(small);
    fill3(small, |x, y| pattern((Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + jitter) * scale))
}

fn scale(small: (u32, u32)) -> Vec2 {
    Vec2::new(SIZE.0 as f32 / small.0 as f32, SIZE.1 as f32 / small.1 as f32)
}

fn still(isa: IsaLevel, small: (u32, u32), frames: u32, settings: &UpscaleSettings) -> Plane3 {
    let view = View::wall(small.0, small.1);
    let mut upscaling = TemporalUpscaling::new(isa);
    let mut out = Plane3::default();
    for i in 0..frames {
        let (j, guides) = (jitter(i), view.guides());
        let colour = frame(small, j);
        upscaling.resolve(&colour, &guides, j, None, settings, SIZE, &mut out).unwrap();
    }
    out
}

/// A frame interpolated linearly.
fn bilinear(small: &Plane3) -> Plane3 {
    let scale = scale(small.size());
    fill3(SIZE, |x, y| {
        let p = (Vec2::new(x as f32, y as f32) + 0.5) / scale - 0.5;
        let (x, y) = (p.x.floor(), p.y.floor());
        let at = |i: f32, j: f32| {
            let c = |c: usize| small.channels[c].get_clamped((x + i) as i32, (y + j) as i32);
            Vec3::new(c(0), c(1), c(2))
        };
        let (fx, fy) = (p.x - x, p.y - y);
        at(0.0, 0.0).lerp(at(1.0, 0.0), fx).lerp(at(0.0, 1.0).lerp(at(1.0, 1.0), fx), fy)
    })
}

fn box_kernel(d: Vec2) -> f32 {
    if d.abs().max_element() < 0.5 { 1.0 } else { 0.0 }
}

fn psnr(a: &Plane3, b: &Plane3) -> f64 {
    -20.0 * rmse(&pixels3(a), &pixels3(b)).log10()
}

#[test]
fn still_pictures_converge_beyond_bilinear_ones() {
    let truth = supersampled(SIZE, Vec2::ONE, box_kernel);
    for (small, gain) in [((64, 48), 8.0), ((86, 64), 8.0), ((128, 96), 8.0)] {
        let alone = psnr(&bilinear(&frame(small, Vec2::ZERO)), &truth);
        let settings = UpscaleSettings::default();
        let [few, many] = [8, 64].map(|n| psnr(&still(isa(), small, n, &settings), &truth));
        assert!(many > alone + gain, "{small:?}: {alone} to {many}");
        assert!(few > alone + 3.0, "{small:?}: {alone} to {few}");
    }
}

#[test]
fn the_first_frame_is_no_worse_than_bilinear() {
    let truth = supersampled(SIZE, Vec2::ONE, box_kernel);
    let small = (64, 48);
    let alone = psnr(&bilinear(&frame(small, Vec2::ZERO)), &truth);
    let first = psnr(&still(isa(), small, 1, &UpscaleSettings::default()), &truth);
    assert!(first > alone - 0.5, "{first} {alone}");
}

#[test]
fn nothing_stays_where_something_was_in_front() {
    // A near square moves to the right before a wall, and uncovers it.
    let small = (64, 48);
    let truth = |i: u32, p: Vec2| {
        let left = 10.0 + 2.0 * i as f32;
        let front = p.x >= left && p.x < left + 24.0 && p.y >= 16.0 && p.y < 40.0;
        let wall = 0.2 + 0.1 * (((p.x / 4.0) as i32 + (p.y / 4.0) as i32) % 2) as f32;
        (front, Vec3::splat(if front { 0.9 } else { wall }))
    };
    let run = |with_taps: bool, deviations: f32| {
        let mut view = View::wall(small.0, small.1);
        let mut reprojection = Reprojection::new();
        let mut upscaling = TemporalUpscaling::new(isa());
        let mut out = Plane3::default();
        let settings = UpscaleSettings { deviations, ..UpscaleSettings::default() };
        let mut worst = 0.0f32;
        for i in 0..24 {
            let j = jitter(i);
            let colour = fill3(small, |x, y| {
                let at = (Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + j) * 2.0;
                let (front, colour) = truth(i, at);
                view.depth.set(x, y, if front { 5.0 } else { 10.0 });
                view.object.set(x, y, if front { 2 } else { 1 });
                view.motion[0].set(x, y, if front { -1.0 } else { 0.0 });
                colour
            });
            let tests = SurfaceTests::default();
            let taps = reprojection.advance(&view.guides(), &tests).unwrap();
            let taps = with_taps.then_some(taps);
            upscaling.resolve(&colour, &view.guides(), j, taps, &settings, SIZE, &mut out).unwrap();
            if i < 12 {
                continue;
            }
            // Five pixels away from the square's edge, where it was up to six frames ago.
            let left = 10 + 2 * i;
            for x in left - 16..left - 5 {
                let (_, expected) = truth(i, Vec2::new(x as f32 + 0.5, 28.5));
                worst = worst.max(out.get(x, 28).x - expected.x.max(0.3));
            }
        }
        worst
    };
    let (default, no_taps, free) = (
        run(true, UpscaleSettings::default().deviations),
        run(false, UpscaleSettings::default().deviations),
        run(false, 1e6),
    );
    assert!(default < 0.05 && no_taps < 0.05 && free > 0.4, "{default} {no_taps} {free}");
}

#[test]
fn constants_stay() {
    let colour = Vec3::new(0.3, 0.7, 0.1);
    for ((w, h), size) in
        [((1, 1), (1, 1)), ((1, 1), (2, 2)), ((17, 9), (33, 18)), ((30, 20), (40, 20))]
    {
        let view = View::wall(w, h);
        let mut upscaling = TemporalUpscaling::new(isa());
        let mut out = Plane3::default();
        for i in 0..10 {
            let settings = UpscaleSettings::default();
            let small = fill3((w, h), |_, _| colour);
            let result = upscaling.resolve(
                &small,
                &view.guides(),
                jitter(i),
                None,
                &settings,
                size,
                &mut out,
            );
            result.unwrap();
            for y in 0..size.1 {
                for x in 0..size.0 {
                    assert!((out.get(x, y) - colour).abs().max_element() < 1e-5);
                }
            }
        }
    }
}

#[test]
fn bad_numbers_and_sizes() {
    let settings = UpscaleSettings::default();
    for (w, h) in SIZES {
        let view = View::wall(w, h).spoilt();
        let colour = spoil3(fill3((w, h), |x, y| Vec3::new(x as f32, y as f32, 1.0)));
        let mut upscaling = TemporalUpscaling::new(isa());
        let mut out = Plane3::default();
        for i in 0..5 {
            let (guides, size) = (view.guides(), (2 * w, 2 * h - h / 3));
            upscaling
                .resolve(&colour, &guides, jitter(i), None, &settings, size, &mut out)
                .unwrap();
            assert_sane(&pixels3(&out));
        }
    }
    let view = View::wall(8, 8);
    let right = Plane3::new(8, 8).unwrap();
    let mut upscaling = TemporalUpscaling::new(isa());
    let mut run = |colour: &Plane3, jitter, size, settings: &UpscaleSettings| {
        let mut out = Plane3::default();
        upscaling.resolve(colour, &view.guides(), jitter, None, settings, size, &mut out)
    };
    let small = Plane3::new(7, 8).unwrap();
    let result = run(&small, Vec2::ZERO, (16, 16), &settings);
    assert!(matches!(result, Err(DenoiseError::Mismatch { .. })));
    let setting = |result| matches!(result, Err(DenoiseError::Setting { .. }));
    assert!(setting(run(&right, Vec2::ZERO, (18, 16), &settings)));
    assert!(setting(run(&right, Vec2::ZERO, (7, 8), &settings)));
    assert!(setting(run(&right, Vec2::splat(f32::NAN), (16, 16), &settings)));
    let wrong = UpscaleSettings { radius: 3.0, ..settings };
    assert!(setting(run(&right, Vec2::ZERO, (16, 16), &wrong)));
    assert!(run(&right, Vec2::ZERO, (0, 0), &settings).is_err());
    assert!(run(&right, Vec2::ZERO, (16, 16), &settings).is_ok());
}

#[test]
fn threads_and_instruction_sets_do_not_matter() {
    let small = (67, 50);
    assert_same_everywhere(|isa| pixels3(&still(isa, small, 4, &UpscaleSettings::default())));
    // A view from elsewhere, with motion.
    let eye = Eye::look(Vec3::new(0.5, 1.2, 5.0), Vec3::ZERO, 0.4, small);
    let mut view = View::new(eye, &[(Vec3::ZERO, Vec3::Y, &|_| true)]);
    view.motion[0].fill(0.31);
    view.motion[1].fill(-0.77);
    assert_same_everywhere(|isa| {
        let mut upscaling = TemporalUpscaling::new(isa);
        let mut out = Plane3::default();
        for i in 0..4 {
            let (j, settings) = (jitter(i), UpscaleSettings::default());
            let colour = frame(small, j);
            upscaling.resolve(&colour, &view.guides(), j, None, &settings, SIZE, &mut out).unwrap();
        }
        pixels3(&out)
    });
}

#[test]
fn means_are_kept_and_what_was_not_seen_is_forgotten() {
    let small = (64, 48);
    let view = View::wall(small.0, small.1);
    let settings = UpscaleSettings { deviations: 1e6, ..UpscaleSettings::default() };
    let mut rng = Rng::new(8);
    let mut upscaling = TemporalUpscaling::new(isa());
    let (mut out, mut sum) = (Plane3::default(), 0.0);
    for i in 0..32 {
        let colour = fill3(small, |_, _| rng.vec3());
        let (j, guides) = (jitter(i), view.guides());
        upscaling.resolve(&colour, &guides, j, None, &settings, SIZE, &mut out).unwrap();
        sum += mean(&pixels3(&colour)) / 32.0;
    }
    let found = mean(&pixels3(&out));
    assert!((found / sum - 1.0).abs() < 0.01, "{sum} {found}");
    // No surface is found in the frame before: nothing of it stays.
    let taps = Plane::new(small.0, small.1).unwrap();
    let bright = fill3(small, |_, _| Vec3::splat(3.0));
    let guides = view.guides();
    upscaling
        .resolve(&bright, &guides, Vec2::ZERO, Some(&taps), &settings, SIZE, &mut out)
        .unwrap();
    assert_near(&pixels3(&out), 3.0, 1e-5);
}
