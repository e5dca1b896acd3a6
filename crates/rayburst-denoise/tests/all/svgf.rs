//! The whole filter.

use glam::Vec3;
use rayburst_denoise::{Accumulation, SurfaceTests, Svgf, SvgfSettings};
use rayburst_image::Plane3;
use rayburst_simd::IsaLevel;

use crate::frames::{Frame, colours, random, rmse};

/// What a wall of smooth light with a shadow's edge looks like without noise.
pub(crate) fn light(x: u32, y: u32) -> Vec3 {
    let shadow = if x + y / 2 > 40 { 0.3 } else { 1.0 };
    Vec3::new(2.0, 1.5, 1.0) * shadow * (1.0 + 0.3 * (0.1 * y as f32).sin())
}

/// One sample a pixel: mostly nothing, sometimes four times too much.
pub(crate) fn noise(truth: &Plane3, seed: u32) -> Plane3 {
    let mut random = random(seed);
    let (w, h) = truth.size();
    colours(w, h, |x, y| truth.get(x, y) * if random.f32() < 0.25 { 4.0 } else { 0.0 })
}

#[test]
fn noise_falls_by_more_than_twelve_times_on_a_camera_at_rest() {
    let (w, h) = (80, 60);
    let frame = Frame::wall(w, h);
    let truth = colours(w, h, light);
    let mut svgf = Svgf::<1>::new(IsaLevel::detect());
    let mut out = [truth.clone()];
    let settings = SvgfSettings::default();
    let mut errors = Vec::new();
    for n in 0..24 {
        let noisy = noise(&truth, 100 + n);
        svgf.filter(&frame.guides(), [&noisy], &settings, &mut out).unwrap();
        errors.push(rmse(&out[0], &truth) / rmse(&noisy, &truth));
    }
    // Already one frame is much better than its samples, and later ones more so.
    assert!(errors[0] < 1.0 / 5.0, "{errors:?}");
    assert!(errors[23] < 1.0 / 12.0, "{errors:?}");
    assert!(svgf.history(0).length_row(5)[7] == 24.0);
    // Filtered variance is what is left, and that is little.
    let (first, last) = (svgf.variance_row(0, 30), svgf.filtered_variance_row(0, 30));
    assert!(last.iter().sum::<f32>() < 0.1 * first.iter().sum::<f32>());
}

#[test]
fn every_stage_helps() {
    let (w, h) = (80, 60);
    let frame = Frame::wall(w, h);
    let truth = colours(w, h, light);
    let error = |settings: &SvgfSettings| {
        let mut svgf = Svgf::<1>::new(IsaLevel::detect());
        let mut out = [truth.clone()];
        for n in 0..12 {
            let noisy = noise(&truth, 300 + n);
            svgf.filter(&frame.guides(), [&noisy], settings, &mut out).unwrap();
        }
        (rmse(&out[0], &truth), svgf)
    };
    let all = SvgfSettings::default();
    let (best, _) = error(&all);
    let (still, svgf) = error(&SvgfSettings { temporal: false, ..all });
    assert!(still > 1.3 * best, "{still} {best}");
    assert!(svgf.history(0).length_row(3).iter().all(|&length| length == 1.0));
    let (unblurred, _) = error(&SvgfSettings { levels: 0, ..all });
    assert!(unblurred > 2.0 * best, "{unblurred} {best}");
    let (unguided, _) = error(&SvgfSettings { variance: false, ..all });
    assert!(unguided > 1.2 * best, "{unguided} {best}");
    let (unfed, _) = error(&SvgfSettings { feedback: false, ..all });
    assert!((unfed - best).abs() > 1e-4, "{unfed} {best}");
}

