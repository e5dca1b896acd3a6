//! The edge-avoiding à-trous wavelet transform: wide blurs that stop at edges, in few taps.
//!
//! Every level averages 5×5 pixels, twice as far apart as those of the level before, with the weights of a
//! B3 spline times those of edge-stopping functions (Dammertz et al.: "Edge-Avoiding À-Trous Wavelet
//! Transform for Fast Global Illumination Filtering", HPG 2010). With a variance, differences of luminance
//! are measured by the local standard deviation (Schied et al.: "Spatiotemporal Variance-Guided Filtering",
//! HPG 2017, section 4.4).
//!
//! Several signals are filtered at once, since most of a tap's work is to compare surfaces.

use rayburst_image::{Plane, Plane3};
use rayburst_simd::IsaLevel;
use rayon::prelude::*;

use crate::{
    Guides, Result,
    atrous_kernel::{LUMINANCE, LevelKernel, SIGNAL, Taps, VARIANCE, luminance},
    error::check,
    geometry,
    reprojection::same_size,
    stack::{BAND, Stack},
    temporal::LARGEST,
};

/// The most levels: taps of the last are 64 pixels apart.
pub const MOST_LEVELS: u32 = 7;

/// The weights of taps before edges count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WaveletKernel {
    /// 5×5 taps: a B3 spline, 1 4 6 4 1.
    #[default]
    B3Spline,
    /// 3×3 taps: 1 2 1. A third of the work, and a narrower blur.
    Binomial,
}

impl WaveletKernel {
    /// Weights by distance from the centre: of a row, and of a column.
    pub fn weights(self) -> [f32; 3] {
        match self {
            Self::B3Spline => [0.375, 0.25, 0.0625],
            Self::Binomial => [0.5, 0.25, 0.0],
        }
    }
}

/// What stops the blur. A tap's weight is that of the kernel times e to minus the sum of
/// - the difference of depth over `depth` times (the change of depth that the surface's slope leads to
///   expect between the two pixels, plus a four-thousandth of the depth per pixel),
/// - `normal` times (1 − the cosine between the normals): what a cosine to the power of `normal`
///   approaches for small angles (Wang et al.: "All-Frequency Rendering of Dynamic, Spatially-Varying
///   Reflectance", SIGGRAPH Asia 2009),
/// - the difference of luminance over `luminance` times (the standard deviation, blurred over 3×3 pixels,
///   plus a thousandth of the luminance);
///
/// and zero between objects. Weights below 2⁻⁴⁰ are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeStopping {
    /// Tolerance of depth: 0.001 to 1000.
    pub depth: f32,
    /// Sharpness of normals: 0 to 1024.
    pub normal: f32,
    /// Tolerance of luminance: 0.001 to 10⁹ standard deviations; without a variance, in units of luminance,
    /// halved from level to level.
    pub luminance: f32,
    /// Whether objects are kept apart.
    pub object: bool,
    /// The taps.
    pub kernel: WaveletKernel,
}

impl Default for EdgeStopping {
    fn default() -> Self {
        let kernel = WaveletKernel::default();
        Self { depth: 1.0, normal: 128.0, luminance: 4.0, object: true, kernel }
    }
}

impl EdgeStopping {
    /// Fails where a setting is out of range.
    pub fn check(&self) -> Result<()> {
        check("the tolerance of depth", self.depth, 1e-3..=1e3, "from 0.001 to 1000")?;
        check("the sharpness of normals", self.normal, 0.0..=1024.0, "from 0 to 1024")?;
        let luminance = self.luminance;
        check("the tolerance of luminance", luminance, 1e-3..=1e9, "from 0.001 to 1000000000")
    }
}

/// The transform on its own, over N signals that share their guides; see [`crate::Svgf`] for what comes
/// before it. Keeps its working memory.
#[derive(Clone, Debug)]
pub struct Wavelet<const N: usize> {
    isa: IsaLevel,
    geometry: Stack,
    signals: [Stack; 2],
}

impl<const N: usize> Wavelet<N> {
    /// Without working memory. Pictures depend on the instruction set by no more than rounding.
    pub fn new(isa: IsaLevel) -> Self {
        Self { isa, geometry: Stack::default(), signals: Default::default() }
    }

