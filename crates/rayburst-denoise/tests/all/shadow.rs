//! Soft shadows: penumbrae of a half-plane over a floor, which are known in closed form.

use glam::Vec3;
use rayburst_denoise::{
    DenoiseError, LightSize, Reprojection, ShadowFilter, ShadowHistory, ShadowHistorySettings,
    ShadowSettings, SurfaceTests,
};
use rayburst_image::Plane;
use rayburst_math::hash::Rng;
use rayburst_simd::IsaLevel;

use crate::views::{
    Eye, SIZES, View, assert_near, assert_same_everywhere, assert_sane, fill, isa, mean, pixels,
    rmse, spoil,
};

/// Diameter of the light over its distance.
const LIGHT: f32 = 0.2;

/// The share of a round light straight above that is seen at `x`, when all of x < 0 is covered at a height.
fn truth(x: f32, height: f32) -> f32 {
    let c = (x / (0.5 * LIGHT * height)).clamp(-1.0, 1.0);
    1.0 - (c.acos() - c * (1.0 - c * c).sqrt()) / std::f32::consts::PI
}

/// One ray's visibility and the distance to what blocked it.
fn sample(x: f32, height: f32, rng: &mut Rng) -> (f32, f32) {
    let (radius, angle) = (0.5 * LIGHT * rng.f32().sqrt(), std::f32::consts::TAU * rng.f32());
    let blocked = x + height * radius * angle.cos() < 0.0;
    let distance = height * (1.0 + radius * radius).sqrt();
    if blocked { (0.0, distance) } else { (1.0, f32::INFINITY) }
}

fn noisy(view: &View, height: f32, seed: u64) -> [Plane; 2] {
    let mut rng = Rng::new(seed);
    let mut distance = view.depth.clone();
    let seen = fill(view.eye.size, |x, y| {
        let (seen, far) = sample(view.position.get(x, y).x, height, &mut rng);
        distance.set(x, y, far);
        seen
    });
    [seen, distance]
}

fn filtered(isa: IsaLevel, view: &View, [seen, distance]: &[Plane; 2]) -> Plane {
    let mut out = Plane::default();
    let (light, settings) = (LightSize::Everywhere(LIGHT), ShadowSettings::default());
    ShadowFilter::new(isa)
        .filter(&view.surfaces(isa), seen, distance, light, &settings, &mut out)
        .unwrap();
    out
}

/// Where the means of columns pass a level, in pixels.
fn crossing(profile: &[f32], level: f32) -> f32 {
    let i = profile.windows(2).position(|w| w[0] < level && w[1] >= level).unwrap();
    i as f32 + (level - profile[i]) / (profile[i + 1] - profile[i])
}

#[test]
fn penumbrae_are_as_wide_as_they_should_be() {
    let scale = 40.0;
    let view = View::floor(160, 256, scale);
    let mut widths = Vec::new();
    for height in [0.25, 0.5, 1.0, 2.0, 4.0] {
        let input = noisy(&view, height, 7);
        let out = filtered(isa(), &view, &input);
        let width = |plane: &Plane| {
            let profile: Vec<f32> = (0..160)
                .map(|x| mean(&(0..256).map(|y| plane.get(x, y)).collect::<Vec<_>>()) as f32)
                .collect();
            crossing(&profile, 0.85) - crossing(&profile, 0.15)
        };
        let exact = fill(view.eye.size, |x, y| truth(view.position.get(x, y).x, height));
        let (found, expected) = (width(&out), width(&exact));
        let error = rmse(&pixels(&out), &pixels(&exact));
        let before = rmse(&pixels(&input[0]), &pixels(&exact));
        assert!((found / expected - 1.0).abs() < 0.2, "{height}: {found}, truth {expected}");
        // Penumbrae of a pixel have nothing to gain.
        let factor = if expected > 4.0 { 3.0 } else { 1.0 };
        assert!(error * factor <= before, "{height}: {before} to {error}");
        widths.push(found);
    }
    assert!(widths.windows(2).all(|w| w[1] > 1.5 * w[0]), "{widths:?}");
}

#[test]
fn foreshortened_floors_are_smoothed_as_far_as_others() {
    let eye = Eye::look(Vec3::new(0.5, 1.2, 5.0), Vec3::ZERO, 0.4, (200, 150));
    let view = View::new(eye, &[(Vec3::ZERO, Vec3::Y, &|_| true)]);
    for (height, factor) in [(0.5, 1.7), (2.0, 3.0)] {
        let input = noisy(&view, height, 3);
        let exact = fill(eye.size, |x, y| match view.depth.get(x, y) < f32::INFINITY {
            true => truth(view.position.get(x, y).x, height),
            false => input[0].get(x, y),
        });
        let before = rmse(&pixels(&input[0]), &pixels(&exact));
        let error = rmse(&pixels(&filtered(isa(), &view, &input)), &pixels(&exact));
        assert!(factor * error < before, "{height}: {before} to {error}");
    }
}

