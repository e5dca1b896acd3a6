//! Pixels that are far too bright.

use glam::Vec3;
use rayburst_denoise::{DenoiseError, FireflyFilter, FireflySettings};
use rayburst_image::Plane3;
use rayburst_math::hash::Rng;
use rayburst_simd::IsaLevel;

use crate::views::{SIZES, assert_same_everywhere, assert_sane, fill3, isa, mean, pixels3, spoil3};

fn filtered(isa: IsaLevel, colour: &Plane3, settings: FireflySettings) -> Plane3 {
    let mut out = Plane3::default();
    FireflyFilter::new(isa).filter(colour, &settings, &mut out).unwrap();
    out
}

const BOTH: [FireflySettings; 2] = [
    FireflySettings { spacing: 1, deviations: 4.0 },
    FireflySettings { spacing: 2, deviations: 4.0 },
];

#[test]
fn constant_pictures_keep_their_bits() {
    for settings in BOTH {
        for size in SIZES {
            let colour = fill3(size, |_, _| Vec3::new(0.3, 1e6, 7.0));
            assert_eq!(pixels3(&filtered(isa(), &colour, settings)), pixels3(&colour));
        }
    }
}

#[test]
fn lone_and_paired_fireflies_go_even_at_corners() {
    for settings in BOTH {
        let size = (40, 30);
        let flies = [(0, 0), (39, 29), (20, 0), (10, 10), (12, 10), (30, 20)];
        let colour = fill3(size, |x, y| {
            let noise = 1.0 + 0.1 * ((x * 7 + y * 13) % 5) as f32;
            Vec3::splat(if flies.contains(&(x, y)) { 1e5 } else { noise })
        });
        let out = filtered(isa(), &colour, settings);
        for (x, y) in flies {
            assert!(out.get(x, y).max_element() < 3.0, "{x} {y}: {}", out.get(x, y));
        }
    }
}

#[test]
fn fireflies_of_whole_blocks_go_where_blocks_share() {
    let colour = fill3((40, 40), |x, y| {
        let noise = 1.0 + 0.1 * ((x / 2 * 7 + y / 2 * 13) % 5) as f32;
        Vec3::splat(if (x / 2, y / 2) == (8, 9) { 1e5 } else { noise })
    });
    let out = filtered(isa(), &colour, BOTH[1]);
    assert!(pixels3(&out).into_iter().all(|v| v < 3.0));
}

#[test]
fn hue_stays() {
    let colour =
        fill3(
            (9, 9),
            |x, y| {
                if (x, y) == (4, 4) { Vec3::new(1e4, 2e4, 5e3) } else { Vec3::splat(1.0) }
            },
        );
    let c = filtered(isa(), &colour, BOTH[1]).get(4, 4);
    assert!((c.y / c.x - 2.0).abs() < 1e-5 && (c.z / c.x - 0.5).abs() < 1e-5, "{c}");
}

/// Of stationary noise no more is lost than the bound, plus what comes of few neighbours.
#[test]
fn the_loss_of_energy_is_bounded() {
    type Draw = fn(&mut Rng) -> f32;
    let kinds: [(&str, Draw); 4] = [
        ("uniform", |rng| 2.0 * rng.f32()),
        ("exponential", |rng| -(1.0 - rng.f32()).ln()),
        ("one in four", |rng| if rng.f32() < 0.25 { 4.0 } else { 0.0 }),
        ("one in eight", |rng| if rng.f32() < 0.125 { 8.0 } else { 0.0 }),
    ];
    for settings in BOTH {
        for (name, draw) in kinds {
            let mut rng = Rng::new(5);
            let colour = fill3((256, 256), |_, _| Vec3::splat(draw(&mut rng)));
            let out = filtered(isa(), &colour, settings);
            let (before, after) = (pixels3(&colour), pixels3(&out));
            let m = mean(&before);
            let deviation = mean(&before.iter().map(|v| v * v).collect::<Vec<_>>()) - m * m;
            let lost = (m - mean(&after)) / deviation.sqrt();
            let bound = f64::from(settings.loss());
            assert!((0.0..=bound + 0.03).contains(&lost), "{name}, {settings:?}: {lost} > {bound}");
            let gained = before.iter().zip(&after).any(|(before, after)| after > before);
            assert!(!gained, "{name}");
        }
    }
}

#[test]
fn bad_numbers_and_sizes() {
    for settings in BOTH {
        for size in SIZES {
            let colour = spoil3(fill3(size, |x, y| Vec3::new(x as f32, y as f32, 1.0)));
            assert_sane(&pixels3(&filtered(isa(), &colour, settings)));
        }
    }
    let mut filter = FireflyFilter::new(isa());
    let mut out = Plane3::default();
    let mut torn = Plane3::new(4, 4).unwrap();
    torn.channels[2] = rayburst_image::Plane::new(4, 5).unwrap();
    let result = filter.filter(&torn, &FireflySettings::default(), &mut out);
    assert!(matches!(result, Err(DenoiseError::Mismatch { .. })));
    assert!(filter.filter(&Plane3::default(), &FireflySettings::default(), &mut out).is_err());
    let wrong = FireflySettings { deviations: f32::NAN, ..FireflySettings::default() };
    let result = filter.filter(&Plane3::new(4, 4).unwrap(), &wrong, &mut out);
    assert!(matches!(result, Err(DenoiseError::Setting { .. })));
}

#[test]
fn threads_and_instruction_sets_do_not_matter() {
    let mut rng = Rng::new(3);
    let colour = fill3((67, 41), |_, _| rng.vec3() * if rng.f32() < 0.02 { 50.0 } else { 1.0 });
    assert_same_everywhere(|isa| pixels3(&filtered(isa, &colour, FireflySettings::default())));
}

#[test]
fn light_noise_keeps_its_mean() {
    let mut rng = Rng::new(2);
    let colour = fill3((128, 96), |_, _| 0.5 + rng.vec3());
    let out = filtered(isa(), &colour, FireflySettings::default());
    let (before, after) = (mean(&pixels3(&colour)), mean(&pixels3(&out)));
    assert!((after / before - 1.0).abs() < 1e-3, "{before} {after}");
}