    /// Filters signals over some levels (at most [`MOST_LEVELS`]). With `variances` of their luminance,
    /// tolerances of luminance are standard deviations.
    ///
    /// Values that are negative or not finite count as zero, and others as [`LARGEST`] at most. Pixels
    /// without a surface are averaged with nothing else.
    pub fn filter(
        &mut self,
        guides: &Guides<'_>,
        signals: [&Plane3; N],
        variances: Option<[&Plane; N]>,
        levels: u32,
        stopping: &EdgeStopping,
        outputs: &mut [Plane3; N],
    ) -> Result<()> {
        guides.check()?;
        stopping.check()?;
        check_levels(levels)?;
        let size = guides.size();
        for (signal, output) in signals.iter().zip(&*outputs) {
            same_size("a signal", signal.size(), size)?;
            same_size("an output", output.size(), size)?;
        }
        for variance in variances.iter().flatten() {
            same_size("a variance", variance.size(), size)?;
        }
        let margin = margin(levels);
        geometry::fit(&mut self.geometry, size, geometry::CHANNELS, margin)?;
        for stack in &mut self.signals {
            geometry::fit(stack, size, N * SIGNAL, margin)?;
        }
        geometry::prepare(self.isa, guides, stopping.object, &mut self.geometry);
        fill(&mut self.signals[0], signals, variances);
        for level in 0..levels {
            let [from, to] = &mut self.signals;
            let plain = variances.is_none();
            filter_level::<N>(self.isa, &self.geometry, from, to, level, stopping, plain);
            self.signals.swap(0, 1);
        }
        for (s, output) in outputs.iter_mut().enumerate() {
            copy_colour(&self.signals[0], s * SIGNAL, output);
        }
        Ok(())
    }
}

/// Fails where there are too many levels.
pub(crate) fn check_levels(levels: u32) -> Result<()> {
    check("the number of levels", levels as f32, 0.0..=MOST_LEVELS as f32, "from 0 to 7")
}

/// What rows need at their sides for some levels.
pub(crate) fn margin(levels: u32) -> usize {
    (2 << levels.max(1) >> 1).max(1)
}

/// One level: taps are 2 to the power of `level` pixels apart.
pub(crate) fn filter_level<const N: usize>(
    isa: IsaLevel,
    geometry: &Stack,
    from: &Stack,
    to: &mut Stack,
    level: u32,
    stopping: &EdgeStopping,
    plain: bool,
) {
    let step = 1 << level;
    let normal = stopping.normal * std::f32::consts::LOG2_E;
    let taps = Taps::new(stopping.kernel.weights(), normal);
    let (margin, stride) = (to.margin(), to.stride());
    let (width, height) = (to.size().0 as usize, to.size().1 as usize);
    // Of rows that read the same rows, a thread should have many, and every thread some bands.
    let band = height.div_ceil(4 * rayon::current_num_threads()).clamp(BAND, BAND * step);
    let length = to.band_len(band);
    let luminance = if plain { stopping.luminance / step as f32 } else { stopping.luminance };
    to.values_mut().par_chunks_mut(length).enumerate().for_each(|(index, rows)| {
        isa.dispatch(LevelKernel::<N> {
            geometry,
            from,
            to: rows,
            top: index * band,
            step,
            taps: &taps,
            depth: stopping.depth,
            normal,
            luminance,
            plain,
        });
        for row in rows.chunks_mut(SIGNAL * stride) {
            extend(&mut row[VARIANCE * stride..], margin, width);
        }
    });
}

/// Repeats the first and the last pixel of a padded row once.
pub(crate) fn extend(row: &mut [f32], margin: usize, width: usize) {
    row[margin - 1] = row[margin];
    row[margin + width] = row[margin + width - 1];
}

/// A sample as filters may read it.
#[inline(always)]
pub(crate) fn sane(value: f32) -> f32 {
    if value.is_finite() { value.clamp(0.0, LARGEST) } else { 0.0 }
}

/// Puts signals, their luminance and their variance into a stack.
fn fill<const N: usize>(stack: &mut Stack, signals: [&Plane3; N], variances: Option<[&Plane; N]>) {
    let (length, margin, stride) = (stack.band_len(1), stack.margin(), stack.stride());
    let width = stack.size().0 as usize;
    stack.values_mut().par_chunks_mut(length).enumerate().for_each(|(y, row)| {
        for (s, row) in row.chunks_mut(SIGNAL * stride).enumerate() {
            let start = y * signals[s].channels[0].stride();
            for x in 0..width {
                let colour = signals[s].at(start + x).to_array().map(sane);
                for (channel, value) in colour.into_iter().enumerate() {
                    row[channel * stride + margin + x] = value;
                }
                row[LUMINANCE * stride + margin + x] = luminance(colour);
                let variance = variances.map_or(0.0, |planes| planes[s].at(start + x));
                let largest = LARGEST * LARGEST;
                let variance = if variance > 0.0 { variance.min(largest) } else { 0.0 };
                row[VARIANCE * stride + margin + x] = variance;
            }
            extend(&mut row[VARIANCE * stride..], margin, width);
        }
    });
}

/// Copies three channels of a stack into planes.
pub(crate) fn copy_colour(stack: &Stack, first: usize, to: &mut Plane3) {
    let height = to.size().1;
    for (i, channel) in to.channels.iter_mut().enumerate() {
        let (width, stride) = (channel.width() as usize, channel.stride());
        let bands = channel.values_mut().par_chunks_mut(stride * BAND);
        bands.zip((0..height).into_par_iter().step_by(BAND)).for_each(|(rows, top)| {
            for (row, y) in rows.chunks_mut(stride).zip(top..) {
                row[..width].copy_from_slice(stack.row(first + i, y));
            }
        });
    }
}
