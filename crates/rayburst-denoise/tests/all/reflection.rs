//! Reflections of a striped wall in a floor: against the integral over the lobe, and under a moving eye.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use rayburst_denoise::{
    DenoiseError, ReflectionFilter, ReflectionFilterSettings, ReflectionFrame, ReflectionHistory,
    ReflectionHistorySettings, ReflectionRays, ReflectionResolve, ReflectionSettings,
    ReflectionSurface, Reprojection, Resolved, SurfaceTests,
};
use rayburst_image::{Plane, Plane3};
use rayburst_math::hash::Rng;
use rayburst_simd::IsaLevel;

use crate::views::{
    Eye, SIZES, View, assert_near, assert_same_everywhere, assert_sane, fill, fill3, isa, mean,
    pixels, pixels3, rmse, spoil, spoil3,
};

/// What a ray meets: a striped wall at z = −4, or the sky.
fn world(origin: Vec3, direction: Vec3) -> (Vec3, f32) {
    let t = (-4.0 - origin.z) / direction.z;
    let p = origin + t * direction;
    if direction.z < 0.0 && t > 0.0 && p.y < 3.0 {
        let stripe = (p.x * 2.0).rem_euclid(2.0) < 1.0;
        (if stripe { Vec3::new(1.0, 0.8, 0.6) } else { Vec3::new(0.1, 0.2, 0.3) }, t)
    } else {
        (Vec3::splat(0.3), f32::INFINITY)
    }
}

/// GGX, its half vectors by their own density: the direction, its density over solid angle, and what the
/// lobe is there times the cosine. `None` below the surface. The normal is Y.
fn sample(view: Vec3, alpha: f32, rng: &mut Rng) -> Option<(Vec3, f32, f32)> {
    let u = rng.vec2();
    let cos2 = (1.0 - u.x) / (1.0 + (alpha * alpha - 1.0) * u.x);
    let (cos, sin) = (cos2.sqrt(), (1.0 - cos2).max(0.0).sqrt());
    let half = Vec3::new(sin * (TAU * u.y).cos(), cos, sin * (TAU * u.y).sin());
    let light = 2.0 * half.dot(view) * half - view;
    if light.y <= 0.0 || half.dot(view) <= 0.0 {
        return None;
    }
    let core = cos2 * (alpha * alpha - 1.0) + 1.0;
    let d = alpha * alpha / (PI * core * core);
    let pdf = d * cos / (4.0 * half.dot(view));
    let lambda = |c: f32| (alpha * alpha + (1.0 - alpha * alpha) * c * c).sqrt();
    let visible = 0.5 / (light.y * lambda(view.y) + view.y * lambda(light.y));
    Some((light, pdf, d * visible * light.y))
}

fn floor(size: (u32, u32), eye: Vec3) -> View {
    let eye = Eye::look(eye, eye + Vec3::new(0.0, -1.0, -2.0), 0.35, size);
    View::new(eye, &[(Vec3::ZERO, Vec3::Y, &|_| true)])
}

/// One ray for every 2×2 pixels.
struct Rays {
    origin: Plane3,
    direction: Plane3,
    distance: Plane,
    pdf: Plane,
    radiance: Plane3,
}

impl Rays {
    fn new(view: &View, roughness: f32, seed: u64) -> Self {
        let (w, h) = view.eye.size;
        let half = (w.div_ceil(2), h.div_ceil(2));
        let vector = || Plane3::new(half.0, half.1).unwrap();
        let plane = || Plane::new(half.0, half.1).unwrap();
        let (origin, direction, radiance) = (vector(), vector(), vector());
        let mut rays = Self { origin, direction, distance: plane(), pdf: plane(), radiance };
        let mut rng = Rng::new(seed);
        for y in 0..half.1 {
            for x in 0..half.0 {
                let (px, py) =
                    ((2 * x + rng.below(2)).min(w - 1), (2 * y + rng.below(2)).min(h - 1));
                let at = view.position.get(px, py);
                let towards = (view.eye.position - at).normalize_or_zero();
                let Some((light, pdf, _)) = sample(towards, roughness * roughness, &mut rng) else {
                    continue;
                };
                let (radiance, distance) = world(at, light);
                rays.origin.set(x, y, at);
                rays.direction.set(x, y, light);
                rays.distance.set(x, y, distance);
                rays.pdf.set(x, y, pdf);
                rays.radiance.set(x, y, radiance);
            }
        }
        rays
    }

