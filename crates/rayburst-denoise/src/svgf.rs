//! Spatiotemporal variance-guided filtering: one sample a pixel, thousands averaged.
//!
//! Schied et al.: "Spatiotemporal Variance-Guided Filtering: Real-Time Reconstruction for Path-Traced Global
//! Illumination" (HPG 2017). Samples are accumulated over time where surfaces are found again; how much they
//! vary tells an edge-avoiding wavelet transform how much of the difference between pixels is noise. What
//! its first level makes is what the next frame accumulates on.

use rayburst_image::{Plane, Plane3};
use rayburst_simd::IsaLevel;
use rayon::prelude::*;

use crate::{
    Accumulation, EdgeStopping, Guides, Reprojection, Result, Stack, SurfaceTests, Temporal,
    atrous::{check_levels, copy_colour, filter_level, margin},
    atrous_kernel::{SIGNAL, VARIANCE, WEIGHTS},
    error::check,
    estimate::estimate,
    geometry,
    inspect::Level,
    reprojection::same_size,
    stack::BAND,
};

/// How [`Svgf`] works. Every stage can be left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SvgfSettings {
    /// Whether frames before count at all.
    pub temporal: bool,
    /// When a surface is found in the frame before.
    pub tests: SurfaceTests,
    /// How samples are accumulated.
    pub accumulation: Accumulation,
    /// Histories shorter than this many frames have their variance estimated over the pixels around: 0
    /// (none) to 65536.
    pub shortest: f32,
    /// Whether variance guides the blur; else tolerances of luminance are absolute.
    pub variance: bool,
    /// Levels of the wavelet transform: 0 to [`crate::MOST_LEVELS`].
    pub levels: u32,
    /// What stops the blur.
    pub stopping: EdgeStopping,
    /// Whether the next frame accumulates on what the first level makes, and not on the plain mean.
    pub feedback: bool,
}

impl Default for SvgfSettings {
    fn default() -> Self {
        Self {
            temporal: true,
            tests: SurfaceTests::default(),
            accumulation: Accumulation::default(),
            shortest: 4.0,
            variance: true,
            levels: 5,
            stopping: EdgeStopping::default(),
            feedback: true,
        }
    }
}

impl SvgfSettings {
    /// Fails where a setting is out of range.
    pub fn check(&self) -> Result<()> {
        self.tests.check()?;
        self.accumulation.check()?;
        self.stopping.check()?;
        check_levels(self.levels)?;
        check("the shortest trusted history", self.shortest, 0.0..=65536.0, "from 0 to 65536")
    }
}

/// The filter for N signals (direct and indirect light, say) that share their guides, and its history.
///
/// Once it has filtered a frame, it allocates nothing for the next of the same size. Pictures do not
/// depend on the number of threads, and on the instruction set by no more than rounding.
#[derive(Clone, Debug)]
pub struct Svgf<const N: usize> {
    isa: IsaLevel,
    pub(crate) reprojection: Reprojection,
    pub(crate) histories: [Temporal<3>; N],
    geometry: Stack,
    /// What a level reads and what it writes.
    signals: [Stack; 2],
    /// The variance that the first level read, N channels.
    variance: Stack,
    /// How the last frame was filtered.
    last: SvgfSettings,
}

impl<const N: usize> Svgf<N> {
    /// Without a history.
    pub fn new(isa: IsaLevel) -> Self {
        Self {
            isa,
            reprojection: Reprojection::new(),
            histories: std::array::from_fn(|_| Temporal::with_isa(isa)),
            geometry: Stack::default(),
            signals: Default::default(),
            variance: Stack::default(),
            last: SvgfSettings::default(),
        }
    }

    /// Forgets all frames before.
    pub fn reset(&mut self) {
        self.reprojection.reset();
        self.histories.iter_mut().for_each(Temporal::reset);
    }

    /// Filters a frame's signals, which are demodulated radiance.
    ///
    /// Samples that are not finite are passed over, negative results raised to zero; what comes out is
    /// finite. Pixels without a surface are blurred with nothing. A frame of another size begins afresh.
    pub fn filter(
        &mut self,
        guides: &Guides<'_>,
        signals: [&Plane3; N],
        settings: &SvgfSettings,
        outputs: &mut [Plane3; N],
    ) -> Result<()> {
        self.begin(guides, signals, settings, outputs)?;
        self.finish(signals, [None; N], settings, outputs)
    }

