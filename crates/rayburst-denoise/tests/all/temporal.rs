//! Accumulation over time.

use rayburst_denoise::{Accumulation, Reprojection, RunningVariance, SurfaceTests, Temporal};
use rayburst_image::Plane;

use crate::frames::{Frame, plane, random};

const MEAN: Accumulation = Accumulation { alpha: 0.0, measure_alpha: 0.0, longest: 65536.0 };

#[test]
fn a_camera_at_rest_gets_the_mean_and_the_variance_of_all_samples() {
    let (w, h) = (19, 5);
    let frame = Frame::wall(w, h);
    let (mut reprojection, mut temporal) = (Reprojection::new(), Temporal::<1>::new());
    let mut runs = vec![RunningVariance::new(); (w * h) as usize];
    let mut random = random(1);
    for n in 1..=100 {
        let samples = plane(w, h, |_, _| 50.0 + 10.0 * random.f32());
        for y in 0..h {
            for x in 0..w {
                runs[(y * w + x) as usize].push(f64::from(samples.get(x, y)));
            }
        }
        let taps = reprojection.advance(&frame.guides(), &SurfaceTests::default()).unwrap();
        temporal.accumulate(taps, [&samples], [1.0], None, &MEAN).unwrap();
        for y in 0..h {
            for x in 0..w as usize {
                let run = &runs[y as usize * w as usize + x];
                assert!((f64::from(temporal.row(0, y)[x]) / run.mean() - 1.0).abs() < 1e-5);
                assert_eq!(temporal.row(0, y)[x], temporal.mean_row(y)[x]);
                let variance = f64::from(temporal.variance_row(y)[x]);
                assert!((variance - run.population()).abs() < 1e-4 * (1.0 + run.population()));
                assert_eq!(temporal.length_row(y)[x], n as f32);
            }
        }
    }
}

#[test]
fn old_samples_are_forgotten_as_alpha_says() {
    let frame = Frame::wall(8, 2);
    let (mut reprojection, mut temporal) = (Reprojection::new(), Temporal::<1>::new());
    let settings = Accumulation { alpha: 0.25, measure_alpha: 0.5, longest: 3.0 };
    let mut step = |temporal: &mut Temporal<1>, value: f32, change: Option<f32>| {
        let samples = plane(8, 2, |_, _| value);
        let change = change.map(|change| plane(8, 2, |_, _| change));
        let taps = reprojection.advance(&frame.guides(), &SurfaceTests::default()).unwrap();
        temporal.accumulate(taps, [&samples], [1.0], change.as_ref(), &settings).unwrap();
        (temporal.row(0, 1)[3], temporal.mean_row(1)[3], temporal.length_row(1)[3])
    };
    assert_eq!(step(&mut temporal, 8.0, None), (8.0, 8.0, 1.0));
    assert_eq!(step(&mut temporal, 0.0, None), (4.0, 4.0, 2.0));
    assert_eq!(step(&mut temporal, 4.0, None), (4.0, 4.0, 3.0));
    // No history counts for more than three frames.
    let (value, mean, length) = step(&mut temporal, 1.0, None);
    assert!((value - 3.0).abs() < 1e-6 && mean == 2.5 && length == 3.0);
    // Where half of the history is no longer true, the new sample weighs more, and the history less.
    let (value, _, length) = step(&mut temporal, 11.0, Some(0.5));
    assert!((value - 8.0).abs() < 1e-5 && length == 2.5, "{value} {length}");
    for change in [1.0, 7.0, f32::INFINITY, f32::NAN] {
        step(&mut temporal, 1e16, None);
        assert_eq!(step(&mut temporal, 100.0, Some(change)), (100.0, 100.0, 1.0));
    }
    temporal.reset();
    assert_eq!(step(&mut temporal, 5.0, Some(0.0)), (5.0, 5.0, 1.0));
}

#[test]
fn samples_that_are_not_finite_never_enter_a_history() {
    let frame = Frame::wall(4, 1);
    let (mut reprojection, mut temporal) = (Reprojection::new(), Temporal::<3>::new());
    let good = plane(4, 1, |_, _| 2.0);
    let mut bad = good.clone();
    bad.row_mut(0).copy_from_slice(&[f32::NAN, f32::INFINITY, 3e38, -f32::INFINITY]);
    for (i, first) in [&bad, &good, &bad, &good].into_iter().enumerate() {
        let taps = reprojection.advance(&frame.guides(), &SurfaceTests::default()).unwrap();
        let measure = [0.5, 0.25, 0.25];
        temporal.accumulate(taps, [first, &good, &good], measure, None, &MEAN).unwrap();
        for x in [0, 1, 3] {
            // Bad samples count for nothing: the first leaves no history at all.
            assert_eq!(temporal.length_row(0)[x], [0.0, 1.0, 1.0, 2.0][i]);
            assert_eq!(temporal.row(0, 0)[x], if i == 0 { 0.0 } else { 2.0 });
            assert_eq!(temporal.mean_row(0)[x], if i == 0 { 0.0 } else { 2.0 });
            assert_eq!(temporal.variance_row(0)[x], 0.0);
        }
        assert!(temporal.row(0, 0)[2].is_finite() && temporal.variance_row(0)[2].is_finite());
    }
    let small = Plane::new(3, 1).unwrap();
    let taps = reprojection.taps();
    assert!(temporal.accumulate(taps, [&good, &good, &small], [1.0; 3], None, &MEAN).is_err());
    for settings in [
        Accumulation { alpha: -0.1, ..MEAN },
        Accumulation { measure_alpha: f32::NAN, ..MEAN },
        Accumulation { longest: 0.5, ..MEAN },
    ] {
        let result = temporal.accumulate(taps, [&good; 3], [1.0; 3], None, &settings);
        assert!(result.is_err());
    }
}
