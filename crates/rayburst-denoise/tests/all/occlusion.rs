//! Ambient occlusion: a wedge of a floor and a wall, which is known in closed form.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use rayburst_denoise::{DenoiseError, OcclusionFilter, OcclusionSettings};
use rayburst_image::Plane;
use rayburst_math::hash::Rng;
use rayburst_simd::IsaLevel;

use crate::views::{
    Eye, SIZES, View, assert_near, assert_same_everywhere, assert_sane, fill, isa, mean, pixels,
    rmse, spoil,
};

const REACH: f32 = 1.0;

/// The open share at a distance from the other plane of a wedge, of rays as long as [`REACH`]: by the
/// cosine they cover a disc evenly, and the other plane blocks a cap of it.
fn truth(x: f32) -> f32 {
    let c = (x / REACH).clamp(0.0, 1.0);
    1.0 - (c.acos() - c * (1.0 - c * c).sqrt()) / PI
}

/// One ray: whether it is open, and how far it went.
fn sample(x: f32, rng: &mut Rng) -> (f32, f32) {
    let towards = rng.f32().sqrt() * (TAU * rng.f32()).cos();
    let distance = x / towards;
    if towards > 0.0 && distance < REACH { (0.0, distance) } else { (1.0, f32::INFINITY) }
}

/// A floor and a wall at the left, and how far each pixel is from the other one.
fn wedge(size: (u32, u32)) -> (View, Plane) {
    let eye = Eye::look(Vec3::new(3.0, 2.0, 1.0), Vec3::new(0.6, 0.4, 0.0), 0.5, size);
    let floor: &dyn Fn(Vec3) -> bool = &|p| p.x >= 0.0;
    let wall: &dyn Fn(Vec3) -> bool = &|p| p.y >= 0.0;
    let view = View::new(eye, &[(Vec3::ZERO, Vec3::Y, floor), (Vec3::ZERO, Vec3::X, wall)]);
    let away = fill(size, |x, y| {
        let p = view.position.get(x, y);
        if view.object.get(x, y) == 1 { p.x } else { p.y }
    });
    (view, away)
}

fn noisy(away: &Plane, seed: u64) -> [Plane; 2] {
    let mut rng = Rng::new(seed);
    let mut distance = away.clone();
    let open = fill(away.size(), |x, y| {
        let (open, far) = sample(away.get(x, y), &mut rng);
        distance.set(x, y, far);
        open
    });
    [open, distance]
}

fn filtered(isa: IsaLevel, view: &View, planes: &[Plane; 2]) -> Plane {
    spaced(isa, view, planes, 1)
}

fn spaced(isa: IsaLevel, view: &View, [open, distance]: &[Plane; 2], spacing: u32) -> Plane {
    let mut out = Plane::default();
    let settings = OcclusionSettings { reach: REACH, spacing, ..OcclusionSettings::default() };
    OcclusionFilter::new(isa)
        .filter(&view.surfaces(isa), open, distance, &settings, &mut out)
        .unwrap();
    out
}

#[test]
fn noise_of_a_wedge_falls() {
    let (view, away) = wedge((240, 160));
    let exact = fill(away.size(), |x, y| truth(away.get(x, y)));
    let input = noisy(&away, 1);
    let out = filtered(isa(), &view, &input);
    let before = rmse(&pixels(&input[0]), &pixels(&exact));
    let after = rmse(&pixels(&out), &pixels(&exact));
    let (m, n) = (mean(&pixels(&exact)), mean(&pixels(&out)));
    assert!(4.0 * after < before, "{before} to {after}");
    assert!((n / m - 1.0).abs() < 0.01, "{m} {n}");
    // One ray for every 2×2 pixels.
    let shared = input.clone().map(|plane| fill(plane.size(), |x, y| plane.get(x & !1, y & !1)));
    let before = rmse(&pixels(&shared[0]), &pixels(&exact));
    let after = rmse(&pixels(&spaced(isa(), &view, &shared, 2)), &pixels(&exact));
    assert!(2.5 * after < before, "{before} to {after}");
    // A kernel of the same width everywhere is worse at the edge, where occluders are near.
    let near = |plane: &Plane| -> Vec<f32> {
        let size = plane.size();
        let all = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
        all.filter(|&(x, y)| away.get(x, y) < 0.15).map(|(x, y)| plane.get(x, y)).collect()
    };
    let wide = OcclusionSettings {
        reach: REACH,
        least_radius: 16.0,
        spacing: 1,
        ..OcclusionSettings::default()
    };
    let mut blurred = Plane::default();
    OcclusionFilter::new(isa())
        .filter(&view.surfaces(isa()), &input[0], &input[1], &wide, &mut blurred)
        .unwrap();
    let bias = |plane: &Plane| mean(&near(plane)) - mean(&near(&exact));
    assert!(2.0 * bias(&out).abs() < bias(&blurred).abs(), "{} {}", bias(&out), bias(&blurred));
}

#[test]
fn near_occluders_are_kept_sharp_and_far_ones_are_not() {
    // A step of occlusion; only what occludes it is nearer or farther.
    let view = View::floor(96, 64, 40.0);
    let step = fill((96, 64), |x, _| if x < 48 { 0.2 } else { 0.9 });
    let blur = |distance: f32| {
        let out = filtered(isa(), &view, &[step.clone(), fill((96, 64), |_, _| distance)]);
        (0..96).filter(|&x| (0.25..0.85).contains(&out.get(x, 32))).count()
    };
    let widths = [0.01, 0.2, 0.5].map(blur);
    assert!(widths[0] <= 4 && widths[0] < widths[1] && widths[1] < widths[2], "{widths:?}");
}

#[test]
fn constants_stay() {
    for size in SIZES {
        let view = View::wall(size.0, size.1);
        for (value, distance) in [(1.0, f32::INFINITY), (0.37, 0.5), (0.0, 0.0)] {
            let planes = [fill(size, |_, _| value), fill(size, |_, _| distance)];
            assert_near(&pixels(&filtered(isa(), &view, &planes)), value, 1e-5);
        }
    }
}

#[test]
fn bad_numbers_and_sizes() {
    let settings = OcclusionSettings::default();
    for size in SIZES {
        let view = View::wall(size.0, size.1).spoilt();
        let mut rng = Rng::new(4);
        let open = spoil(fill(size, |_, _| rng.f32().round()));
        let distance = spoil(fill(size, |_, _| rng.f32()));
        assert_sane(&pixels(&filtered(isa(), &view, &[open, distance])));
    }
    let view = View::wall(8, 8);
    let (small, right) = (Plane::new(8, 7).unwrap(), Plane::new(8, 8).unwrap());
    let mut filter = OcclusionFilter::new(isa());
    let surfaces = view.surfaces(isa());
    let mut run = |open, distance, settings: &OcclusionSettings| {
        filter.filter(&surfaces, open, distance, settings, &mut Plane::default())
    };
    assert!(matches!(run(&small, &right, &settings), Err(DenoiseError::Mismatch { .. })));
    assert!(matches!(run(&right, &small, &settings), Err(DenoiseError::Mismatch { .. })));
    let wrong = OcclusionSettings { reach: -1.0, ..settings };
    assert!(matches!(run(&right, &right, &wrong), Err(DenoiseError::Setting { .. })));
    assert!(run(&right, &right, &settings).is_ok());
}

#[test]
fn threads_and_instruction_sets_do_not_matter() {
    let (view, away) = wedge((67, 41));
    let input = noisy(&away, 2);
    assert_same_everywhere(|isa| pixels(&filtered(isa, &view, &input)));
}
