//! The wavelet transform against its slow twin, and what it must keep.

use glam::Vec3;
use rayburst_denoise::{EdgeStopping, Wavelet, WaveletKernel, Window, weighted_average};
use rayburst_image::{Plane, Plane3, colour::luminance};
use rayburst_simd::IsaLevel;

use crate::frames::{Frame, colours, plane, random};

/// A scene with a slanted floor, a wall, a ball in front, and a hole.
fn scene(w: u32, h: u32) -> Frame {
    let mut frame = Frame::wall(w, h);
    for y in 0..h {
        for x in 0..w {
            let (fx, fy) = (x as f32 / w as f32, y as f32 / h as f32);
            if fy > 0.6 {
                frame.depth.set(x, y, 6.0 / (fy - 0.1));
                frame.normal.set(x, y, Vec3::Y);
                frame.object.set(x, y, 2);
            }
            let (dx, dy) = (fx - 0.4, fy - 0.5);
            let d = dx * dx + dy * dy;
            if d < 0.06 {
                let z = (0.06 - d).sqrt();
                frame.depth.set(x, y, 6.0 - 3.0 * z);
                frame.normal.set(x, y, Vec3::new(dx, -dy, z).normalize());
                frame.object.set(x, y, 3);
            }
            if fx > 0.9 && fy < 0.3 {
                frame.depth.set(x, y, f32::INFINITY);
                frame.normal.set(x, y, Vec3::ZERO);
                frame.object.set(x, y, 0);
            }
        }
    }
    frame
}

/// Of the two differences to neighbours the smaller one.
fn slope(depth: &Plane, (x, y): (u32, u32), (dx, dy): (i32, i32)) -> f64 {
    let at = |x: i32, y: i32| {
        let inside = x >= 0 && y >= 0 && x < depth.width() as i32 && y < depth.height() as i32;
        if inside { f64::from(depth.get(x as u32, y as u32)) } else { f64::NAN }
    };
    let (x, y) = (x as i32, y as i32);
    let (a, b) = (at(x, y) - at(x - dx, y - dy), at(x + dx, y + dy) - at(x, y));
    let mut best = 0.0;
    for (i, value) in [a, b].into_iter().filter(|v| v.is_finite()).enumerate() {
        if i == 0 || value.abs() < f64::abs(best) {
            best = value;
        }
    }
    best
}

/// One level as its documentation says, in double precision: colour and variance.
fn reference(
    frame: &Frame,
    colour: &Plane3,
    variance: Option<&Plane>,
    level: u32,
    stopping: &EdgeStopping,
) -> (Plane3, Plane) {
    let (w, h) = colour.size();
    let step = 1 << level;
    let taps = stopping.kernel.weights().map(f64::from);
    let radius = if taps[2] > 0.0 { 2 } else { 1 };
    let blurred = |x: u32, y: u32| {
        let mut sum = 0.0;
        for dy in -1..=1i32 {
            for dx in -1..=1i32 {
                let weight = [0.5, 0.25][dx.unsigned_abs() as usize]
                    * [0.5, 0.25][dy.unsigned_abs() as usize];
                let value = variance.unwrap().get_clamped(x as i32 + dx, y as i32 + dy);
                sum += weight * f64::from(value);
            }
        }
        sum
    };
    let weight = |(x, y): (u32, u32), tap: rayburst_denoise::Tap| {
        let (dx, dy) = (x.abs_diff(tap.x) / step, y.abs_diff(tap.y) / step);
        let kernel = taps[dx as usize] * taps[dy as usize];
        if (dx, dy) == (0, 0) {
            return kernel;
        }
        let object = frame.object.get(x, y);
        if object == 0 || object != frame.object.get(tap.x, tap.y) {
            return 0.0;
        }
        let (z, zt) = (frame.depth.get(x, y), frame.depth.get(tap.x, tap.y));
        let (ox, oy) = (f64::from(tap.x) - f64::from(x), f64::from(tap.y) - f64::from(y));
        let along =
            slope(&frame.depth, (x, y), (1, 0)) * ox + slope(&frame.depth, (x, y), (0, 1)) * oy;
        // The floor of the tolerance grows with the offset's largest whole factor.
        let (a, b) = (dx.max(dy), dx.min(dy));
        let times = if b == 0 || a == b { a } else { 1 };
        let least = 2.5e-4 * f64::from(z) * f64::from(step * times);
        let mut sum =
            f64::from((zt - z).abs()) / (f64::from(stopping.depth) * (along.abs() + least));
        let cosine = frame.normal.get(x, y).dot(frame.normal.get(tap.x, tap.y));
        sum += f64::from(stopping.normal) * (1.0 - f64::from(cosine));
        let l = f64::from(luminance(colour.get(x, y)));
        let lt = f64::from(luminance(colour.get(tap.x, tap.y)));
        let tolerated = match variance {
            Some(_) => f64::from(stopping.luminance) * blurred(x, y).sqrt(),
            None => f64::from(stopping.luminance) / f64::from(step),
        };
        sum += (lt - l).abs() / (tolerated + 1e-3 * l + 1e-18);
        kernel * (-sum).exp()
    };
    let window = Window { radius, step };
    let mut out = Plane3::new(w, h).unwrap();
    for (channel, plane) in out.channels.iter_mut().enumerate() {
        *plane = weighted_average(&[&colour.channels[channel]], window, weight).unwrap();
    }
    // Variance has squared weights: average with those, then correct the normalisation.
    let mut filtered = Plane::new(w, h).unwrap();
    if let Some(variance) = variance {
        let squares = |p, tap| {
            let weight: f64 = weight(p, tap);
            weight * weight
        };
        let average = weighted_average(&[variance], window, squares).unwrap();
        for y in 0..h {
            for x in 0..w {
                let (mut one, mut two) = (0.0, 0.0);
                for qy in 0..h {
                    for qx in 0..w {
                        let (dx, dy) = (x.abs_diff(qx), y.abs_diff(qy));
                        let reach = radius * step;
                        if dx % step == 0 && dy % step == 0 && dx <= reach && dy <= reach {
                            let weight =
                                weight((x, y), rayburst_denoise::Tap { x: qx, y: qy, frame: 0 });
                            one += weight;
                            two += weight * weight;
                        }
                    }
                }
                filtered.set(x, y, (f64::from(average.get(x, y)) * two / (one * one)) as f32);
            }
        }
    }
    (out, filtered)
}