    fn rays(&self) -> ReflectionRays<'_> {
        let Self { origin, direction, distance, pdf, radiance } = self;
        ReflectionRays { origin, direction, distance, pdf, radiance }
    }

    /// What every pixel has whose block's ray is taken as it is.
    fn nearest(&self, size: (u32, u32)) -> Plane3 {
        fill3(size, |x, y| self.radiance.get(x / 2, y / 2))
    }
}

/// The ratio of integrals over the lobe.
fn truth(view: &View, roughness: f32, samples: u32) -> Plane3 {
    let mut rng = Rng::new(77);
    fill3(view.eye.size, |x, y| {
        let at = view.position.get(x, y);
        let towards = (view.eye.position - at).normalize();
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for _ in 0..samples {
            if let Some((light, pdf, lobe)) = sample(towards, roughness * roughness, &mut rng) {
                sum += lobe / pdf * world(at, light).0;
                weights += lobe / pdf;
            }
        }
        sum / weights
    })
}

fn resolved(isa: IsaLevel, view: &View, rays: &Rays, roughness: &Plane) -> Resolved {
    let surface = ReflectionSurface {
        position: &view.position,
        normal: &view.normal,
        roughness,
        footprint: &view.footprint,
        eye: view.eye.position,
    };
    let mut out = Resolved::default();
    ReflectionResolve::new(isa)
        .resolve(&rays.rays(), &surface, &ReflectionSettings::default(), &mut out)
        .unwrap();
    out
}

fn smoothed(isa: IsaLevel, view: &View, from: &Resolved, roughness: &Plane) -> Plane3 {
    let mut out = Plane3::default();
    ReflectionFilter::new(isa)
        .filter(
            &view.surfaces(isa),
            &from.radiance,
            &from.distance,
            roughness,
            Some(&from.variance),
            &view.eye.world_to_pixel(),
            &ReflectionFilterSettings::default(),
            &mut out,
        )
        .unwrap();
    out
}

const SIZE: (u32, u32) = (96, 64);
const EYE: Vec3 = Vec3::new(0.2, 1.0, 3.0);

#[test]
fn rough_reflections_come_nearer_to_the_integral() {
    let view = floor(SIZE, EYE);
    for (value, resolve_factor, filter_factor) in
        [(0.15, 1.4, 1.0), (0.35, 2.0, 1.15), (0.6, 2.4, 1.15)]
    {
        let roughness = fill(SIZE, |_, _| value);
        let rays = Rays::new(&view, value, 5);
        let exact = pixels3(&truth(&view, value, 256));
        let full = resolved(isa(), &view, &rays, &roughness);
        let alone = rmse(&pixels3(&rays.nearest(SIZE)), &exact);
        let after = rmse(&pixels3(&full.radiance), &exact);
        let smooth = pixels3(&smoothed(isa(), &view, &full, &roughness));
        let last = rmse(&smooth, &exact);
        assert!(
            resolve_factor * after < alone && filter_factor * last < after,
            "{value}: {alone} {after} {last}"
        );
        let (m, n) = (mean(&pixels3(&full.radiance)), mean(&smooth));
        assert!((n / m - 1.0).abs() < 0.01, "{m} {n}");
    }
}

#[test]
fn a_constant_world_has_no_noise() {
    let view = floor((50, 35), EYE);
    let mut rng = Rng::new(1);
    let roughness = fill((50, 35), |_, _| rng.f32());
    let mut rays = Rays::new(&view, 0.4, 3);
    rays.radiance.fill(Vec3::splat(0.7));
    let full = resolved(isa(), &view, &rays, &roughness);
    assert_near(&pixels3(&full.radiance), 0.7, 1e-5);
    assert_near(&pixels(&full.variance), 0.0, 1e-6);
    assert_near(&pixels3(&smoothed(isa(), &view, &full, &roughness)), 0.7, 1e-5);
    assert!(pixels(&full.distance).into_iter().all(|d| d > 0.0));
}

