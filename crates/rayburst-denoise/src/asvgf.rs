//! Spatiotemporal variance-guided filtering that forgets where light has changed.
//!
//! Schied, Peters, Dachsbacher: "Gradient Estimation for Real-Time Adaptive Temporal Filtering" (HPG 2018):
//! temporal gradients tell how much of a pixel's history is no longer true; the newest sample's weight grows
//! and the history's length shrinks by as much. Where nothing changes it is [`Svgf`].

use rayburst_image::Plane3;
use rayburst_simd::IsaLevel;

use crate::{GradientSamples, GradientSettings, Gradients, Guides, Result, Svgf, SvgfSettings};

/// The adaptive filter for N signals that share their guides, and its history.
#[derive(Clone, Debug)]
pub struct AdaptiveSvgf<const N: usize> {
    svgf: Svgf<N>,
    gradients: [Gradients; N],
}

impl<const N: usize> AdaptiveSvgf<N> {
    /// Without a history.
    pub fn new(isa: IsaLevel) -> Self {
        Self { svgf: Svgf::new(isa), gradients: std::array::from_fn(|_| Gradients::new(isa)) }
    }

    /// Forgets all frames before.
    pub fn reset(&mut self) {
        self.svgf.reset();
    }

    /// Filters a frame's signals as [`Svgf::filter`] does, guided by gradient samples of each; without
    /// them, changes are estimated from the signals alone ([`Gradients::estimate`]).
    pub fn filter(
        &mut self,
        guides: &Guides<'_>,
        signals: [&Plane3; N],
        samples: Option<[GradientSamples<'_>; N]>,
        settings: &SvgfSettings,
        gradients: &GradientSettings,
        outputs: &mut [Plane3; N],
    ) -> Result<()> {
        self.svgf.begin(guides, signals, settings, outputs)?;
        let mut changes = [None; N];
        for (s, (found, change)) in self.gradients.iter_mut().zip(&mut changes).enumerate() {
            *change = Some(match &samples {
                Some(samples) => found.reconstruct(guides, &samples[s], gradients)?,
                None => {
                    let reprojection = &self.svgf.reprojection;
                    let history = &self.svgf.histories[s];
                    found.estimate(guides, signals[s], reprojection, history, gradients)?
                }
            });
        }
        self.svgf.finish(signals, changes, settings, outputs)
    }

    /// The filter that is adapted, to be inspected.
    pub fn svgf(&self) -> &Svgf<N> {
        &self.svgf
    }

    /// How much of a signal's history was taken to be no longer true in the last frame: 0 to 1 at every
    /// pixel; empty before the first.
    pub fn change(&self, signal: usize) -> &rayburst_image::Plane {
        self.gradients[signal.min(N - 1)].change()
    }
}
