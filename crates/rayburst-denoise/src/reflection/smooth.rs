//! Reflections are smoothed under a kernel that is shaped like the lobe.
//!
//! What a rough surface reflects from a distance t is blurred by the lobe's angle as seen from the mirrored
//! point, so that the kernel grows with roughness and with t. At grazing angles lobes are narrow across the
//! plane of incidence by the cosine: reflections are drawn out along the normal as the picture shows it, and
//! so is the kernel (Liu et al.: "Cinematic Rendering in UE4 with Real-Time Ray Tracing and Denoising", Ray
//! Tracing Gems 2019, chapter 19).

use glam::Mat4;
use rayburst_image::{Plane, Plane3};
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use super::FARTHEST;
use crate::{
    Result, SurfaceTolerance, Surfaces, checks,
    lanes::{LANES, Lanes, greater, greatest, lesser, light, load, luminance, store},
    scratch::{BAND, MARGIN, Scratch, ScratchBand, band_rows, fit, padded_row},
    surfaces::{ACROSS, NEARNESS, NORMAL, SLOPE, STIFFNESS},
};

/// How a [`ReflectionFilter`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectionFilterSettings {
    /// Radius of the kernel, as a share of the lobe's blur.
    pub width: f32,
    /// The greatest radius of a kernel, pixels.
    pub most_radius: f32,
    /// Difference of roughness at which surfaces are others.
    pub roughness: f32,
    /// Deviation over luminance at which the kernel has half its radius, where the variance is given.
    pub steady: f32,
    /// Which pixels show the same surface.
    pub tolerance: SurfaceTolerance,
}

impl Default for ReflectionFilterSettings {
    fn default() -> Self {
        Self {
            width: 1.0,
            most_radius: 8.0,
            roughness: 0.2,
            steady: 0.05,
            tolerance: SurfaceTolerance::default(),
        }
    }
}

impl ReflectionFilterSettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        checks::setting("the width", self.width, (0.0, 100.0), "from 0 to 100")?;
        checks::setting("the most radius", self.most_radius, (0.0, 16.0), "from 0 to 16")?;
        checks::setting("the roughness", self.roughness, (1e-3, 1e3), "from 0.001 to 1000")?;
        checks::setting("the steadiness", self.steady, (0.0, 1e3), "from 0 to 1000")?;
        self.tolerance.check()
    }
}

/// Smooths reflections in space.
#[derive(Clone, Debug)]
pub struct ReflectionFilter {
    isa: IsaLevel,
    light: Scratch,
}

/// Channels: radiance, then roughness.
const ROUGHNESS: usize = 3;

impl ReflectionFilter {
    /// A filter for an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        Self { isa, light: Scratch::default() }
    }

    /// Filters demodulated radiance into other planes, which get its size.
    ///
    /// `distance` is how far the light comes, world units; `roughness` is perceptual. `variance`, if any, is
    /// that of the radiance's luminance: what is not noisy is left alone. `world_to_pixel` maps points of
    /// the world (as columns, with a fourth coordinate of one) to pixels times w, Y down, and w.
    pub fn filter(
        &mut self,
        surfaces: &Surfaces,
        radiance: &Plane3,
        distance: &Plane,
        roughness: &Plane,
        variance: Option<&Plane>,
        world_to_pixel: &Mat4,
        settings: &ReflectionFilterSettings,
        out: &mut Plane3,
    ) -> Result<()> {
        settings.check()?;
        let size = roughness.size();
        surfaces.check("the roughness", size)?;
        checks::size("the distance", distance.size(), size)?;
        if let Some(variance) = variance {
            checks::size("the variance", variance.size(), size)?;
        }
        for c in 0..3 {
            checks::size("the radiance", radiance.channels[c].size(), size)?;
            fit(&mut out.channels[c], size)?;
        }
        self.light.resize(size, 4);
        let isa = self.isa;
        self.light.bands_mut().for_each(|band| isa.dispatch(Take { radiance, roughness, band }));
        let light = &self.light;
        let rows = world_to_pixel.transpose();
        let rows = [rows.x_axis, rows.y_axis, rows.w_axis].map(|row| [row.x, row.y, row.z]);
        let factors = settings.tolerance.factors();
        let [r, g, b] = &mut out.channels;
        let bands = band_rows(r).zip(band_rows(g)).zip(band_rows(b));
        bands.enumerate().for_each(|(i, ((r, g), b))| {
            let (top, out) = (i * BAND, [r, g, b]);
            isa.dispatch(Smooth {
                surfaces,
                light,
                distance,
                variance,
                rows,
                settings,
                factors,
                top,
                out,
            });
        });
        Ok(())
    }
}

struct Take<'a> {
    radiance: &'a Plane3,
    roughness: &'a Plane,
    band: ScratchBand<'a>,
}

