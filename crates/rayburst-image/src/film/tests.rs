use super::*;
use crate::{decode_exr, encode_exr};
use rayburst_math::hash::Rng;

fn specs() -> Vec<AovSpec> {
    vec![
        AovSpec::new("albedo", &["R", "G", "B"], AovMode::Mean, Precision::Half),
        AovSpec::new("instance", &["id"], AovMode::First, Precision::Float),
    ]
}

fn render(film: &mut Film, from: u32, to: u32) {
    for mut tile in film.tiles_mut() {
        for i in 0..tile.len() {
            let (x, y) = tile.position(i);
            for sample in from..to {
                assert_eq!(tile.pixel(i).taken(), sample);
                let mut rng = Rng::new(u64::from(x) << 40 | u64::from(y) << 20 | u64::from(sample));
                let mut rgb = rng.vec3() * 10f32.powf(rng.range(-3.0, 3.0));
                if rng.below(50) == 0 {
                    rgb.y = [f32::NAN, f32::INFINITY, 1e30][rng.below(3) as usize];
                }
                tile.add(i, rgb, &[rng.f32(), 0.25, f32::NAN, (x + sample) as f32]);
            }
        }
    }
}

#[test]
fn a_saved_and_continued_film_is_the_same_to_the_bit() {
    let mut whole = Film::new(37, 21, &specs()).unwrap();
    render(&mut whole, 0, 24);
    let mut part = Film::new(37, 21, &specs()).unwrap();
    for (from, to) in [(0, 1), (1, 9), (9, 24)] {
        render(&mut part, from, to);
        let file = encode_exr(&part.to_layers(Precision::Half, true), "film").unwrap();
        part = Film::from_layers(&decode_exr(&file, "film").unwrap(), &specs()).unwrap();
    }
    assert_eq!(part, whole);
    assert!(whole.dropped() > 100);
    assert_eq!(whole.samples_taken(), (24, 24));
    let bytes = |film: &Film| encode_exr(&film.to_layers(Precision::Float, true), "f").unwrap();
    assert_eq!(bytes(&part), bytes(&whole));
}

#[test]
fn every_pixel_has_one_place() {
    let mut film = Film::new(35, 18, &[]).unwrap();
    for mut tile in film.tiles_mut() {
        for i in 0..tile.len() {
            let (x, y) = tile.position(i);
            tile.add(i, Vec3::new(x as f32, y as f32, 1.0), &[]);
        }
    }
    let picture = film.mean();
    for y in 0..18 {
        for x in 0..35 {
            assert_eq!(picture.get(x, y), Vec3::new(x as f32, y as f32, 1.0));
        }
    }
    film.add(34, 17, Vec3::ZERO, &[]);
    assert_eq!(film.pixel(34, 17).samples, 2);
    assert_eq!(film.samples_taken(), (1, 2));
}

#[test]
fn mean_and_variance_are_the_textbook_ones() {
    let mut pixel = PixelSum::default();
    assert_eq!((pixel.mean(), pixel.variance()), (Vec3::ZERO, None));
    for value in [1.0, 2.0, 3.0, 6.0] {
        pixel.add(Vec3::splat(value));
    }
    pixel.add(Vec3::new(f32::NAN, 0.0, 0.0));
    assert_eq!(pixel.mean(), Vec3::splat(3.0));
    // Squared deviations 4 + 1 + 0 + 9, over n - 1, over n.
    assert!((pixel.variance().unwrap() - 14.0 / 12.0).abs() < 1e-5);
    assert_eq!((pixel.samples, pixel.dropped, pixel.taken()), (4, 1, 5));
}

#[test]
fn noise_falls_as_samples_come() {
    let mut film = Film::new(16, 16, &[]).unwrap();
    let mut noise = [0.0; 2];
    let mut rng = Rng::new(1);
    for (round, samples) in [64, 192].into_iter().enumerate() {
        for _ in 0..samples {
            for i in 0..256 {
                film.add(i % 16, i / 16, Vec3::splat(rng.f32()), &[]);
            }
        }
        noise[round] = film.noise();
    }
    // A uniform variable: relative deviation 1/√3, over the square root of the samples.
    assert!((noise[0] / (1.0 / 3f32.sqrt() / 8.0) - 1.0).abs() < 0.05, "{noise:?}");
    assert!((noise[0] / noise[1] - 2.0).abs() < 0.1, "{noise:?}");
    assert_eq!(Film::new(2, 2, &[]).unwrap().noise(), f32::INFINITY);
}

#[test]
fn what_cannot_be_continued_is_said() {
    let film = Film::new(4, 4, &specs()).unwrap();
    let mut saved = film.to_layers(Precision::Float, true);
    let more = [specs(), vec![AovSpec::new("depth", &["Z"], AovMode::Mean, Precision::Float)]];
    let text = Film::from_layers(&saved, &more.concat()).unwrap_err().to_string();
    assert!(text.contains("rayburst.accumulator.aov.depth.Z.hi"), "{text}");
    let count = saved.layers.iter_mut().find(|l| l.name.ends_with("count")).unwrap();
    count.channels[0].values[5] = 1.5;
    let text = Film::from_layers(&saved, &specs()).unwrap_err().to_string();
    assert!(text.contains("is 1.5 at pixel (1, 1)"), "{text}");
    assert!(Film::from_layers(&film.to_layers(Precision::Float, false), &specs()).is_err());
}

#[test]
fn impossible_sizes_are_refused_and_cost_nothing() {
    assert!(Film::new(0, 4, &[]).is_err());
    assert!(Film::new(100_000, 100_000, &[]).is_err());
    assert!(matches!(Film::new(16_384, 16_384, &[]), Err(ImageError::TooManyBytes { .. })));
}
