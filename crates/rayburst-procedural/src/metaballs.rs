//! Metaballs: where the sum of smooth balls reaches a threshold.
//!
//! Balls with a density that ends are the soft objects of Wyvill, McPheeters, Wyvill: "Data Structure
//! for Soft Objects" (1986); the density `(1 - r²)³` is from Bloomenthal (ed.): "Introduction to
//! Implicit Surfaces" (1997). Along a ray it is a polynomial of degree 6 between where the ray enters
//! the ball and leaves it, so that between two such places the sum is one too, whose zeros are isolated
//! (the method of Nishita, Nakamae: "A Method for Displaying Metaballs by Using Bézier Clipping", 1994,
//! with halving in place of clipping).

use std::ops::ControlFlow;

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

use crate::segment::{Segment, padded};
use crate::{Shape, ShapeHit, bernstein};

/// A ball of the density `weight · (1 - r²/radius²)³`, zero beyond the radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metaball {
    /// Where the density is highest.
    pub centre: Vec3,
    /// Where it ends. More than 0.
    pub radius: f32,
    /// The density at the centre; negative ones take away.
    pub weight: f32,
}

/// Why balls make no shape.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MetaballsError {
    /// A number of a ball is not finite, or its radius is not positive.
    #[error("metaball {0} must have finite numbers and a positive radius")]
    Ball(usize),
    /// The threshold is not a positive number.
    #[error("the threshold of metaballs must be positive and finite, not {0}")]
    Threshold(f32),
}

/// The solid where the sum of the balls' densities is over a threshold.
///
/// All its entries and exits are found but pairs nearer to each other along the ray than 2⁻⁴⁰ of the
/// stretch between two places where the ray enters or leaves balls. Normals are exact; `uv` is zero. A
/// ray that meets more than 32 balls allocates memory. The time for a ray grows with the number of
/// balls, and with the square of the number of those that it meets.
#[derive(Clone, Debug)]
pub struct Metaballs {
    balls: Vec<Metaball>,
    threshold: f32,
    bounds: Aabb,
}

/// Where a ray is in a ball, and its `1 - r²/radius²` as a polynomial.
#[derive(Clone, Copy, Default)]
struct Span {
    from: f64,
    to: f64,
    weight: f64,
    /// Where the ray is nearest to the centre, `1 - r²/radius²` there, and `1/radius²`.
    nearest: f64,
    peak: f64,
    narrow: f64,
}

impl Metaballs {
    /// The solid where the sum of the balls is over a threshold.
    pub fn new(balls: Vec<Metaball>, threshold: f32) -> Result<Self, MetaballsError> {
        let good = |b: &Metaball| {
            b.centre.is_finite() && b.radius > 0.0 && b.radius.is_finite() && b.weight.is_finite()
        };
        if let Some(index) = balls.iter().position(|ball| !good(ball)) {
            return Err(MetaballsError::Ball(index));
        }
        if !(threshold > 0.0 && threshold.is_finite()) {
            return Err(MetaballsError::Threshold(threshold));
        }
        let bounds = balls.iter().filter(|ball| ball.weight > 0.0).fold(Aabb::EMPTY, |b, ball| {
            b.grow(ball.centre - ball.radius).grow(ball.centre + ball.radius)
        });
        Ok(Self { balls, threshold, bounds })
    }

    /// The sum of the densities less the threshold.
    pub fn density(&self, point: Vec3) -> f32 {
        let point = point.as_dvec3();
        let sum: f64 = self
            .balls
            .iter()
            .map(|ball| {
                let offset = point - ball.centre.as_dvec3();
                let inside = 1.0 - offset.length_squared() / f64::from(ball.radius).powi(2);
                f64::from(ball.weight) * inside.max(0.0).powi(3)
            })
            .sum();
        (sum - f64::from(self.threshold)) as f32
    }

    /// Downhill; against the ray where the density is flat.
    fn normal(&self, point: DVec3, segment: &Segment) -> DVec3 {
        let downhill = self.balls.iter().fold(DVec3::ZERO, |sum, ball| {
            let offset = point - ball.centre.as_dvec3();
            let narrow = f64::from(ball.radius).powi(-2);
            let inside = (1.0 - narrow * offset.length_squared()).max(0.0);
            sum + f64::from(ball.weight) * narrow * inside * inside * offset
        });
        // Scaled up first, as balls may be so large that squares are lost.
        (downhill / downhill.abs().max_element()).try_normalize().unwrap_or(-segment.direction)
    }