impl Kernel for Take<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for y in self.band.rows() {
            for c in 0..3 {
                let radiance = padded_row(&self.radiance.channels[c], y);
                let out = &mut self.band.row_mut(y, c)[MARGIN..][..radiance.len()];
                for x in 0..radiance.len() {
                    out[x] = light(radiance[x]);
                }
            }
            let roughness = padded_row(self.roughness, y);
            let out = &mut self.band.row_mut(y, ROUGHNESS)[MARGIN..][..roughness.len()];
            for x in 0..roughness.len() {
                out[x] = lesser(greater(roughness[x], 0.0), 1.0);
            }
            self.band.extend(y);
        }
    }
}

struct Smooth<'a> {
    surfaces: &'a Surfaces,
    light: &'a Scratch,
    distance: &'a Plane,
    variance: Option<&'a Plane>,
    /// Rows of the matrix that give x, y and w of directions.
    rows: [[f32; 3]; 3],
    settings: &'a ReflectionFilterSettings,
    factors: [f32; 2],
    top: usize,
    out: [&'a mut [f32]; 3],
}

/// Sixteen kernels: q = a·dx² + b·dx·dy + c·dy², and how far they reach along X and Y.
struct Ellipses {
    form: [Lanes; 3],
    reach: [Lanes; 2],
}

impl Kernel for Smooth<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let stride = self.distance.stride();
        for row in 0..self.out[0].len() / stride {
            for x in (0..stride).step_by(LANES) {
                let (y, at) = (self.top + row, MARGIN + x);
                let ellipses = self.ellipses(y, x);
                let reach = [greatest(&ellipses.reach[0]), greatest(&ellipses.reach[1])];
                let sums = if reach[0] > 1.0 || reach[1] > 1.0 {
                    self.block(y, at, &ellipses, reach)
                } else {
                    [
                        load(self.light.row(y, 0), at),
                        load(self.light.row(y, 1), at),
                        load(self.light.row(y, 2), at),
                    ]
                };
                for c in 0..3 {
                    store(self.out[c], row * stride + x, &sums[c]);
                }
            }
        }
    }
}

