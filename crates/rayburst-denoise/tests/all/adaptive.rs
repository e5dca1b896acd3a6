//! The filter that forgets what has changed.

use glam::Vec3;
use rayburst_denoise::{
    AdaptiveSvgf, GradientSamples, GradientSettings, Gradients, NO_SAMPLE, STRATUM, Svgf,
    SvgfSettings, strata,
};
use rayburst_image::{Plane, Plane3};
use rayburst_simd::IsaLevel;

use crate::{
    frames::{Frame, colours, plane},
    svgf::{light, noise},
};

/// Gradient samples of a light that is `before` and `now` times as bright, without noise, as shading again
/// with the same random numbers gives: here of the middle of strata.
fn samples(truth: &Plane3, before: f32, now: f32) -> (Plane, Plane, Plane<u32>) {
    let size @ (w, h) = truth.size();
    let (sw, sh) = strata(size);
    let pixel = |x: u32, y: u32| ((x * STRATUM + 1).min(w - 1), (y * STRATUM + 1).min(h - 1));
    let luminance = |x, y| {
        let (x, y) = pixel(x, y);
        rayburst_image::colour::luminance(truth.get(x, y))
    };
    let difference = plane(sw, sh, |x, y| luminance(x, y) * (now - before));
    let largest = plane(sw, sh, |x, y| luminance(x, y) * now.max(before));
    let mut pixels = Plane::new(sw, sh).unwrap();
    for y in 0..sh {
        for x in 0..sw {
            let (px, py) = pixel(x, y);
            pixels.set(x, y, px + py * w);
        }
    }
    (difference, largest, pixels)
}

fn mean(planes: &Plane3) -> f32 {
    let (w, h) = planes.size();
    let mut sum = Vec3::ZERO;
    for y in 0..h {
        for x in 0..w {
            sum += planes.get(x, y);
        }
    }
    sum.element_sum() / (3 * w * h) as f32
}

/// What is left of a light that goes out after 30 frames, for some frames: without gradients, with samples of
/// them, with estimates.
fn residuals(after: u32) -> [f32; 3] {
    let (w, h) = (60, 48);
    let frame = Frame::wall(w, h);
    let truth = colours(w, h, light);
    let (settings, gradients) = (SvgfSettings::default(), GradientSettings::default());
    let isa = IsaLevel::detect();
    let mut plain = Svgf::<1>::new(isa);
    let mut sampled = AdaptiveSvgf::<1>::new(isa);
    let mut estimated = AdaptiveSvgf::<1>::new(isa);
    let mut outs = [[truth.clone()], [truth.clone()], [truth.clone()]];
    let dead = GradientSettings { dead_zone: 0.2, ..gradients };
    for n in 0..30 + after {
        let brightness = |n: u32| if n < 30 { 1.0 } else { 0.01 };
        let (now, before) = (brightness(n), brightness(n.saturating_sub(1)));
        let mut noisy = noise(&truth, 500 + n);
        for channel in &mut noisy.channels {
            channel.values_mut().iter_mut().for_each(|value| *value *= now);
        }
        let (difference, largest, pixel) = samples(&truth, before, now);
        let given = GradientSamples { difference: &difference, largest: &largest, pixel: &pixel };
        let guides = frame.guides();
        plain.filter(&guides, [&noisy], &settings, &mut outs[0]).unwrap();
        sampled
            .filter(&guides, [&noisy], Some([given]), &settings, &gradients, &mut outs[1])
            .unwrap();
        estimated.filter(&guides, [&noisy], None, &settings, &dead, &mut outs[2]).unwrap();
        if n == 29 {
            // Nothing has changed: the filters are one.
            assert_eq!(outs[0], outs[1]);
            let difference = (mean(&outs[2][0]) / mean(&outs[0][0]) - 1.0).abs();
            assert!(difference < 0.05, "{difference}");
        }
    }
    outs.map(|out| (mean(&out[0]) - 0.01 * mean(&truth)).max(0.0) / mean(&truth))
}

#[test]
fn a_light_that_goes_out_is_forgotten_four_times_sooner() {
    let [plain, sampled, estimated] = residuals(4);
    assert!(plain > 0.3, "{plain}");
    assert!(sampled < 0.25 * plain, "{sampled} {plain}");
    assert!(estimated < 0.5 * plain, "{estimated} {plain}");
}

#[test]
fn changes_are_those_of_the_surface_they_are_on() {
    let size @ (w, h) = (64, 40);
    let mut frame = Frame::wall(w, h);
    for y in 0..h {
        for x in 33..w {
            frame.object.set(x, y, 2);
        }
    }
    let truth = colours(w, h, |_, _| Vec3::ONE);
    let (mut difference, largest, mut pixel) = samples(&truth, 0.0, 1.0);
    let (sw, sh) = strata(size);
    for y in 0..sh {
        for x in 0..sw {
            if x >= 11 {
                difference.set(x, y, 0.0);
            } else if (x + y) % 3 != 0 {
                // Most strata have no sample.
                pixel.set(x, y, NO_SAMPLE);
                difference.set(x, y, f32::NAN);
            }
        }
    }
    difference.set(20, 5, f32::INFINITY);
    let given = GradientSamples { difference: &difference, largest: &largest, pixel: &pixel };
    let mut gradients = Gradients::new(IsaLevel::detect());
    let settings = GradientSettings::default();
    let change = gradients.reconstruct(&frame.guides(), &given, &settings).unwrap();
    for y in 0..h {
        for x in 0..w {
            let expected = if x < 33 { 1.0 } else { 0.0 };
            assert!((change.get(x, y) - expected).abs() < 1e-3, "{x} {y}: {}", change.get(x, y));
        }
    }
    // Half a change is one half, or none within the dead zone.
    difference.fill(-0.5);
    pixel.fill(0);
    let given = GradientSamples { difference: &difference, largest: &largest, pixel: &pixel };
    for (dead_zone, expected) in [(0.0, 0.5), (0.5, 0.0), (0.25, 1.0 / 3.0)] {
        let settings = GradientSettings { dead_zone, ..settings };
        let change = gradients.reconstruct(&frame.guides(), &given, &settings).unwrap();
        assert!((change.get(9, 9) - expected).abs() < 1e-3);
    }
    let small = Plane::new(3, 3).unwrap();
    let given = GradientSamples { difference: &small, largest: &largest, pixel: &pixel };
    assert!(gradients.reconstruct(&frame.guides(), &given, &settings).is_err());
    let bad = GradientSettings { dead_zone: 1.0, ..settings };
    let given = GradientSamples { difference: &difference, ..given };
    assert!(gradients.reconstruct(&frame.guides(), &given, &bad).is_err());
}
