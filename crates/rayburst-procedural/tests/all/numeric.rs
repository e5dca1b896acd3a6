//! Zeros of functions of which only a bound on the slope is known.

/// All places in an interval where `f` changes its sign, in increasing order, but for pairs nearer to
/// each other than `width`: intervals are halved until the values at their ends are too far from zero
/// for `slope`, the largest slope, or until they are that narrow. Then bisection.
pub(crate) fn sign_changes(
    f: &dyn Fn(f64) -> f64,
    (a, b): (f64, f64),
    slope: f64,
    width: f64,
    found: &mut Vec<f64>,
) {
    refine(f, (a, f(a)), (b, f(b)), slope, width, found);
}

fn refine(
    f: &dyn Fn(f64) -> f64,
    (mut a, fa): (f64, f64),
    (mut b, fb): (f64, f64),
    slope: f64,
    width: f64,
    found: &mut Vec<f64>,
) {
    if fa * fb > 0.0 && fa.abs() + fb.abs() > slope * (b - a) {
        return;
    }
    let middle = 0.5 * (a + b);
    if b - a > width {
        let at_middle = (middle, f(middle));
        refine(f, (a, fa), at_middle, slope, width, found);
        refine(f, at_middle, (b, fb), slope, width, found);
    } else if (fa < 0.0) != (fb < 0.0) {
        for _ in 0..50 {
            let middle = 0.5 * (a + b);
            if (f(middle) < 0.0) == (fa < 0.0) {
                a = middle;
            } else {
                b = middle;
            }
        }
        found.push(0.5 * (a + b));
    }
}
