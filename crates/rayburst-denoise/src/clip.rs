//! What temporal anti-aliasing and temporal upscaling have in common: colours as one luma and two chromas,
//! a history that is clipped to what the frame's neighbourhood allows, and the blend of both.

use crate::lanes::{LANES, Lanes, greater, lesser};

/// Luma, orange chroma and green chroma of a colour (Malvar, Sullivan: "YCoCg-R: A Color Space with RGB
/// Reversibility and Low Dynamic Range", 2003).
#[inline(always)]
pub(crate) fn to_ycocg(r: f32, g: f32, b: f32) -> [f32; 3] {
    [0.25 * r + 0.5 * g + 0.25 * b, 0.5 * (r - b), 0.5 * g - 0.25 * (r + b)]
}

/// The colour of luma and chromas.
#[inline(always)]
pub(crate) fn from_ycocg([y, orange, green]: [f32; 3]) -> [f32; 3] {
    let rest = y - green;
    [rest + orange, y + green, rest - orange]
}

/// How a history is clipped and blended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blend {
    /// Deviations from the mean that the history may be off.
    pub(crate) deviations: f32,
    /// The most that a history weighs.
    pub(crate) longest: f32,
    /// How much less bright colours count: weights are divided by one plus this times the luma.
    pub(crate) dimming: f32,
}

/// What is blended, sixteen pixels at a time; colours are luma and chromas. It is written in place: copies of
/// it are calls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blended {
    /// The history and its weight; zero without one.
    pub(crate) history: [Lanes; 4],
    /// Mean and deviation of the frame around.
    pub(crate) mean: [Lanes; 3],
    pub(crate) deviation: [Lanes; 3],
    /// The frame's colour and its weight.
    pub(crate) now: [Lanes; 3],
    pub(crate) weight: Lanes,
}

impl Blended {
    pub(crate) const EMPTY: Self = Self {
        history: [[0.0; LANES]; 4],
        mean: [[0.0; LANES]; 3],
        deviation: [[0.0; LANES]; 3],
        now: [[0.0; LANES]; 3],
        weight: [0.0; LANES],
    };

    /// Clips the history towards the mean of the neighbourhood, into the box of some deviations (Salvi: "An
    /// Excursion in Temporal Supersampling", GDC 2016), and blends the frame in by the weights, bright
    /// colours less (Karis: "High Quality Temporal Supersampling", SIGGRAPH 2014 courses). A history that
    /// is clipped loses weight as it loses distance. Gives colour and weight.
    #[inline(always)]
    pub(crate) fn blend(&self, how: &Blend, out: &mut [Lanes; 4]) {
        for i in 0..LANES {
            // Rounding is no reason to clip.
            let slack = 1e-5 * self.mean[0][i].abs() + 1e-20;
            let mut off = [0.0; 3];
            let mut beyond = 1.0;
            for c in 0..3 {
                off[c] = self.history[c][i] - self.mean[c][i];
                let room = how.deviations * self.deviation[c][i] + slack;
                beyond = greater(off[c].abs() / room, beyond);
            }
            let kept = 1.0 / beyond;
            let before = self.history[3][i] * kept;
            let now = self.weight[i];
            let luma = self.mean[0][i] + off[0] * kept;
            let dim_before = before / (1.0 + how.dimming * greater(luma, 0.0));
            let dim_now = now / (1.0 + how.dimming * greater(self.now[0][i], 0.0));
            let alpha = dim_now / greater(dim_before + dim_now, f32::MIN_POSITIVE);
            for c in 0..3 {
                let clipped = self.mean[c][i] + off[c] * kept;
                out[c][i] = clipped + alpha * (self.now[c][i] - clipped);
            }
            out[3][i] = lesser(before + now, how.longest);
        }
    }
}

/// The tent-like bell (1 − (d/r)²)² of a sample that is `d` away.
#[inline(always)]
pub(crate) fn bell(distance: f32, radius: f32) -> f32 {
    let q = distance / radius;
    let rest = greater(1.0 - q * q, 0.0);
    rest * rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_come_back() {
        for colour in [[1.0, 0.5, 0.25], [0.0, 3.0, 7.0]] {
            let [r, g, b] = colour;
            let back = from_ycocg(to_ycocg(r, g, b));
            for c in 0..3 {
                assert!((back[c] - colour[c]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn histories_are_clipped_into_the_box() {
        let mut blended = Blended::EMPTY;
        blended.history = [[10.0; LANES], [0.0; LANES], [0.0; LANES], [4.0; LANES]];
        blended.mean[0] = [2.0; LANES];
        blended.deviation[0] = [1.0; LANES];
        let how = Blend { deviations: 2.0, longest: 64.0, dimming: 0.0 };
        let mut out = [[0.0; LANES]; 4];
        blended.blend(&how, &mut out);
        assert!((out[0][3] - 4.0).abs() < 1e-3 && (out[3][3] - 1.0).abs() < 1e-3, "{out:?}");
        blended.history[0] = [3.0; LANES];
        blended.blend(&how, &mut out);
        assert_eq!((out[0][3], out[3][3]), (3.0, 4.0));
    }

    #[test]
    fn bright_colours_count_less() {
        let mut blended = Blended::EMPTY;
        blended.history = [[0.0; LANES], [0.0; LANES], [0.0; LANES], [1.0; LANES]];
        blended.mean[0] = [0.5; LANES];
        blended.deviation[0] = [0.5; LANES];
        blended.now[0] = [1.0; LANES];
        blended.weight = [1.0; LANES];
        let at = |dimming| {
            let mut out = [[0.0; LANES]; 4];
            blended.blend(&Blend { deviations: 2.0, longest: 64.0, dimming }, &mut out);
            out[0][0]
        };
        assert!((at(0.0) - 0.5).abs() < 1e-6 && (at(1.0) - 1.0 / 3.0).abs() < 1e-6);
    }
}
