//! Minimising a function of a few variables without derivatives.
//!
//! Nelder, Mead: "A Simplex Method for Function Minimization", Computer Journal 1965, with the usual
//! coefficients.

/// Stops after so many evaluations.
const MAX_EVALUATIONS: u32 = 600;
/// Stops when the values at the corners differ by less, relative to the best.
const TOLERANCE: f64 = 1e-9;

/// A minimum of `f` near `start`, and the value there; `step` is the size of the first simplex.
pub(super) fn minimise<const N: usize>(
    f: impl Fn(&[f64; N]) -> f64,
    start: [f64; N],
    step: f64,
) -> ([f64; N], f64) {
    let mut corners: Vec<([f64; N], f64)> = Vec::with_capacity(N + 1);
    corners.push((start, f(&start)));
    for i in 0..N {
        let mut corner = start;
        corner[i] += step;
        corners.push((corner, f(&corner)));
    }
    let mut evaluations = N as u32 + 1;
    while evaluations < MAX_EVALUATIONS {
        corners.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (best, worst) = (corners[0].1, corners[N].1);
        if worst - best <= TOLERANCE * best.abs() {
            break;
        }
        let mut centre = [0.0; N];
        for (corner, _) in &corners[..N] {
            for i in 0..N {
                centre[i] += corner[i] / N as f64;
            }
        }
        let from_worst = |t: f64| {
            let p: [f64; N] =
                std::array::from_fn(|i| centre[i] + t * (corners[N].0[i] - centre[i]));
            (p, f(&p))
        };
        let reflected = from_worst(-1.0);
        evaluations += 1;
        let next = if reflected.1 < best {
            evaluations += 1;
            let expanded = from_worst(-2.0);
            Some(if expanded.1 < reflected.1 { expanded } else { reflected })
        } else if reflected.1 < corners[N - 1].1 {
            Some(reflected)
        } else {
            evaluations += 1;
            let (t, bound) = if reflected.1 < worst { (-0.5, reflected.1) } else { (0.5, worst) };
            Some(from_worst(t)).filter(|p| p.1 < bound)
        };
        match next {
            Some(corner) => corners[N] = corner,
            None => {
                let towards = corners[0].0;
                for corner in &mut corners[1..] {
                    corner.0 = std::array::from_fn(|i| 0.5 * (corner.0[i] + towards[i]));
                    corner.1 = f(&corner.0);
                }
                evaluations += N as u32;
            }
        }
    }
    corners.sort_by(|a, b| a.1.total_cmp(&b.1));
    corners[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        // Rosenbrock's function.
        let f = |p: &[f64; 2]| (1.0 - p[0]).powi(2) + 100.0 * (p[1] - p[0] * p[0]).powi(2);
        let (p, value) = minimise(f, [-1.2, 1.0], 0.5);
        assert!(value < 1e-12 && (p[0] - 1.0).abs() < 1e-5 && (p[1] - 1.0).abs() < 1e-5, "{p:?}");
    }
}