#[test]
fn without_levels_it_is_the_running_mean() {
    let (w, h) = (20, 12);
    let frame = Frame::wall(w, h);
    let truth = colours(w, h, light);
    let accumulation = Accumulation { alpha: 0.0, measure_alpha: 0.0, longest: 1000.0 };
    let settings = SvgfSettings { levels: 0, accumulation, ..SvgfSettings::default() };
    let mut svgf = Svgf::<1>::new(IsaLevel::detect());
    let (mut out, mut sum) = ([truth.clone()], Plane3::new(w, h).unwrap());
    for n in 1..=50 {
        let noisy = noise(&truth, n);
        svgf.filter(&frame.guides(), [&noisy], &settings, &mut out).unwrap();
        for y in 0..h {
            for x in 0..w {
                sum.set(x, y, sum.get(x, y) + noisy.get(x, y));
                let mean = sum.get(x, y) / n as f32;
                assert!((out[0].get(x, y) - mean).abs().max_element() < 1e-5 * (1.0 + mean.x));
            }
        }
    }
}

#[test]
fn young_histories_get_their_variance_from_around() {
    let (w, h) = (48, 40);
    let mut frame = Frame::wall(w, h);
    // Another object, as noisy but much darker: it must not count.
    for y in 0..h {
        for x in 24..w {
            frame.object.set(x, y, 2);
        }
    }
    let truth = colours(w, h, |x, _| Vec3::splat(if x < 24 { 100.0 } else { 1.0 }));
    let mut svgf = Svgf::<1>::new(IsaLevel::detect());
    let mut out = [truth.clone()];
    let noisy = noise(&truth, 9);
    let settings = SvgfSettings::default();
    svgf.filter(&frame.guides(), [&noisy], &settings, &mut out).unwrap();
    // The variance of four times the mean at a quarter of the time is three times its square.
    let mut means = [0.0, 0.0];
    for y in 0..h {
        for x in 0..w as usize {
            means[x / 24] += svgf.variance_row(0, y)[x] / (24 * h) as f32;
        }
    }
    assert!((means[0] / 3e4 - 1.0).abs() < 0.15, "{means:?}");
    assert!((means[1] / 3.0 - 1.0).abs() < 0.15, "{means:?}");
    // With the stage left out there is none in the first frame.
    svgf.reset();
    let without = SvgfSettings { shortest: 0.0, ..settings };
    svgf.filter(&frame.guides(), [&noisy], &without, &mut out).unwrap();
    assert!((0..h).all(|y| svgf.variance_row(0, y).iter().all(|&v| v == 0.0)));
}

#[test]
fn what_was_hidden_starts_afresh() {
    let (w, h) = (48, 24);
    let at = |left: u32| {
        let mut frame = Frame::wall(w, h);
        for y in 0..h {
            for x in left..left + 10 {
                frame.depth.set(x, y, 5.0);
                frame.object.set(x, y, 2);
            }
        }
        frame
    };
    let picture = |left: u32| {
        let inside = left..left + 10;
        colours(w, h, |x, _| Vec3::splat(if inside.contains(&x) { 9.0 } else { 1.0 }))
    };
    let mut svgf = Svgf::<1>::new(IsaLevel::detect());
    let mut out = [picture(0)];
    let tests = SurfaceTests { search: false, ..SurfaceTests::default() };
    let settings = SvgfSettings { tests, ..SvgfSettings::default() };
    for step in 0..8 {
        let left = 10 + 2 * step;
        let mut frame = at(left);
        for y in 0..h {
            for x in left..left + 10 {
                frame.motion[0].set(x, y, -2.0);
            }
        }
        svgf.filter(&frame.guides(), [&picture(left)], &settings, &mut out).unwrap();
        let lengths = svgf.history(0).length_row(11);
        if step > 0 {
            assert!((left - 2..left).all(|x| lengths[x as usize] == 1.0));
            assert_eq!(lengths[left as usize + 4], step as f32 + 1.0);
            assert_eq!(lengths[2], step as f32 + 1.0);
        }
        // Nothing of one object ever shows on the other.
        let truth = picture(left);
        assert!(rmse(&out[0], &truth) < 1e-5);
    }
}