/// Second moments of the response to a bright pixel.
fn spread(view: &View, roughness: f32) -> [f64; 2] {
    let size = view.eye.size;
    let middle = (size.0 / 2, size.1 / 2);
    let radiance = fill3(size, |x, y| Vec3::splat(if (x, y) == middle { 1.0 } else { 0.0 }));
    let distance = fill(size, |_, _| 20.0);
    let roughness = fill(size, |_, _| roughness);
    let mut out = Plane3::default();
    let settings = ReflectionFilterSettings { most_radius: 12.0, ..Default::default() };
    ReflectionFilter::new(isa())
        .filter(
            &view.surfaces(isa()),
            &radiance,
            &distance,
            &roughness,
            None,
            &view.eye.world_to_pixel(),
            &settings,
            &mut out,
        )
        .unwrap();
    let (mut moments, mut sum) = ([0.0; 2], 0.0);
    for y in 0..size.1 {
        for x in 0..size.0 {
            let value = f64::from(out.get(x, y).x);
            moments[0] += value * (f64::from(x) - f64::from(middle.0)).powi(2);
            moments[1] += value * (f64::from(y) - f64::from(middle.1)).powi(2);
            sum += value;
        }
    }
    moments.map(|m| (m / sum).sqrt())
}

#[test]
fn kernels_are_drawn_out_at_grazing_angles() {
    let eye = Eye::look(Vec3::new(0.0, 1.0, 6.0), Vec3::ZERO, 0.15, (64, 64));
    let grazing = View::new(eye, &[(Vec3::ZERO, Vec3::Y, &|_| true)]);
    let [x, y] = spread(&grazing, 0.5);
    assert!(y > 2.0 * x, "{x} {y}");
    // The same on its side.
    let eye = Eye::look(Vec3::new(1.0, 0.0, 6.0), Vec3::ZERO, 0.15, (64, 64));
    let [x, y] = spread(&View::new(eye, &[(Vec3::ZERO, Vec3::X, &|_| true)]), 0.5);
    assert!(x > 2.0 * y, "{x} {y}");
    let [x, y] = spread(&View::wall(64, 64), 0.5);
    assert!((x / y - 1.0).abs() < 0.1 && x > 1.0, "{x} {y}");
    // Rougher is wider, and mirrors are left alone.
    assert!(spread(&View::wall(64, 64), 0.12)[0] < 0.7 * x);
    assert_eq!(spread(&grazing, 0.0), [0.0; 2]);
}

/// Accumulates noisy mirror images under an eye that moves sideways; the error of the last frame.
fn moving(label: f32, settings: &ReflectionHistorySettings) -> [f64; 2] {
    let mut rng = Rng::new(9);
    let mut history = ReflectionHistory::new(isa());
    let mut reprojection = Reprojection::new();
    let mut before: Option<Eye> = None;
    let mut errors = [0.0; 2];
    for i in 0..24 {
        let mut view = floor(SIZE, EYE + Vec3::new(0.06, 0.01, 0.0) * i as f32);
        let (mut distance, mut clean) = (view.depth.clone(), Plane3::new(SIZE.0, SIZE.1).unwrap());
        let last = before.unwrap_or(view.eye);
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let at = view.position.get(x, y);
                let ray = view.eye.direction(x, y).normalize();
                let (_, t) = world(at, Vec3::new(ray.x, -ray.y, ray.z));
                // Smooth stripes: no error comes of interpolation.
                let image = at + Vec3::new(ray.x, -ray.y, ray.z) * t.min(100.0);
                let light = Vec3::splat(0.5 + 0.3 * (3.0 * image.x).sin());
                clean.set(x, y, light);
                distance.set(x, y, t.min(100.0));
                let motion = last.project(at) - view.eye.project(at);
                view.motion[0].set(x, y, motion.x);
                view.motion[1].set(x, y, motion.y);
            }
        }
        let noisy = fill3(SIZE, |x, y| clean.get(x, y) + Vec3::splat(0.3 * (rng.f32() - 0.5)));
        let taps = reprojection.advance(&view.guides(), &SurfaceTests::default()).unwrap();
        let frame = ReflectionFrame {
            radiance: &noisy,
            distance: &distance,
            roughness: &fill(SIZE, |_, _| label),
            position: &view.position,
            world_to_pixel: view.eye.world_to_pixel(),
            world_to_pixel_before: last.world_to_pixel(),
        };
        let mut out = Plane3::default();
        history.accumulate(&frame, &view.guides(), taps, settings, &mut out).unwrap();
        before = Some(view.eye);
        // Where the wall is reflected; the sky has no stripes that stand still.
        let inside: Vec<(u32, u32)> = (0..SIZE.1)
            .flat_map(|y| (12..SIZE.0 - 12).map(move |x| (x, y)))
            .filter(|&(x, y)| distance.get(x, y) < 50.0)
            .collect();
        let take = |p: &Plane3| inside.iter().map(|&(x, y)| p.get(x, y).x).collect::<Vec<_>>();
        errors = [rmse(&take(&noisy), &take(&clean)), rmse(&take(&out), &take(&clean))];
    }
    errors
}

