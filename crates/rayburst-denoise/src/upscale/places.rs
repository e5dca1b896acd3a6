//! Where output pixels are among the rendered ones.

use crate::{clip::bell, lanes::LANES};

/// Where output pixels are among the rendered ones, along an axis; as many as whole vectors hold.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    /// The rendered pixel whose sample is nearest.
    pub(super) nearest: Vec<usize>,
    /// Weights of its sample and of those on both sides, under an output pixel's kernel and under a rendered
    /// pixel's.
    pub(super) narrow: [Vec<f32>; 3],
    pub(super) wide: [Vec<f32>; 3],
}

impl Places {
    /// Finds the output pixels of an axis.
    pub(super) fn find(&mut self, small: u32, size: u32, jitter: f32, radius: f32) {
        let step = f64::from(small) / f64::from(size);
        self.nearest.clear();
        for weights in self.narrow.iter_mut().chain(&mut self.wide) {
            weights.clear();
        }
        for x in 0..(size as usize).next_multiple_of(LANES) {
            // In rendered pixels from the first sample.
            let at =
                ((x.min(size as usize - 1) as f64 + 0.5) * step - 0.5 - f64::from(jitter)) as f32;
            let nearest = at.round().clamp(0.0, small as f32 - 1.0);
            self.nearest.push(nearest as usize);
            for k in 0..3 {
                let sample = nearest + k as f32 - 1.0;
                let inside = sample >= 0.0 && sample < small as f32;
                let weight = |radius| if inside { bell(sample - at, radius) } else { 0.0 };
                self.narrow[k].push(weight(radius * step as f32));
                // The nearest one counts in any case.
                self.wide[k].push(weight(1.2).max(if k == 1 { 0.01 } else { 0.0 }));
            }
        }
    }
}