fn worst(a: &Plane3, b: &Plane3) -> f32 {
    let (w, h) = a.size();
    let mut worst: f32 = 0.0;
    for y in 0..h {
        for x in 0..w {
            let (p, q) = (a.get(x, y), b.get(x, y));
            worst = worst.max((p - q).abs().max_element() / q.abs().max_element().max(1e-3));
        }
    }
    worst
}

#[test]
fn the_transform_equals_its_slow_twin() {
    let (w, h) = (45, 27);
    let frame = scene(w, h);
    let mut random = random(5);
    let noisy = colours(w, h, |_, _| random.vec3() * 4.0);
    let other = colours(w, h, |_, y| random.vec3() * y as f32);
    let spread = plane(w, h, |_, _| random.f32() * 2.0);
    let zero = Plane::new(w, h).unwrap();
    for kernel in [WaveletKernel::B3Spline, WaveletKernel::Binomial] {
        for with_variance in [true, false] {
            let stopping = EdgeStopping { kernel, luminance: 2.0, ..EdgeStopping::default() };
            let mut expected = [noisy.clone(), other.clone()];
            let mut variances = [spread.clone(), zero.clone()];
            for level in 0..3 {
                for s in 0..2 {
                    let variance = with_variance.then_some(&variances[s]);
                    let (colour, variance) =
                        reference(&frame, &expected[s], variance, level, &stopping);
                    (expected[s], variances[s]) = (colour, variance);
                }
                let mut wavelet = Wavelet::<2>::new(IsaLevel::detect());
                let mut out = [noisy.clone(), noisy.clone()];
                let given = with_variance.then_some([&spread, &zero]);
                let signals = [&noisy, &other];
                wavelet
                    .filter(&frame.guides(), signals, given, level + 1, &stopping, &mut out)
                    .unwrap();
                for s in 0..2 {
                    let worst = worst(&out[s], &expected[s]);
                    assert!(worst < 2e-3, "{kernel:?} {with_variance} {level} {s}: {worst}");
                }
            }
        }
    }
}

#[test]
fn constants_stay_and_means_are_kept() {
    for (w, h) in [(1, 1), (2, 3), (17, 1), (33, 20), (64, 48)] {
        let frame = Frame::wall(w, h);
        let constant = colours(w, h, |_, _| Vec3::new(0.25, 3.0, 700.0));
        let mut random = random(6);
        let noisy = colours(w, h, |_, _| Vec3::ONE + random.vec3());
        let spread = plane(w, h, |_, _| 0.1);
        let mut wavelet = Wavelet::<2>::new(IsaLevel::detect());
        let mut out = [constant.clone(), constant.clone()];
        let stopping = EdgeStopping::default();
        let variances = Some([&spread, &spread]);
        let signals = [&constant, &noisy];
        wavelet.filter(&frame.guides(), signals, variances, 5, &stopping, &mut out).unwrap();
        assert!(worst(&out[0], &constant) < 1e-5);
        let mean = |planes: &Plane3| {
            let mut sum = 0.0;
            for y in 0..h {
                sum += planes.channels[1].row(y).iter().sum::<f32>();
            }
            sum / (w * h) as f32
        };
        // Where there are few pixels, sides weigh too much.
        let change = mean(&out[1]) / mean(&noisy) - 1.0;
        assert!(w * h < 500 || change.abs() < 0.01, "{w} {h}: {change}");
    }
}

