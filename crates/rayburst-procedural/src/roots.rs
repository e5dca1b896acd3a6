//! Where a function along a line changes its sign, given a quartic with the same roots and others.
//!
//! Yuksel: "High-Performance Polynomial Root Finding for Graphics", HPG 2022: the roots of the
//! derivative part an interval into pieces in which the polynomial is monotone and has at most one
//! root, which Newton's iteration finds and bisection keeps within bounds. All roots are found at
//! which the sign changes, also those close together, as the extremum between them is known.

/// A polynomial by increasing powers.
type Polynomial<const N: usize> = [f64; N];

/// At most four places on a line, increasing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Roots {
    roots: [f64; 4],
    len: usize,
}

impl Roots {
    const NONE: Self = Self { roots: [0.0; 4], len: 0 };

    fn push(&mut self, root: f64) {
        if self.len < 4 {
            self.roots[self.len] = root;
            self.len += 1;
        }
    }

    pub(crate) fn as_slice(&self) -> &[f64] {
        &self.roots[..self.len]
    }
}

/// Where the sign of a cubic changes in `lo < x < hi`: the extrema of a quartic, of which it is the
/// derivative.
pub(crate) fn cubic_roots(cubic: &Polynomial<4>, lo: f64, hi: f64) -> Roots {
    let turning = quadratic_roots(&[cubic[1], 2.0 * cubic[2], 3.0 * cubic[3]], lo, hi);
    let (first, last) = (value(cubic, lo) < 0.0, value(cubic, hi) < 0.0);
    sign_changes(|x| value_and_slope(cubic, x), lo, hi, &turning, first, last)
}

/// Where a function changes its sign in `lo < x < hi`. There is at most one such place between
/// neighbours among the ends and `parting`. The function gives its value and its slope, and
/// `first` and `last` say whether it counts as negative at the ends; where both are the same there is an
/// even number of changes.
pub(crate) fn sign_changes(
    function: impl Fn(f64) -> (f64, f64),
    lo: f64,
    hi: f64,
    parting: &Roots,
    first: bool,
    last: bool,
) -> Roots {
    let mut roots = Roots::NONE;
    let (mut x, mut negative) = (lo, first);
    for &next in parting.as_slice() {
        let next_negative = function(next).0 < 0.0;
        if next_negative != negative {
            roots.push(root_between(&function, x, next, negative));
        }
        (x, negative) = (next, next_negative);
    }
    if last != negative {
        roots.push(root_between(&function, x, hi, negative));
    }
    roots
}

/// The root between `lo`, where the function is negative or not, and `hi`, where it is otherwise.
fn root_between(
    function: impl Fn(f64) -> (f64, f64),
    mut lo: f64,
    mut hi: f64,
    negative: bool,
) -> f64 {
    let mut x = 0.5 * (lo + hi);
    // Newton's iteration takes few of them; bisection alone would take as many as bits.
    for _ in 0..100 {
        let (f, slope) = function(x);
        if (f < 0.0) == negative {
            lo = x;
        } else {
            hi = x;
        }
        let newton = x - f / slope;
        // Not a number is not between the two.
        let next = if lo <= newton && newton <= hi { newton } else { 0.5 * (lo + hi) };
        if (next - x).abs() <= 4.0 * f64::EPSILON * x.abs() {
            return next;
        }
        x = next;
    }
    x
}

fn value<const N: usize>(polynomial: &Polynomial<N>, x: f64) -> f64 {
    polynomial.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

fn value_and_slope<const N: usize>(polynomial: &Polynomial<N>, x: f64) -> (f64, f64) {
    polynomial.iter().rev().fold((0.0, 0.0), |(sum, slope), c| (sum * x + c, slope * x + sum))
}

/// Both roots of a quadratic in `lo < x < hi`, without cancellation.
fn quadratic_roots(&[c, b, a]: &Polynomial<3>, lo: f64, hi: f64) -> Roots {
    let mut roots = Roots::NONE;
    let discriminant = 0.25 * b * b - a * c;
    if discriminant > 0.0 {
        let q = -(0.5 * b + discriminant.sqrt().copysign(b));
        let (one, other) = (q / a, c / q);
        for root in [one.min(other), one.max(other)] {
            if lo < root && root < hi {
                roots.push(root);
            }
        }
    }
    roots
}

#[cfg(test)]
mod tests {
    use rayburst_math::hash::Rng;

    use super::*;

    /// (x − a)(x − b)(x − c)(x − d) by increasing powers.
    fn with_roots(roots: [f64; 4]) -> Polynomial<5> {
        let mut polynomial = [1.0, 0.0, 0.0, 0.0, 0.0];
        for (degree, root) in roots.into_iter().enumerate() {
            for power in (0..=degree + 1).rev() {
                let lower = if power > 0 { polynomial[power - 1] } else { 0.0 };
                polynomial[power] = lower - root * polynomial[power];
            }
        }
        polynomial
    }

    fn negative_between(quartic: &Polynomial<5>, lo: f64, hi: f64) -> Roots {
        let cubic = std::array::from_fn(|i| (i + 1) as f64 * quartic[i + 1]);
        let extrema = cubic_roots(&cubic, lo, hi);
        sign_changes(|x| value_and_slope(quartic, x), lo, hi, &extrema, false, false)
    }

    #[test]
    fn known_roots_are_found() {
        let mut rng = Rng::new(1);
        for _ in 0..100_000 {
            let gaps: [f64; 4] =
                std::array::from_fn(|_| 10.0f64.powf(f64::from(rng.range(-3.0, 0.0))));
            let mut roots = [-1.5 + gaps[0]; 4];
            for i in 1..4 {
                roots[i] = roots[i - 1] + gaps[i];
            }
            let found = negative_between(&with_roots(roots), -2.0, 4.0);
            assert_eq!(found.as_slice().len(), 4, "{roots:?}");
            for (i, (found, root)) in found.as_slice().iter().zip(roots).enumerate() {
                let slope: f64 =
                    (0..4).filter(|j| *j != i).map(|j| (root - roots[j]).abs()).product();
                assert!((found - root).abs() < 1e-13 / slope, "{found} for {root} of {roots:?}");
            }
        }
    }

    #[test]
    fn roots_outside_the_interval_are_left_out() {
        let quartic = with_roots([-3.0, -2.0, 1.0, 2.0]);
        assert_eq!(negative_between(&quartic, -1.0, 3.0).as_slice().len(), 2);
        assert_eq!(negative_between(&quartic, -1.0, 0.5).as_slice().len(), 0);
    }

    #[test]
    fn not_a_number_ends() {
        let found = negative_between(&[f64::NAN; 5], -1.0, 1.0);
        assert!(found.as_slice().is_empty());
    }
}
