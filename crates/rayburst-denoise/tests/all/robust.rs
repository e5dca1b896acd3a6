//! Bad input, odd sizes, threads and instruction sets.

use glam::Vec3;
use rayburst_denoise::{AdaptiveSvgf, GradientSettings, MOST_LEVELS, Svgf, SvgfSettings, Wavelet};
use rayburst_image::Plane3;
use rayburst_simd::IsaLevel;

use crate::frames::{Frame, colours, random};

/// A frame in which all that can be wrong is.
fn hostile(w: u32, h: u32, seed: u32) -> (Frame, Plane3) {
    let mut random = random(seed);
    let bad = [f32::NAN, f32::INFINITY, -f32::INFINITY, 0.0, -1.0, 3e38, 1e-40, -3e38];
    let mut frame = Frame::wall(w, h);
    let mut value = |good: f32| match random.below(24) {
        i if i < 8 => bad[i as usize],
        _ => good,
    };
    for y in 0..h {
        for x in 0..w {
            frame.depth.set(x, y, value(10.0 + x as f32));
            let normal = Vec3::new(value(0.0), value(0.6), value(0.8));
            frame.normal.set(x, y, normal);
            frame.object.set(x, y, [0, 1, 1, u32::MAX][(value(7.0).to_bits() % 4) as usize]);
            frame.motion[0].set(x, y, value(0.25));
            frame.motion[1].set(x, y, value(-1.5));
        }
    }
    let picture = colours(w, h, |_, _| Vec3::new(value(1.0), value(2.0), value(3.0)));
    (frame, picture)
}

fn all_good(planes: &Plane3) -> bool {
    let mut good = true;
    for channel in &planes.channels {
        for y in 0..channel.height() {
            good &= channel.row(y).iter().all(|v| v.is_finite() && *v >= 0.0);
        }
    }
    good
}

#[test]
fn whatever_comes_in_what_goes_out_is_finite_and_not_negative() {
    for (w, h) in [(1, 1), (1, 7), (7, 1), (2, 2), (3, 5), (16, 16), (17, 9), (65, 33)] {
        let isa = IsaLevel::detect();
        let mut svgf = Svgf::<2>::new(isa);
        let mut adaptive = AdaptiveSvgf::<2>::new(isa);
        let mut wavelet = Wavelet::<1>::new(isa);
        let settings = SvgfSettings { levels: MOST_LEVELS, ..SvgfSettings::default() };
        let mut out = [Plane3::new(w, h).unwrap(), Plane3::new(w, h).unwrap()];
        for seed in 0..6 {
            let (frame, picture) = hostile(w, h, seed);
            let (_, other) = hostile(w, h, seed + 1000);
            let guides = frame.guides();
            svgf.filter(&guides, [&picture, &other], &settings, &mut out).unwrap();
            assert!(out.iter().all(all_good), "{w}×{h} {seed}");
            let (signals, gradients) = ([&picture, &other], GradientSettings::default());
            adaptive.filter(&guides, signals, None, &settings, &gradients, &mut out).unwrap();
            assert!(out.iter().all(all_good), "{w}×{h} {seed}");
            let [first, _] = &mut out;
            let mut one = [first.clone()];
            let spread = &other.channels[0];
            let stopping = &settings.stopping;
            wavelet.filter(&guides, [&picture], Some([spread]), 5, stopping, &mut one).unwrap();
            assert!(all_good(&one[0]), "{w}×{h} {seed}");
        }
    }
}

#[test]
fn bad_samples_do_not_spread() {
    // A pixel that is bad in every other frame is as good as its neighbours.
    let (w, h) = (32, 24);
    let frame = Frame::wall(w, h);
    let truth = colours(w, h, |_, _| Vec3::splat(2.0));
    let mut svgf = Svgf::<1>::new(IsaLevel::detect());
    let mut out = [truth.clone()];
    for n in 0..6 {
        let mut noisy = truth.clone();
        if n % 2 == 1 {
            noisy.set(11, 9, Vec3::new(2.0, f32::NAN, 2.0));
            noisy.set(20, 9, Vec3::splat(f32::INFINITY));
        }
        svgf.filter(&frame.guides(), [&noisy], &SvgfSettings::default(), &mut out).unwrap();
        for y in 0..h {
            for x in 0..w {
                assert!((out[0].get(x, y) - 2.0).abs().max_element() < 1e-4, "{n} {x} {y}");
            }
        }
    }
}

fn run(isa: IsaLevel, threads: usize, size: (u32, u32)) -> [Plane3; 2] {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut filter = AdaptiveSvgf::<2>::new(isa);
        let empty = Plane3::new(size.0, size.1).unwrap();
        let mut out = [empty.clone(), empty];
        for seed in 0..5 {
            let (mut frame, picture) = hostile(size.0, size.1, seed);
            frame.motion[0].fill(0.5);
            let (_, other) = hostile(size.0, size.1, seed + 50);
            // Next to 10^16 nothing else would be compared.
            let [picture, other] = [picture, other].map(|planes| {
                colours(size.0, size.1, |x, y| {
                    planes.get(x, y).map(|v| if v > 50.0 { 50.0 } else { v })
                })
            });
            let (settings, gradients) = (SvgfSettings::default(), GradientSettings::default());
            let signals = [&picture, &other];
            filter.filter(&frame.guides(), signals, None, &settings, &gradients, &mut out).unwrap();
        }
        out
    })
}

#[test]
fn pictures_depend_on_neither_threads_nor_instruction_sets() {
    for size in [(100, 70), (33, 200)] {
        let one = run(IsaLevel::detect(), 1, size);
        for threads in [2, 3, 5] {
            assert!(run(IsaLevel::detect(), threads, size) == one, "{threads} threads");
        }
        for isa in IsaLevel::available() {
            let other = run(isa, 2, size);
            let mut worst: f32 = 0.0;
            for (a, b) in one.iter().zip(&other) {
                for y in 0..size.1 {
                    for x in 0..size.0 {
                        let (p, q) = (a.get(x, y), b.get(x, y));
                        let largest = p.abs().max_element().max(1e-30);
                        worst = worst.max((p - q).abs().max_element() / largest);
                    }
                }
            }
            assert!(worst <= 1e-5, "{}: {worst}", isa.name());
        }
    }
}

#[test]
fn sizes_that_change_begin_afresh_and_sizes_that_differ_are_errors() {
    let mut svgf = Svgf::<1>::new(IsaLevel::detect());
    let settings = SvgfSettings::default();
    for (w, h) in [(20, 10), (10, 20), (1, 1), (20, 10)] {
        let frame = Frame::wall(w, h);
        let picture = colours(w, h, |x, y| Vec3::splat((x + y) as f32));
        let mut out = [picture.clone()];
        for n in 1..3 {
            svgf.filter(&frame.guides(), [&picture], &settings, &mut out).unwrap();
            assert_eq!(svgf.history(0).length_row(0)[0], n as f32);
        }
        let mut other = [Plane3::new(w + 1, h).unwrap()];
        assert!(svgf.filter(&frame.guides(), [&picture], &settings, &mut other).is_err());
        let wrong = other[0].clone();
        assert!(svgf.filter(&frame.guides(), [&wrong], &settings, &mut out).is_err());
        let bad = SvgfSettings { shortest: -1.0, ..settings };
        assert!(svgf.filter(&frame.guides(), [&picture], &bad, &mut out).is_err());
    }
}
