//! Variance in one pass is the variance of two.

use rayburst_denoise::{RunningVariance, VariancePlane, blend_variance};

use crate::frames::{plane, random};

fn two_pass(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let sum: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, sum / values.len() as f64)
}

#[test]
fn one_pass_equals_two_even_for_large_means() {
    let mut random = random(2);
    for mean in [0.0, 1.0, 1e4, 1e8] {
        let values: Vec<_> = (0..5000).map(|_| mean + f64::from(random.f32())).collect();
        let (expected_mean, expected) = two_pass(&values);
        let mut run = RunningVariance::new();
        values.iter().for_each(|&value| run.push(value));
        run.push(f64::NAN);
        run.push(f64::INFINITY);
        assert_eq!(run.count(), 5000);
        assert!((run.mean() - expected_mean).abs() <= 1e-12 * expected_mean);
        assert!((run.population() / expected - 1.0).abs() < 1e-6, "{mean}");
        assert!((run.sample() / expected * 4999.0 / 5000.0 - 1.0).abs() < 1e-6);
        assert!((run.of_mean() / expected * 4999.0 - 1.0).abs() < 1e-6);
        for cut in [0, 1, 1234, 5000] {
            let (mut a, mut b) = (RunningVariance::new(), RunningVariance::new());
            values[..cut].iter().for_each(|&value| a.push(value));
            values[cut..].iter().for_each(|&value| b.push(value));
            a.merge(&b);
            assert_eq!(a.count(), 5000);
            assert!((a.population() / expected - 1.0).abs() < 1e-6);
        }
    }
    let empty = RunningVariance::new();
    assert_eq!((empty.mean(), empty.population(), empty.of_mean()), (0.0, 0.0, 0.0));
}

#[test]
fn the_exponential_form_weighs_as_alpha_says() {
    // With one over the count it is the plain variance, in single precision, too.
    let mut random = random(3);
    for offset in [0.0f32, 1000.0] {
        let values: Vec<_> = (0..300).map(|_| offset + random.f32()).collect();
        let wide: Vec<_> = values.iter().map(|&v| f64::from(v)).collect();
        let (mean, variance) = two_pass(&wide);
        let mut state = (0.0, 0.0);
        for (i, &value) in values.iter().enumerate() {
            state = blend_variance(state.0, state.1, value, 1.0 / (i + 1) as f32);
        }
        assert!((f64::from(state.0) / mean - 1.0).abs() < 1e-6);
        assert!(
            (f64::from(state.1) / variance - 1.0).abs() < if offset == 0.0 { 1e-5 } else { 2e-3 }
        );
    }
    // With a fixed one it is that of weights that fall by a fixed factor.
    let (alpha, values) = (0.2f64, [3.0f64, 5.0, -1.0, 2.5]);
    let mut state = (values[0] as f32, 0.0);
    for &value in &values[1..] {
        state = blend_variance(state.0, state.1, value as f32, alpha as f32);
    }
    let keep = 1.0 - alpha;
    let weights = [keep.powi(3), alpha * keep.powi(2), alpha * keep, alpha];
    let mean: f64 = weights.iter().zip(values).map(|(w, v)| w * v).sum();
    let squares = weights.iter().zip(values).map(|(w, v)| w * (v - mean) * (v - mean));
    assert!((f64::from(state.0) - mean).abs() < 1e-5);
    assert!((f64::from(state.1) - squares.sum::<f64>()).abs() < 1e-5);
}

#[test]
fn planes_keep_a_run_for_every_pixel() {
    let mut a = VariancePlane::new(5, 3).unwrap();
    let mut b = a.clone();
    a.push(&plane(5, 3, |x, _| x as f32)).unwrap();
    b.push(&plane(5, 3, |x, y| (x + 2 * y) as f32)).unwrap();
    a.merge(&b).unwrap();
    assert_eq!(a.get(4, 2).mean(), 6.0);
    assert_eq!(a.get(4, 2).population(), 4.0);
    assert!(a.push(&plane(4, 3, |_, _| 0.0)).is_err());
    assert!(a.merge(&VariancePlane::new(5, 4).unwrap()).is_err());
}