#[test]
fn lit_and_dark_regions_are_untouched() {
    let view = View::floor(160, 64, 40.0);
    let height = 1.0;
    let out = filtered(isa(), &view, &noisy(&view, height, 9));
    // The kernel's radius is 0.45 penumbrae; the penumbra reaches half of one to either side.
    let reach = (0.5 + 0.5) * LIGHT * height;
    for y in 0..64 {
        for x in 0..160 {
            let at = view.position.get(x, y).x;
            if at.abs() > reach {
                assert_near(&[out.get(x, y)], if at < 0.0 { 0.0 } else { 1.0 }, 1e-5);
            }
        }
    }
    for seen in [0.0, 1.0] {
        let planes = [fill((160, 64), |_, _| seen), fill((160, 64), |_, _| 1.0)];
        assert_near(&pixels(&filtered(isa(), &view, &planes)), seen, 0.0);
    }
    let planes = [fill((160, 64), |_, _| 0.3), fill((160, 64), |_, _| 1.0)];
    assert_near(&pixels(&filtered(isa(), &view, &planes)), 0.3, 1e-5);
}

#[test]
fn noise_of_one_share_keeps_its_mean() {
    let view = View::floor(128, 128, 40.0);
    let mut rng = Rng::new(1);
    let seen = fill((128, 128), |_, _| if rng.f32() < 0.4 { 0.0 } else { 1.0 });
    let distance = fill((128, 128), |_, _| 2.0);
    let out = filtered(isa(), &view, &[seen.clone(), distance]);
    let (before, after) = (mean(&pixels(&seen)), mean(&pixels(&out)));
    assert!((after / before - 1.0).abs() < 0.01, "{before} {after}");
}

#[test]
fn shadows_stay_on_their_surface() {
    // A dark wall before a lit one: nothing crosses the edge.
    let eye = Eye::look(Vec3::new(0.0, 0.0, 10.0), Vec3::ZERO, 0.5, (64, 48));
    let near: &dyn Fn(Vec3) -> bool = &|p| p.x < 0.0;
    let view = View::new(
        eye,
        &[(Vec3::new(0.0, 0.0, 3.0), Vec3::Z, near), (Vec3::ZERO, Vec3::Z, &|_| true)],
    );
    let seen = fill((64, 48), |x, y| if view.object.get(x, y) == 1 { 0.0 } else { 1.0 });
    let distance = fill((64, 48), |_, _| 5.0);
    let out = filtered(isa(), &view, &[seen.clone(), distance]);
    assert_eq!(pixels(&out), pixels(&seen));
}

#[test]
fn light_sizes_by_pixel_are_the_same() {
    let view = View::floor(70, 40, 40.0);
    let [seen, distance] = noisy(&view, 1.0, 2);
    let expected = filtered(isa(), &view, &[seen.clone(), distance.clone()]);
    let sizes = fill((70, 40), |_, _| LIGHT);
    let mut out = Plane::default();
    let settings = ShadowSettings::default();
    let mut filter = ShadowFilter::new(isa());
    let surfaces = view.surfaces(isa());
    let light = LightSize::PerPixel(&sizes);
    filter.filter(&surfaces, &seen, &distance, light, &settings, &mut out).unwrap();
    assert_eq!(pixels(&out), pixels(&expected));
}

#[test]
fn bad_numbers_and_sizes() {
    let settings = ShadowSettings::default();
    for size in SIZES {
        let view = View::wall(size.0, size.1).spoilt();
        let mut rng = Rng::new(4);
        let seen = spoil(fill(size, |_, _| rng.f32().round()));
        let distance = spoil(fill(size, |_, _| rng.f32()));
        let sizes = spoil(fill(size, |_, _| rng.f32()));
        for light in [LightSize::Everywhere(0.5), LightSize::PerPixel(&sizes)] {
            let mut out = Plane::default();
            let mut filter = ShadowFilter::new(isa());
            let surfaces = view.surfaces(isa());
            filter.filter(&surfaces, &seen, &distance, light, &settings, &mut out).unwrap();
            assert_sane(&pixels(&out));
        }
    }
    let view = View::wall(8, 8);
    let (small, right) = (Plane::new(8, 7).unwrap(), Plane::new(8, 8).unwrap());
    let mut filter = ShadowFilter::new(isa());
    let surfaces = view.surfaces(isa());
    let mut run = |seen, distance, size, settings: &ShadowSettings| {
        let mut out = Plane::default();
        let light = LightSize::Everywhere(size);
        filter.filter(&surfaces, seen, distance, light, settings, &mut out)
    };
    let mismatch = |result| matches!(result, Err(DenoiseError::Mismatch { .. }));
    assert!(mismatch(run(&small, &right, 0.1, &settings)));
    assert!(mismatch(run(&right, &small, 0.1, &settings)));
    let setting = |result| matches!(result, Err(DenoiseError::Setting { .. }));
    assert!(setting(run(&right, &right, f32::NAN, &settings)));
    let wide = ShadowSettings { most_radius: 33.0, ..settings };
    assert!(setting(run(&right, &right, 0.1, &wide)));
    assert!(run(&right, &right, 0.1, &settings).is_ok());
}