#[test]
fn mirror_images_are_followed_where_surfaces_are_not() {
    let settings = ReflectionHistorySettings { deviations: 1e6, ..Default::default() };
    let [before, image] = moving(0.0, &settings);
    let [_, surface] = moving(1.0, &settings);
    assert!(2.5 * image < before && 2.0 * image < surface, "{before} {image} {surface}");
    let [_, clipped] = moving(0.0, &ReflectionHistorySettings::default());
    assert!(2.0 * clipped < before, "{before} {clipped}");
}

#[test]
fn what_came_from_another_distance_is_not_taken() {
    // The eye rests; what is reflected changes from a far bright thing to a near dark one.
    let view = floor((40, 30), EYE);
    let run = |after: f32, roughness: f32| {
        let mut history = ReflectionHistory::new(isa());
        let mut reprojection = Reprojection::new();
        let mut out = Plane3::default();
        for i in 0..12 {
            let (light, far) = if i < 10 { (1.0, 10.0) } else { (0.0, after) };
            let matrix = view.eye.world_to_pixel();
            let taps = reprojection.advance(&view.guides(), &SurfaceTests::default()).unwrap();
            let frame = ReflectionFrame {
                radiance: &fill3((40, 30), |_, _| Vec3::splat(light)),
                distance: &fill((40, 30), |_, _| far),
                roughness: &fill((40, 30), |_, _| roughness),
                position: &view.position,
                world_to_pixel: matrix,
                world_to_pixel_before: matrix,
            };
            let settings = ReflectionHistorySettings { deviations: 1e6, ..Default::default() };
            // No deviation is allowed in a constant picture, but for rounding.
            history.accumulate(&frame, &view.guides(), taps, &settings, &mut out).unwrap();
        }
        out.get(20, 15).x
    };
    assert_near(&[run(2.0, 0.0)], 0.0, 1e-6);
}

#[test]
fn constants_stay() {
    for size in SIZES {
        let mut view = View::wall(size.0, size.1);
        view.motion[0].fill(0.3);
        let mut history = ReflectionHistory::new(isa());
        let mut reprojection = Reprojection::new();
        let mut out = Plane3::default();
        for _ in 0..6 {
            let matrix = view.eye.world_to_pixel();
            let taps = reprojection.advance(&view.guides(), &SurfaceTests::default()).unwrap();
            let frame = ReflectionFrame {
                radiance: &fill3(size, |_, _| Vec3::splat(0.7)),
                distance: &fill(size, |_, _| 3.0),
                roughness: &fill(size, |x, _| x as f32 / size.0 as f32),
                position: &view.position,
                world_to_pixel: matrix,
                world_to_pixel_before: matrix,
            };
            let settings = ReflectionHistorySettings::default();
            history.accumulate(&frame, &view.guides(), taps, &settings, &mut out).unwrap();
            assert_near(&pixels3(&out), 0.7, 1e-5);
        }
    }
}

