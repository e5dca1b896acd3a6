//! The zero of a function between two places where its signs differ.

/// The zero between `a` and `b`, where the function is `fa` and `fb` with different signs, to within
/// `tolerance`. Always ends, whatever the function gives.
///
/// Chandrupatla: "A New Hybrid Quadratic/Bisection Algorithm for Finding the Zero of a Nonlinear
/// Function without Using Derivatives" (1997): the inverse quadratic through the last three places
/// where it is monotone, half the interval otherwise.
pub(crate) fn between(
    mut f: impl FnMut(f64) -> f64,
    (mut a, mut fa): (f64, f64),
    (mut b, mut fb): (f64, f64),
    tolerance: f64,
) -> f64 {
    let mut fraction = 0.5;
    for _ in 0..128 {
        let x = a + fraction * (b - a);
        let fx = f(x);
        let (c, fc);
        if (fx > 0.0) == (fa > 0.0) {
            (c, fc) = (a, fa);
        } else {
            (c, fc) = (b, fb);
            (b, fb) = (a, fa);
        }
        (a, fa) = (x, fx);

        let (best, at_best) = if fa.abs() < fb.abs() { (a, fa) } else { (b, fb) };
        let near = (2.0 * f64::EPSILON * best.abs() + 0.5 * tolerance) / (b - a).abs();
        if near > 0.5 || at_best == 0.0 || near.is_nan() {
            return best;
        }
        let xi = (a - b) / (c - b);
        let phi = (fa - fb) / (fc - fb);
        fraction = if phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
            fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        } else {
            0.5
        };
        fraction = if fraction.is_nan() { 0.5 } else { fraction.clamp(near, 1.0 - near) };
    }
    if fa.abs() < fb.abs() { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::between;

    #[test]
    fn zeros_are_found_in_few_steps() {
        type Case = (fn(f64) -> f64, f64, f64, f64);
        let cases: [Case; 4] = [
            (|x| x * x - 2.0, 0.0, 2.0, 2f64.sqrt()),
            (|x| x.powi(9), -1.0, 0.7, 0.0),
            (|x| if x < 0.3 { -1.0 } else { 1.0 }, 0.0, 1.0, 0.3),
            (|x| 1e-9 - x, 0.0, 1e9, 1e-9),
        ];
        for (f, a, b, zero) in cases {
            let mut calls = 0;
            let g = |x| {
                calls += 1;
                f(x)
            };
            let found = between(g, (a, f(a)), (b, f(b)), 1e-12);
            assert!((found - zero).abs() < 1e-11, "{found} {zero}");
            assert!(calls < 100, "{calls}");
        }
    }

    #[test]
    fn nonsense_ends() {
        between(|_| f64::NAN, (0.0, -1.0), (1.0, 1.0), 0.0);
        between(|_| 1.0, (0.0, 1.0), (0.0, 1.0), 0.0);
    }
}