    /// Checks everything and finds the surfaces of the frame before.
    pub(crate) fn begin(
        &mut self,
        guides: &Guides<'_>,
        signals: [&Plane3; N],
        settings: &SvgfSettings,
        outputs: &[Plane3; N],
    ) -> Result<()> {
        guides.check()?;
        settings.check()?;
        let size = guides.size();
        for planes in signals {
            for channel in &planes.channels {
                same_size("a signal", channel.size(), size)?;
            }
        }
        for planes in outputs {
            for channel in &planes.channels {
                same_size("an output", channel.size(), size)?;
            }
        }
        let margin = margin(settings.levels);
        geometry::fit(&mut self.geometry, size, geometry::CHANNELS, margin.max(3))?;
        for stack in &mut self.signals {
            geometry::fit(stack, size, N * SIGNAL, margin)?;
        }
        geometry::fit(&mut self.variance, size, N, 0)?;
        if !settings.temporal {
            self.reprojection.reset();
        }
        self.reprojection.advance(guides, &settings.tests)?;
        geometry::prepare(self.isa, guides, settings.stopping.object, &mut self.geometry);
        Ok(())
    }

    /// Accumulates and blurs; `changes` say how much of the histories is no longer true.
    pub(crate) fn finish(
        &mut self,
        signals: [&Plane3; N],
        changes: [Option<&Plane>; N],
        settings: &SvgfSettings,
        outputs: &mut [Plane3; N],
    ) -> Result<()> {
        self.last = *settings;
        let taps = self.reprojection.taps();
        for ((history, signal), change) in self.histories.iter_mut().zip(signals).zip(changes) {
            let channels = signal.channels.each_ref();
            history.accumulate(taps, channels, WEIGHTS, change, &settings.accumulation)?;
        }
        let histories = self.histories.each_ref();
        let [first, _] = &mut self.signals;
        let stopping = &settings.stopping;
        estimate(self.isa, &self.geometry, histories, settings.shortest, stopping, first);
        self.keep_variance();
        for level in 0..settings.levels {
            let [from, to] = &mut self.signals;
            let plain = !settings.variance;
            filter_level::<N>(self.isa, &self.geometry, from, to, level, stopping, plain);
            self.signals.swap(0, 1);
            if level == 0 && settings.feedback {
                self.feed_back();
            }
        }
        for (s, output) in outputs.iter_mut().enumerate() {
            copy_colour(&self.signals[0], s * SIGNAL, output);
        }
        Ok(())
    }

    /// Puts the colours that a level made into the histories.
    fn feed_back(&mut self) {
        let from = &self.signals[0];
        let width = from.size().0 as usize;
        for (s, history) in self.histories.iter_mut().enumerate() {
            let to = history.stack_mut();
            let (margin, stride, length) = (to.margin(), to.stride(), to.band_len(1));
            let bands = to.values_mut().par_chunks_mut(length * BAND).enumerate();
            bands.for_each(|(band, rows)| {
                for (y, row) in (band * BAND..).zip(rows.chunks_mut(length)) {
                    for channel in 0..3 {
                        row[channel * stride + margin..][..width]
                            .copy_from_slice(from.row(s * SIGNAL + channel, y as u32));
                    }
                }
            });
        }
    }

    /// Remembers the variance that the first level reads.
    fn keep_variance(&mut self) {
        let from = &self.signals[0];
        let width = from.size().0 as usize;
        let (stride, length) = (self.variance.stride(), self.variance.band_len(BAND));
        self.variance.values_mut().par_chunks_mut(length).enumerate().for_each(|(band, rows)| {
            for (y, row) in (band * BAND..).zip(rows.chunks_mut(N * stride)) {
                for s in 0..N {
                    row[s * stride..][..width]
                        .copy_from_slice(from.row(s * SIGNAL + VARIANCE, y as u32));
                }
            }
        });
    }

    /// Where the last frame's surfaces were in the frame before it.
    pub fn reprojection(&self) -> &Reprojection {
        &self.reprojection
    }

    /// What has been accumulated of a signal: among others, how many frames it counts for.
    pub fn history(&self, signal: usize) -> &Temporal<3> {
        &self.histories[signal.min(N - 1)]
    }

    /// A row of the variance of a signal's luminance that the last frame's first level was guided by.
    pub fn variance_row(&self, signal: usize, y: u32) -> &[f32] {
        self.variance.row(signal.min(N - 1), y)
    }

    /// By row and column the share that each of the last level's taps had in a pixel of the last frame; all
    /// zero without levels or outside the picture.
    pub fn last_weights(&self, signal: usize, x: u32, y: u32) -> [[f32; 5]; 5] {
        let [_, from] = &self.signals;
        let (width, height) = from.size();
        let Some(level) = self.last.levels.checked_sub(1).filter(|_| x < width && y < height)
        else {
            return [[0.0; 5]; 5];
        };
        let (stopping, plain) = (self.last.stopping, !self.last.variance);
        let level = Level { geometry: &self.geometry, from, level, stopping, plain };
        level.weights(signal.min(N - 1), (x, y))
    }

    /// A row of what the last frame's levels left of that variance.
    pub fn filtered_variance_row(&self, signal: usize, y: u32) -> &[f32] {
        self.signals[0].row(signal.min(N - 1) * SIGNAL + VARIANCE, y)
    }
}