/// All three filters after one another, for some frames.
fn chain(isa: IsaLevel, view: &View, rays: &Rays, roughness: &Plane) -> Vec<f32> {
    let full = resolved(isa, view, rays, roughness);
    let radiance = smoothed(isa, view, &full, roughness);
    let mut all = pixels3(&full.radiance);
    all.extend(pixels(&full.variance));
    all.extend(pixels3(&radiance));
    let mut history = ReflectionHistory::new(isa);
    let mut reprojection = Reprojection::new();
    let mut out = Plane3::default();
    for i in 0..3 {
        let moved = Eye { position: view.eye.position + Vec3::splat(0.01 * i as f32), ..view.eye };
        let taps = reprojection.advance(&view.guides(), &SurfaceTests::default()).unwrap();
        let frame = ReflectionFrame {
            radiance: if i == 1 { &full.radiance } else { &radiance },
            distance: &full.distance,
            roughness,
            position: &view.position,
            world_to_pixel: view.eye.world_to_pixel(),
            world_to_pixel_before: moved.world_to_pixel(),
        };
        let settings = ReflectionHistorySettings::default();
        history.accumulate(&frame, &view.guides(), taps, &settings, &mut out).unwrap();
    }
    all.extend(pixels3(&out));
    assert_sane(&pixels(&full.distance));
    all
}

#[test]
fn threads_and_instruction_sets_do_not_matter() {
    let view = floor((67, 41), EYE);
    let rays = Rays::new(&view, 0.4, 3);
    let roughness = fill((67, 41), |x, _| x as f32 / 67.0);
    assert_same_everywhere(|isa| chain(isa, &view, &rays, &roughness));
}

#[test]
fn bad_numbers_and_sizes() {
    for size in SIZES {
        let view = floor(size, EYE).spoilt();
        let rays = Rays::new(&floor(size, EYE), 0.4, 3);
        let rays = Rays {
            origin: spoil3(rays.origin),
            direction: spoil3(rays.direction),
            distance: spoil(rays.distance),
            pdf: spoil(rays.pdf),
            radiance: spoil3(rays.radiance),
        };
        let roughness = spoil(fill(size, |x, y| (x + y) as f32 / 50.0));
        assert_sane(&chain(isa(), &view, &rays, &roughness));
    }
    let view = floor((9, 8), EYE);
    let rays = Rays::new(&floor((9, 7), EYE), 0.4, 3);
    let short = Rays::new(&floor((9, 5), EYE), 0.4, 3);
    let roughness = fill((9, 8), |_, _| 0.3);
    let surface = ReflectionSurface {
        position: &view.position,
        normal: &view.normal,
        roughness: &roughness,
        footprint: &view.footprint,
        eye: EYE,
    };
    let mut resolve = ReflectionResolve::new(isa());
    let (mut out, settings) = (Resolved::default(), ReflectionSettings::default());
    assert!(resolve.resolve(&rays.rays(), &surface, &settings, &mut out).is_ok());
    let result = resolve.resolve(&short.rays(), &surface, &settings, &mut out);
    assert!(matches!(result, Err(DenoiseError::Mismatch { .. })));
    let wrong = ReflectionSettings { most_weight: f32::NAN, ..settings };
    let result = resolve.resolve(&rays.rays(), &surface, &wrong, &mut out);
    assert!(matches!(result, Err(DenoiseError::Setting { .. })));
    let mut filter = ReflectionFilter::new(isa());
    let surfaces = view.surfaces(isa());
    let mut run = |distance: &Plane, settings: &ReflectionFilterSettings| {
        let matrix = view.eye.world_to_pixel();
        let mut planes = Plane3::default();
        let Resolved { radiance, .. } = &out;
        filter.filter(
            &surfaces,
            radiance,
            distance,
            &roughness,
            None,
            &matrix,
            settings,
            &mut planes,
        )
    };
    let settings = ReflectionFilterSettings::default();
    assert!(run(&out.distance, &settings).is_ok());
    let result = run(&Plane::new(9, 7).unwrap(), &settings);
    assert!(matches!(result, Err(DenoiseError::Mismatch { .. })));
    let wrong = ReflectionFilterSettings { most_radius: 17.0, ..settings };
    assert!(matches!(run(&out.distance, &wrong), Err(DenoiseError::Setting { .. })));
    assert!(ReflectionHistorySettings { sharp: 0.7, ..Default::default() }.check().is_err());
}
