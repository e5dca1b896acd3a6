//! The plain weighted average.

use rayburst_denoise::{Window, weighted_average};
use rayburst_image::Plane;

use crate::frames::plane;

#[test]
fn constants_stay_and_weights_are_normalised() {
    let picture = plane(9, 5, |_, _| 3.0);
    for (radius, step) in [(0, 1), (2, 1), (2, 3), (7, 0)] {
        let window = Window { radius, step };
        let out = weighted_average(&[&picture], window, |(x, y), tap| {
            f64::from(1 + (x + 3 * y + 5 * tap.x + 7 * tap.y) % 4)
        })
        .unwrap();
        assert!((0..5).all(|y| out.row(y).iter().all(|v| (v - 3.0).abs() < 1e-6)));
    }
}

#[test]
fn windows_reach_as_far_as_they_say_and_frames_before_count_too() {
    let now = plane(7, 7, |x, y| if (x, y) == (3, 3) { 1.0 } else { 0.0 });
    let window = Window { radius: 1, step: 2 };
    let out = weighted_average(&[&now], window, |_, _| 1.0).unwrap();
    for y in 0..7u32 {
        for x in 0..7u32 {
            // At a distance of one from the side, a tap of three is outside.
            let share = |x: u32| [0.0, 0.5, 0.0, 1.0 / 3.0, 0.0, 0.5, 0.0][x as usize];
            assert!((out.get(x, y) - share(x) * share(y)).abs() < 1e-7, "{x} {y}");
        }
    }
    let before = plane(7, 7, |_, _| 8.0);
    let window = Window { radius: 0, step: 1 };
    let weight = |_, tap: rayburst_denoise::Tap| [3.0, 1.0][tap.frame];
    let out = weighted_average(&[&now, &before], window, weight).unwrap();
    assert_eq!(out.get(3, 3), (3.0 + 8.0) / 4.0);
}

#[test]
fn bad_values_and_weights_count_for_nothing() {
    let mut picture = plane(3, 1, |_, _| 2.0);
    picture.set(0, 0, f32::NAN);
    picture.set(2, 0, f32::INFINITY);
    let window = Window { radius: 2, step: 1 };
    let out = weighted_average(&[&picture], window, |_, _| 1.0).unwrap();
    assert_eq!(out.row(0), [2.0; 3]);
    for weight in [0.0, -1.0, f64::NAN] {
        let out = weighted_average(&[&picture], window, |_, _| weight).unwrap();
        assert_eq!(out.row(0), [0.0; 3]);
    }
    let other = Plane::new(2, 1).unwrap();
    assert!(weighted_average(&[&picture, &other], window, |_, _| 1.0).is_err());
    assert_eq!(weighted_average(&[], window, |_, _| 1.0).unwrap().size(), (0, 0));
}
