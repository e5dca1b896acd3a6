//! Interleaved timing of things that do one frame after another.

use crate::BenchError;

/// Something that brings a structure up to date.
pub(super) struct Contender<'a> {
    /// How.
    pub(super) policy: String,
    /// Brings it up to a frame.
    pub(super) step: Box<dyn FnMut(usize) -> Result<Step, BenchError> + 'a>,
}

/// What one frame took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Step {
    pub(super) seconds: f64,
    pub(super) sah_cost: Option<f32>,
}

/// The timed runs of a contender.
#[derive(Clone, Debug, Default)]
pub(super) struct Measured {
    /// Seconds a frame, run by run.
    pub(super) seconds: Vec<f64>,
    /// The greatest of all frames.
    pub(super) sah_cost: Option<f32>,
}

impl Measured {
    pub(super) fn median(&self) -> f64 {
        median(&self.seconds)
    }

    pub(super) fn least(&self) -> f64 {
        self.seconds.iter().copied().fold(f64::INFINITY, f64::min)
    }

    pub(super) fn most(&self) -> f64 {
        self.seconds.iter().copied().fold(0.0, f64::max)
    }
}

/// The middle one of some numbers, of which there must be some.
pub(crate) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// Times of one contender over those of another, run by run, ascending.
pub(super) fn ratios(one: &Measured, other: &Measured) -> Vec<f64> {
    let pairs = one.seconds.iter().zip(&other.seconds);
    let mut ratios: Vec<f64> = pairs.map(|(a, b)| a / b).collect();
    ratios.sort_by(f64::total_cmp);
    ratios
}

/// One timed run of each contender, again and again, after a warm-up. A run lasts until its frames
/// took some seconds; frames are numbered on.
pub(super) fn interleave(
    contenders: &mut [Contender<'_>],
    repeats: usize,
    seconds: f64,
) -> Result<Vec<Measured>, BenchError> {
    let mut measured = vec![Measured::default(); contenders.len()];
    let mut frames = vec![1; contenders.len()];
    for contender in &mut *contenders {
        (contender.step)(0)?;
    }
    for _ in 0..repeats {
        for ((contender, m), frame) in contenders.iter_mut().zip(&mut measured).zip(&mut frames) {
            let (mut total, mut count) = (0.0, 0);
            while count == 0 || total < seconds {
                let step = (contender.step)(*frame)?;
                total += step.seconds.max(1e-9);
                let costs = m.sah_cost.into_iter().chain(step.sah_cost);
                m.sah_cost = costs.reduce(f32::max);
                count += 1;
                *frame += 1;
            }
            m.seconds.push(total / f64::from(count));
        }
    }
    Ok(measured)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_take_turns_and_frames_are_numbered_on() {
        let calls = std::cell::RefCell::new(vec![]);
        let contender = |name: &'static str, seconds: f64| Contender {
            policy: name.into(),
            step: Box::new({
                let calls = &calls;
                move |frame| {
                    calls.borrow_mut().push((name, frame));
                    Ok(Step { seconds, sah_cost: None })
                }
            }),
        };
        let mut contenders = [contender("a", 0.25), contender("b", 1.0)];
        let measured = interleave(&mut contenders, 2, 0.5).unwrap();
        drop(contenders);
        let expected =
            [("a", 0), ("b", 0), ("a", 1), ("a", 2), ("b", 1), ("a", 3), ("a", 4), ("b", 2)];
        assert_eq!(calls.into_inner(), expected);
        assert_eq!((measured[0].median(), measured[1].most()), (0.25, 1.0));
        assert_eq!(ratios(&measured[1], &measured[0]), [4.0, 4.0]);
    }
}