impl Smooth<'_> {
    #[inline(always)]
    fn ellipses(&self, y: usize, x: usize) -> Ellipses {
        let at = MARGIN + x;
        let shape = self.surfaces.shape();
        let nearness = load(shape.row(y, NEARNESS), at);
        let normal = [
            load(shape.row(y, NORMAL), at),
            load(shape.row(y, NORMAL + 1), at),
            load(shape.row(y, NORMAL + 2), at),
        ];
        let pixel = load(self.surfaces.local().row(y, ACROSS), at);
        let distance = load(padded_row(self.distance, y), x);
        let roughness = load(self.light.row(y, ROUGHNESS), at);
        let steady = self.steadiness(y, x);
        let py = y as f32 + 0.5;
        let mut ellipses = Ellipses { form: [[0.0; LANES]; 3], reach: [[0.0; LANES]; 2] };
        let [right, down, w] = self.rows;
        for i in 0..LANES {
            let px = (x + i) as f32 + 0.5;
            let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
            let (mut across, mut along) = (0.0, 0.0);
            for axis in 0..3 {
                a[axis] = right[axis] - px * w[axis];
                b[axis] = down[axis] - py * w[axis];
                // Where the picture shows the normal to point.
                across += a[axis] * normal[axis][i];
                along += b[axis] * normal[axis][i];
            }
            // The eye's ray: what both rows of the matrix leave out.
            let ray =
                [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            let length2 = ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2];
            let facing = ray[0] * normal[0][i] + ray[1] * normal[1][i] + ray[2] * normal[2][i];
            let facing = facing.abs() / greater(length2, 1e-30).sqrt();
            let facing = lesser(greater(facing, 0.05), 1.0);
            let scale2 = across * across + along * along;
            let scale = 1.0 / greater(scale2, 1e-30).sqrt();
            let (ux, uy) = (across * scale, along * scale);
            // A normal towards the eye has no direction in the picture, and the kernel is round.
            let (ux, uy) = if scale2 > 1e-20 { (ux, uy) } else { (1.0, 0.0) };
            let far = greater(lesser(distance[i], FARTHEST), 0.0);
            let alpha = roughness[i] * roughness[i];
            // α·t/(z + t) by the angle of a pixel, which is its width over z.
            let blur = alpha * far / ((1.0 + far * nearness[i]) * pixel[i]);
            let radius = lesser(self.settings.width * blur * steady[i], self.settings.most_radius);
            let there = nearness[i] > 0.0 && radius > 1.0;
            let major = if there { radius } else { 1.0 };
            let minor = greater(major * facing, 1.0);
            let (wide, narrow) = (1.0 / (major * major), 1.0 / (minor * minor));
            ellipses.form[0][i] = ux * ux * wide + uy * uy * narrow;
            ellipses.form[1][i] = 2.0 * ux * uy * (wide - narrow);
            ellipses.form[2][i] = uy * uy * wide + ux * ux * narrow;
            let (major2, minor2) = (major * major, minor * minor);
            let reach = (major2 * ux * ux + minor2 * uy * uy).sqrt();
            ellipses.reach[0][i] = if there { reach } else { 0.0 };
            let reach = (major2 * uy * uy + minor2 * ux * ux).sqrt();
            ellipses.reach[1][i] = if there { reach } else { 0.0 };
        }
        ellipses
    }

    /// What kernels are narrowed by where little noise is.
    #[inline(always)]
    fn steadiness(&self, y: usize, x: usize) -> Lanes {
        let mut steady = [1.0; LANES];
        let Some(variance) = self.variance else { return steady };
        let variance = load(padded_row(variance, y), x);
        let at = MARGIN + x;
        let r = load(self.light.row(y, 0), at);
        let g = load(self.light.row(y, 1), at);
        let b = load(self.light.row(y, 2), at);
        for i in 0..LANES {
            let deviation = lesser(greater(variance[i], 0.0), 1e30).sqrt();
            let luma = luminance(r[i], g[i], b[i]);
            let whole = deviation + self.settings.steady * luma;
            steady[i] = deviation / greater(whole, 1e-30);
        }
        steady
    }

    #[inline(always)]
    fn block(&self, y: usize, at: usize, ellipses: &Ellipses, reach: [f32; 2]) -> [Lanes; 3] {
        let (shape, local) = (self.surfaces.shape(), self.surfaces.local());
        let own = load(shape.row(y, NEARNESS), at);
        let nx = load(shape.row(y, NORMAL), at);
        let ny = load(shape.row(y, NORMAL + 1), at);
        let nz = load(shape.row(y, NORMAL + 2), at);
        let slopes = [load(local.row(y, SLOPE), at), load(local.row(y, SLOPE + 1), at)];
        let stiff = [load(local.row(y, STIFFNESS), at), load(local.row(y, STIFFNESS + 1), at)];
        let rough = load(self.light.row(y, ROUGHNESS), at);
        let mut stiffness = [0.0; LANES];
        for i in 0..LANES {
            stiffness[i] = lesser(stiff[0][i], stiff[1][i]) * self.factors[0];
        }
        let bend = self.factors[1];
        let rougher = 1.0 / self.settings.roughness;
        let mut weights = [1.0; LANES];
        let mut sums = [
            load(self.light.row(y, 0), at),
            load(self.light.row(y, 1), at),
            load(self.light.row(y, 2), at),
        ];
        // Wide kernels skip every second pixel: rays are two pixels apart.
        let step = if reach[0] > 4.0 || reach[1] > 4.0 { 2 } else { 1 };
        let taps = [(reach[0].ceil() as isize - 1) / step, (reach[1].ceil() as isize - 1) / step];
        let height = self.light.height() as isize;
        let mut v = -taps[1];
        while v <= taps[1] {
            let (dy, row) = (v * step, y as isize + v * step);
            v += 1;
            if row < 0 || row >= height {
                continue;
            }
            let row = row as usize;
            let mut u = -taps[0];
            while u <= taps[0] {
                let dx = u * step;
                u += 1;
                if dx == 0 && dy == 0 {
                    continue;
                }
                let x = (at as isize + dx) as usize;
                let near = load(shape.row(row, NEARNESS), x);
                let mx = load(shape.row(row, NORMAL), x);
                let my = load(shape.row(row, NORMAL + 1), x);
                let mz = load(shape.row(row, NORMAL + 2), x);
                let roughness = load(self.light.row(row, ROUGHNESS), x);
                let r = load(self.light.row(row, 0), x);
                let g = load(self.light.row(row, 1), x);
                let b = load(self.light.row(row, 2), x);
                let (fx, fy) = (dx as f32, dy as f32);
                let [a, c, e] = [fx * fx, fx * fy, fy * fy];
                for i in 0..LANES {
                    let expected = own[i] + fx * slopes[0][i] + fy * slopes[1][i];
                    let off = (near[i] - expected) * stiffness[i];
                    let turned = 1.0 - (nx[i] * mx[i] + ny[i] * my[i] + nz[i] * mz[i]);
                    let other = (roughness[i] - rough[i]) * rougher;
                    let form = &ellipses.form;
                    let q = (a * form[0][i] + c * form[1][i] + e * form[2][i])
                        + (off * off + greater(turned, 0.0) * bend + other * other);
                    let rest = 1.0 - lesser(q, 1.0);
                    let weight = rest * rest;
                    weights[i] += weight;
                    sums[0][i] += weight * r[i];
                    sums[1][i] += weight * g[i];
                    sums[2][i] += weight * b[i];
                }
            }
        }
        for i in 0..LANES {
            let share = 1.0 / weights[i];
            for c in 0..3 {
                sums[c][i] *= share;
            }
        }
        sums
    }
}