#[test]
fn edges_of_depth_normals_and_objects_are_kept() {
    let (w, h) = (48, 32);
    let sides = colours(w, h, |x, _| Vec3::splat(if x < 24 { 1.0 } else { 5.0 }));
    let spread = plane(w, h, |_, _| 1e6);
    let blur = |frame: &Frame, stopping: &EdgeStopping| {
        let mut out = [sides.clone()];
        let mut wavelet = Wavelet::<1>::new(IsaLevel::detect());
        let variances = Some([&spread]);
        wavelet.filter(&frame.guides(), [&sides], variances, 5, stopping, &mut out).unwrap();
        worst(&out[0], &sides)
    };
    let stopping = EdgeStopping::default();
    // Without an edge nothing stops the blur: the variance is large.
    assert!(blur(&Frame::wall(w, h), &stopping) > 0.2);
    let with = |change: &dyn Fn(&mut Frame, u32, u32)| {
        let mut frame = Frame::wall(w, h);
        for y in 0..h {
            for x in 24..w {
                change(&mut frame, x, y);
            }
        }
        frame
    };
    let depth = with(&|frame, x, y| frame.depth.set(x, y, 12.0));
    let normal = with(&|frame, x, y| frame.normal.set(x, y, Vec3::X));
    let object = with(&|frame, x, y| frame.object.set(x, y, 2));
    for frame in [&depth, &normal, &object] {
        assert!(blur(frame, &stopping) < 1e-6);
    }
    // Each by its own setting.
    let loose = EdgeStopping { depth: 1000.0, normal: 0.0, object: false, ..stopping };
    for frame in [&depth, &normal, &object] {
        assert!(blur(frame, &loose) > 0.2);
    }
    // A slant is no edge.
    let mut slant = Frame::wall(w, h);
    for y in 0..h {
        for x in 0..w {
            slant.depth.set(x, y, 10.0 + x as f32);
        }
    }
    assert!(blur(&slant, &stopping) > 0.1);
}

#[test]
fn differences_of_luminance_beyond_the_noise_are_kept() {
    let (w, h) = (64, 32);
    let frame = Frame::wall(w, h);
    let mut random = random(7);
    let noisy =
        colours(w, h, |x, _| Vec3::splat(if x < 32 { 10.0 } else { 20.0 } + random.f32() - 0.5));
    let spread = plane(w, h, |_, _| 1.0 / 12.0);
    let mut out = [noisy.clone()];
    let mut wavelet = Wavelet::<1>::new(IsaLevel::detect());
    let stopping = EdgeStopping { luminance: 2.0, ..EdgeStopping::default() };
    let signals = [&noisy];
    wavelet.filter(&frame.guides(), signals, Some([&spread]), 5, &stopping, &mut out).unwrap();
    for x in 0..w {
        let expected = if x < 32 { 10.0 } else { 20.0 };
        assert!((out[0].get(x, 16).x - expected).abs() < 0.2, "{x}: {}", out[0].get(x, 16).x);
    }
}

#[test]
fn bad_settings_and_sizes_are_errors() {
    let frame = Frame::wall(4, 4);
    let picture = Plane3::new(4, 4).unwrap();
    let mut wavelet = Wavelet::<1>::new(IsaLevel::detect());
    let good = EdgeStopping::default();
    let mut filter = |levels, stopping: &EdgeStopping, out: Plane3| {
        wavelet.filter(&frame.guides(), [&picture], None, levels, stopping, &mut [out]).is_ok()
    };
    assert!(filter(0, &good, picture.clone()) && filter(7, &good, picture.clone()));
    assert!(!filter(8, &good, picture.clone()));
    assert!(!filter(1, &good, Plane3::new(4, 5).unwrap()));
    for bad in [
        EdgeStopping { depth: 0.0, ..good },
        EdgeStopping { depth: f32::NAN, ..good },
        EdgeStopping { normal: -1.0, ..good },
        EdgeStopping { luminance: f32::INFINITY, ..good },
    ] {
        assert!(!filter(1, &bad, picture.clone()));
    }
}