#[test]
fn what_is_handed_out_is_no_history() {
    let (w, h) = (24, 16);
    let frame = Frame::wall(w, h);
    let truth = colours(w, h, light);
    let settings = SvgfSettings::default();
    let mut results = Vec::new();
    for spoil in [false, true] {
        let mut svgf = Svgf::<1>::new(IsaLevel::detect());
        let mut out = [truth.clone()];
        for n in 0..4 {
            svgf.filter(&frame.guides(), [&noise(&truth, n)], &settings, &mut out).unwrap();
            if spoil && n < 3 {
                out[0].fill(Vec3::splat(f32::NAN));
            }
        }
        results.push(out);
    }
    assert_eq!(rmse(&results[0][0], &results[1][0]), 0.0);
}

#[test]
fn weights_can_be_looked_at() {
    let (w, h) = (40, 30);
    let mut frame = Frame::wall(w, h);
    for y in 0..h {
        for x in 0..w {
            frame.depth.set(x, y, 5.0 + 0.1 * x as f32);
            frame.object.set(x, y, if x < 20 { 1 } else { 2 });
        }
    }
    let truth = colours(w, h, light);
    let noisy = noise(&truth, 77);
    let mut svgf = Svgf::<1>::new(IsaLevel::detect());
    let mut out = [truth.clone()];
    for variance in [true, false] {
        let settings = SvgfSettings { levels: 1, temporal: false, variance, ..Default::default() };
        svgf.filter(&frame.guides(), [&noisy], &settings, &mut out).unwrap();
        for (x, y) in [(0, 0), (39, 29), (19, 7), (20, 15), (10, 29)] {
            let weights = svgf.last_weights(0, x, y);
            let (mut sum, mut colour) = (0.0, Vec3::ZERO);
            for (row, qy) in weights.iter().zip(i64::from(y) - 2..) {
                for (weight, qx) in row.iter().zip(i64::from(x) - 2..) {
                    let inside = (0..i64::from(w)).contains(&qx) && (0..i64::from(h)).contains(&qy);
                    let same = inside && (qx < 20) == (x < 20);
                    assert!(if same { *weight >= 0.0 } else { *weight == 0.0 });
                    if same {
                        colour += *weight * noisy.get(qx as u32, qy as u32);
                    }
                    sum += weight;
                }
            }
            assert!((sum - 1.0).abs() < 1e-5);
            let error = (colour - out[0].get(x, y)).abs().max_element();
            assert!(error < 1e-3 * (1.0 + colour.x), "{x} {y}: {error}");
        }
    }
    assert_eq!(svgf.last_weights(0, w, 0), [[0.0; 5]; 5]);
}

#[test]
fn a_camera_that_pans_keeps_its_history() {
    // A smooth wall passes by with two thirds of a pixel per frame.
    let (w, h) = (72, 48);
    let mut frame = Frame::wall(w, h);
    frame.motion[0].fill(-2.0 / 3.0);
    let wall = |u: f32, v: f32| {
        Vec3::new(2.0, 1.0, 0.5) * (1.0 + 0.5 * (0.2 * u).sin() * (0.15 * v).cos())
    };
    let errors = [true, false].map(|temporal| {
        let mut svgf = Svgf::<1>::new(IsaLevel::detect());
        let settings = SvgfSettings { temporal, ..SvgfSettings::default() };
        let mut out = [Plane3::new(w, h).unwrap()];
        let mut error = 0.0;
        for n in 0..20 {
            let u = |x: u32| x as f32 - 2.0 * n as f32 / 3.0;
            let truth = colours(w, h, |x, y| wall(u(x), y as f32));
            let noisy = noise(&truth, 900 + n);
            svgf.filter(&frame.guides(), [&noisy], &settings, &mut out).unwrap();
            error = rmse(&out[0], &truth) / rmse(&noisy, &truth);
        }
        // The left edge has just come into the picture, the right one has long been there.
        if temporal {
            let lengths = svgf.history(0).length_row(20);
            assert!(lengths[0] < 4.0 && lengths[70] > 19.0, "{lengths:?}");
        }
        error
    });
    assert!(errors[0] < 0.13 && errors[0] < 0.7 * errors[1], "{errors:?}");
}