    fn span(ball: &Metaball, segment: &Segment) -> Option<Span> {
        let offset = ball.centre.as_dvec3() - segment.origin;
        let narrow = f64::from(ball.radius).powi(-2);
        let nearest = offset.dot(segment.direction);
        let across = offset - nearest * segment.direction;
        let peak = 1.0 - narrow * across.length_squared();
        let half = (peak / narrow).sqrt();
        let (from, to) = ((nearest - half).max(0.0), (nearest + half).min(segment.length));
        (peak > 0.0 && from <= to && ball.weight != 0.0).then_some(Span {
            from,
            to,
            weight: f64::from(ball.weight),
            nearest,
            peak,
            narrow,
        })
    }

    fn spans(
        &self,
        segment: &Segment,
        report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        const FEW: usize = 32;
        let mut few = [Span::default(); FEW];
        let mut count = 0;
        for span in self.balls.iter().filter_map(|ball| Self::span(ball, segment)) {
            if count < FEW {
                few[count] = span;
            }
            count += 1;
        }
        if count <= FEW {
            self.solve(&few[..count], segment, report)
        } else {
            let many: Vec<Span> =
                self.balls.iter().filter_map(|ball| Self::span(ball, segment)).collect();
            self.solve(&many, segment, report)
        }
    }

    fn solve(
        &self,
        spans: &[Span],
        segment: &Segment,
        report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let hit = |s: f64| segment.hit(s, self.normal(segment.at(s), segment), Vec2::ZERO);
        let threshold = f64::from(self.threshold);
        let earliest = |s: f64| s.min(segment.length);
        let mut from = spans.iter().fold(f64::INFINITY, |s, span| s.min(span.from));
        let mut value = None;
        while from <= segment.length {
            // What comes next: an end of a span that the ray is in, or the start of another one.
            let to = earliest(spans.iter().fold(f64::INFINITY, |next, span| {
                let start = if span.from > from { span.from } else { f64::INFINITY };
                let end = if span.to > from { span.to } else { f64::INFINITY };
                next.min(start).min(end)
            }));
            let mut b = [-threshold; 7];
            for span in spans.iter().filter(|span| span.from <= from && span.to >= to) {
                span.add(from, to, &mut b);
            }
            // The sum is continuous: its sign at the start is the one that the last stretch ended with.
            match value {
                Some(value) => b[0] = value,
                None if b[0] == 0.0 => report(hit(from))?,
                None => {}
            }
            if to > from {
                bernstein::zeros(&b, &mut |x| report(hit(from + x * (to - from))))?;
            }
            value = Some(b[6]);
            if to <= from || to >= segment.length {
                break;
            }
            from = to;
        }
        ControlFlow::Continue(())
    }
}

impl Span {
    /// Adds the density between two places of the span to a sum in Bernstein coefficients.
    fn add(&self, from: f64, to: f64, sum: &mut [f64; 7]) {
        // Coefficients times their binomials multiply like those of powers.
        let (a, b) = (from - self.nearest, to - self.nearest);
        let q = [
            (self.peak - self.narrow * a * a).max(0.0),
            2.0 * (self.peak - self.narrow * a * b),
            (self.peak - self.narrow * b * b).max(0.0),
        ];
        let mut square = [0.0; 5];
        for i in 0..3 {
            for j in 0..3 {
                square[i + j] += q[i] * q[j];
            }
        }
        let mut cube = [0.0; 7];
        for i in 0..5 {
            for j in 0..3 {
                cube[i + j] += square[i] * q[j];
            }
        }
        const BINOMIALS: [f64; 7] = [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0];
        for i in 0..7 {
            sum[i] += self.weight * cube[i] / BINOMIALS[i];
        }
    }
}

impl Shape for Metaballs {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        if self.bounds.is_empty()
            || !(self.bounds.lower.is_finite() && self.bounds.upper.is_finite())
        {
            return;
        }
        let (lower, upper) = padded(self.bounds.lower.as_dvec3(), self.bounds.upper.as_dvec3());
        if let Some(segment) = Segment::clip(ray, lower, upper) {
            let _ = self.spans(&segment, report);
        }
    }
}
