//! Polynomials by their Bernstein coefficients, and where they change sign.
//!
//! A polynomial changes sign no more often than its Bernstein coefficients do (Descartes' rule; see
//! Farouki: "The Bernstein Polynomial Basis: A Centennial Retrospective", 2012), which isolates zeros
//! when intervals are halved: Lane, Riesenfeld: "Bounds on a Polynomial" (1981).

use std::ops::ControlFlow;

use crate::root;

/// Intervals are halved no further than this: zeros that are nearer to each other than 2⁻⁴⁰ of the
/// interval count as one, or as none if their number is even.
const DEPTH: u32 = 40;

/// Zeros are found to within this part of the interval.
const TOLERANCE: f64 = 1e-15;

/// The value at `x`, by de Casteljau's algorithm.
pub(crate) fn value<const N: usize>(mut b: [f64; N], x: f64) -> f64 {
    for n in (1..N).rev() {
        for i in 0..n {
            b[i] += x * (b[i + 1] - b[i]);
        }
    }
    b[0]
}

const fn binomial(n: usize, k: usize) -> f64 {
    let (mut value, mut i) = (1.0, 0);
    while i < k {
        value = value * (n - i) as f64 / (i + 1) as f64;
        i += 1;
    }
    value
}

/// The product of two polynomials; it has one coefficient fewer than both together.
pub(crate) fn product<const A: usize, const B: usize, const C: usize>(
    a: &[f64; A],
    b: &[f64; B],
) -> [f64; C] {
    const { assert!(A + B == C + 1) };
    let mut sums = [0.0; C];
    for i in 0..A {
        for j in 0..B {
            sums[i + j] += binomial(A - 1, i) * a[i] * (binomial(B - 1, j) * b[j]);
        }
    }
    std::array::from_fn(|k| sums[k] / binomial(C - 1, k))
}

/// The derivative; it has one coefficient fewer.
pub(crate) fn derivative<const A: usize, const B: usize>(a: &[f64; A]) -> [f64; B] {
    const { assert!(A == B + 1) };
    std::array::from_fn(|i| (A - 1) as f64 * (a[i + 1] - a[i]))
}

/// The coefficients of both halves.
fn halves<const N: usize>(b: &[f64; N]) -> ([f64; N], [f64; N]) {
    let (mut left, mut right) = (*b, *b);
    for n in (1..N).rev() {
        left[N - 1 - n] = right[0];
        for i in 0..n {
            right[i] = 0.5 * (right[i] + right[i + 1]);
        }
    }
    left[N - 1] = right[0];
    (left, right)
}

fn sign_changes<const N: usize>(b: &[f64; N]) -> u32 {
    let (mut changes, mut last) = (0, 0.0);
    for &c in b {
        if c != 0.0 {
            changes += u32::from(last * c.signum() < 0.0);
            last = c.signum();
        }
    }
    changes
}

/// Gives the zeros in (0, 1] in increasing order. One at 0 is not given: it is the end of what came
/// before. Zeros without a change of sign are given only where a value comes out as exactly zero.
pub(crate) fn zeros<const N: usize>(
    b: &[f64; N],
    report: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> ControlFlow<()> {
    if b.iter().all(|&c| c == 0.0) || b.iter().any(|c| !c.is_finite()) {
        return ControlFlow::Continue(());
    }
    isolate(b, 0.0, 1.0, DEPTH, report)
}

fn isolate<const N: usize>(
    b: &[f64; N],
    from: f64,
    width: f64,
    depth: u32,
    report: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let (first, last) = (b[0], b[N - 1]);
    match sign_changes(b) {
        0 if last == 0.0 => report(from + width),
        0 => ControlFlow::Continue(()),
        1 if first != 0.0 && last != 0.0 => {
            let x = root::between(|x| value(*b, x), (0.0, first), (1.0, last), TOLERANCE / width);
            report(from + width * x)
        }
        _ if depth == 0 => {
            if last == 0.0 || first * last < 0.0 {
                report(from + width)
            } else {
                ControlFlow::Continue(())
            }
        }
        _ => {
            let (left, right) = halves(b);
            isolate(&left, from, 0.5 * width, depth - 1, report)?;
            isolate(&right, from + 0.5 * width, 0.5 * width, depth - 1, report)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{derivative, product, value, zeros};
    use std::ops::ControlFlow;

    /// Bernstein coefficients of the product of (x - root).
    fn with_roots(roots: [f64; 4]) -> [f64; 5] {
        let mut scaled = vec![1.0];
        for root in roots {
            let mut next = vec![0.0; scaled.len() + 1];
            for (i, c) in scaled.iter().enumerate() {
                next[i] += -root * c;
                next[i + 1] += (1.0 - root) * c;
            }
            scaled = next;
        }
        std::array::from_fn(|i| scaled[i] / super::binomial(4, i))
    }

    fn found(b: [f64; 5]) -> Vec<f64> {
        let mut found = Vec::new();
        let _ = zeros(&b, &mut |x| {
            found.push(x);
            ControlFlow::Continue(())
        });
        found
    }

    #[test]
    fn all_zeros_are_found_in_order() {
        for roots in [
            [0.1, 0.2, 0.3, 0.4],
            [0.5, 0.25, 0.75, 1.0],
            [0.3, 0.300001, 0.9, 0.900001],
            [-1.0, 0.5, 2.0, 3.0],
            [0.0, 0.4, 0.6, 1.0],
        ] {
            let b = with_roots(roots);
            let mut expected: Vec<f64> =
                roots.into_iter().filter(|&x| x > 0.0 && x <= 1.0).collect();
            expected.sort_by(f64::total_cmp);
            let found = found(b);
            assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
            for (a, b) in found.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-8, "{found:?} {expected:?}");
            }
            for x in found {
                assert!(value(b, x).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn products_and_derivatives() {
        let (a, b) = ([0.3, -1.0, 2.0, 0.7], [1.5, 0.2, -0.4]);
        let ab: [f64; 6] = product(&a, &b);
        let da: [f64; 3] = derivative(&a);
        for x in [0.0, 0.3, 0.5, 0.9, 1.0] {
            assert!((value(ab, x) - value(a, x) * value(b, x)).abs() < 1e-14);
            let difference = (value(a, x + 1e-5) - value(a, x - 1e-5)) / 2e-5;
            assert!((value(da, x) - difference).abs() < 1e-8);
        }
    }

    #[test]
    fn even_zeros_without_a_change_of_sign_are_few() {
        assert!(found(with_roots([0.3, 0.3, 0.7, 0.7])).len() <= 2);
        assert_eq!(found([0.0; 5]), []);
        assert_eq!(found([f64::NAN; 5]), []);
        // Three together are one.
        assert_eq!(found(with_roots([0.3, 0.3, 0.3, 2.0])).len(), 1);
    }
}