#[test]
fn threads_and_instruction_sets_do_not_matter() {
    let eye = Eye::look(Vec3::new(0.5, 1.2, 5.0), Vec3::ZERO, 0.4, (67, 41));
    let view = View::new(eye, &[(Vec3::ZERO, Vec3::Y, &|_| true)]);
    let input = noisy(&view, 1.0, 3);
    assert_same_everywhere(|isa| pixels(&filtered(isa, &view, &input)));
}

/// Filtered and accumulated shadows of some frames, by the edge of the half-plane in each.
fn accumulated(isa: IsaLevel, edges: &[f32], settings: &ShadowHistorySettings) -> [Plane; 2] {
    let view = View::floor(160, 96, 40.0);
    let mut reprojection = Reprojection::new();
    let mut history = ShadowHistory::new(isa);
    let (mut share, mut out) = (Plane::default(), Plane::default());
    for (i, &edge) in (0..).zip(edges) {
        let mut moved = view.clone();
        for value in moved.position.channels[0].values_mut() {
            *value -= edge;
        }
        share = filtered(isa, &view, &noisy(&moved, 2.0, 50 + i));
        let taps = reprojection.advance(&view.guides(), &SurfaceTests::default()).unwrap();
        history.accumulate(&share, taps, settings, &mut out).unwrap();
    }
    [share, out]
}

#[test]
fn frames_are_averaged_while_shadows_rest() {
    let [share, out] = accumulated(isa(), &[0.0; 24], &ShadowHistorySettings::default());
    let view = View::floor(160, 96, 40.0);
    let exact = pixels(&fill((160, 96), |x, y| truth(view.position.get(x, y).x, 2.0)));
    let (alone, after) = (rmse(&pixels(&share), &exact), rmse(&pixels(&out), &exact));
    assert!(1.3 * after < alone, "{alone} {after}");
}

#[test]
fn moved_shadows_leave_no_ghost() {
    let edges: Vec<f32> = (0..20).map(|i| if i < 16 { 0.0 } else { -1.0 }).collect();
    let view = View::floor(160, 96, 40.0);
    let exact = pixels(&fill((160, 96), |x, y| truth(view.position.get(x, y).x + 1.0, 2.0)));
    let error = |settings: &ShadowHistorySettings| {
        let [_, out] = accumulated(isa(), &edges, settings);
        rmse(&pixels(&out), &exact)
    };
    let default = ShadowHistorySettings::default();
    let found = error(&default);
    let plain = error(&ShadowHistorySettings { slack: 1e3, ..default });
    assert!(found < 0.03 && 5.0 * found < plain, "{found} {plain}");
}

#[test]
fn histories_of_shadows_are_sane() {
    for size in SIZES {
        let view = View::wall(size.0, size.1).spoilt();
        let mut reprojection = Reprojection::new();
        let mut history = ShadowHistory::new(isa());
        let mut out = Plane::default();
        for i in 0..4 {
            let mut rng = Rng::new(i);
            let share = spoil(fill(size, |_, _| rng.f32()));
            let taps = reprojection.advance(&view.guides(), &SurfaceTests::default()).unwrap();
            let settings = ShadowHistorySettings::default();
            history.accumulate(&share, taps, &settings, &mut out).unwrap();
            assert_sane(&pixels(&out));
            assert!(pixels(&out).into_iter().all(|v| v <= 1.0));
        }
        // Another size begins anew.
        let view = View::wall(20, 10);
        let taps =
            Reprojection::new().advance(&view.guides(), &SurfaceTests::default()).unwrap().clone();
        let settings = ShadowHistorySettings::default();
        history.accumulate(&fill((20, 10), |_, _| 0.25), &taps, &settings, &mut out).unwrap();
        assert_near(&pixels(&out), 0.25, 0.0);
        let result = history.accumulate(&fill((20, 9), |_, _| 0.25), &taps, &settings, &mut out);
        assert!(matches!(result, Err(DenoiseError::Mismatch { .. })));
    }
    let edges = [0.0, 0.1, 0.3];
    assert_same_everywhere(|isa| {
        pixels(&accumulated(isa, &edges, &ShadowHistorySettings::default())[1])
    });
}
