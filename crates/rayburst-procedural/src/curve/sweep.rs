//! Where a line is inside the solid that a ball sweeps.
//!
//! After van Wijk: "Ray Tracing Objects Defined by Sweeping a Sphere" (1985). The ball at parameter `u`
//! holds the line between `z(u) - √D(u)` and `z(u) + √D(u)`, where `z` is the place on the line nearest
//! to the centre and `D` the squared radius less the squared distance from the line, here a polynomial
//! of degree 6. Where `D ≥ 0` over some stretch of `u`, those intervals change continuously and together
//! cover one interval, from the least `z - √D` to the largest `z + √D`, which are where `4 z'² D = D'²`,
//! of degree 10, or at the stretch's ends.

use std::ops::ControlFlow;

use glam::DVec3;

use crate::bernstein::{derivative, product, value, zeros};
use crate::segment::Segment;

/// A part of the line inside the solid: the place on the line and the parameter of the ball, for both
/// ends.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stretch {
    pub(super) enter: (f64, f64),
    pub(super) leave: (f64, f64),
}

/// A polynomial of degree 6 is positive on no more stretches.
const MOST: usize = 4;

#[derive(Default)]
pub(super) struct Stretches {
    all: [Stretch; MOST],
    count: usize,
}

impl Stretches {
    pub(super) fn iter(&self) -> impl Iterator<Item = &Stretch> {
        self.all[..self.count].iter()
    }

    fn insert(&mut self, stretch: Stretch) {
        if self.count < MOST {
            self.all[self.count] = stretch;
            self.count += 1;
        }
    }

    /// Puts them in order and joins those that overlap.
    fn join(&mut self) {
        let all = &mut self.all[..self.count];
        all.sort_unstable_by(|a, b| a.enter.0.total_cmp(&b.enter.0));
        let mut count = 0;
        for i in 0..all.len() {
            let next = all[i];
            if count > 0 && next.enter.0 <= all[count - 1].leave.0 {
                if next.leave.0 > all[count - 1].leave.0 {
                    all[count - 1].leave = next.leave;
                }
            } else {
                all[count] = next;
                count += 1;
            }
        }
        self.count = count;
    }
}

/// Parameters in increasing order.
struct Places<const N: usize> {
    all: [f64; N],
    count: usize,
}

impl<const N: usize> Places<N> {
    fn new() -> Self {
        Self { all: [0.0; N], count: 0 }
    }

    fn add_zeros<const M: usize>(&mut self, polynomial: &[f64; M]) {
        let _ = zeros(polynomial, &mut |u| {
            self.push(u);
            ControlFlow::Continue(())
        });
    }

    fn push(&mut self, u: f64) {
        if self.count < N {
            self.all[self.count] = u;
            self.count += 1;
        }
    }

    fn as_slice(&self) -> &[f64] {
        &self.all[..self.count]
    }
}

/// The parts of the whole line inside the solid, in order and apart.
pub(super) fn stretches(points: &[DVec3; 4], radii: [f64; 2], segment: &Segment) -> Stretches {
    let mut found = Stretches::default();
    let (x, y) = segment.direction.any_orthonormal_pair();
    let along = |axis: DVec3| points.map(|p| (p - segment.origin).dot(axis));
    let (x, y, z) = (along(x), along(y), along(segment.direction));
    let radius: [f64; 4] =
        std::array::from_fn(|i| radii[0] + (radii[1] - radii[0]) * i as f64 / 3.0);
    let square = |p: &[f64; 4]| -> [f64; 7] { product(p, p) };
    let (xx, yy, rr) = (square(&x), square(&y), square(&radius));
    let depth: [f64; 7] = std::array::from_fn(|i| rr[i] - xx[i] - yy[i]);
    if depth.iter().all(|&d| d < 0.0) {
        return found;
    }

    let slope: [f64; 6] = derivative(&depth);
    let z_slope: [f64; 3] = derivative(&z);
    let z_slope_squared: [f64; 5] = product(&z_slope, &z_slope);
    let (left, right): ([f64; 11], [f64; 11]) =
        (product(&z_slope_squared, &depth), product(&slope, &slope));
    let turn: [f64; 11] = std::array::from_fn(|i| 4.0 * left[i] - right[i]);
    let mut turns = Places::<16>::new();
    turns.add_zeros(&turn);
    // Where the curve is across the line both ends turn in the same place, which is then a double zero.
    turns.add_zeros(&slope);

    let mut borders = Places::<8>::new();
    borders.push(0.0);
    borders.add_zeros(&depth);
    borders.push(1.0);
    for pair in borders.as_slice().windows(2) {
        let (from, to) = (pair[0], pair[1]);
        if value(depth, 0.5 * (from + to)) <= 0.0 {
            continue;
        }
        let mut stretch =
            Stretch { enter: (f64::INFINITY, from), leave: (f64::NEG_INFINITY, from) };
        let inside = turns.as_slice().iter().copied().filter(|&u| from < u && u < to);
        for u in [from, to].into_iter().chain(inside) {
            let (middle, half) = (value(z, u), value(depth, u).max(0.0).sqrt());
            if middle - half < stretch.enter.0 {
                stretch.enter = (middle - half, u);
            }
            if middle + half > stretch.leave.0 {
                stretch.leave = (middle + half, u);
            }
        }
        found.insert(stretch);
    }
    found.join();
    found
}
