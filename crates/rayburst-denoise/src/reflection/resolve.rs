//! From one reflected ray for every 2×2 pixels to a picture of full size.
//!
//! A pixel takes the rays of the 3×3 blocks around for its own: each hit counts by how likely the pixel's
//! own lobe reflects it, over how likely it was that the ray was sent (Stachowiak: "Stochastic Screen-Space
//! Reflections", SIGGRAPH 2015 courses; "Stochastic All The Things: Raytracing in Hybrid Real-Time
//! Rendering", Digital Dragons 2018). Dividing by the sum of the weights is the ratio estimator: what comes
//! out is light without the surface's reflectance, and has no noise where all hits are equally bright.

use glam::Vec3;
use rayburst_image::{Plane, Plane3};
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use super::{FARTHEST, coordinate};
use crate::{
    Result, checks,
    lanes::{LANES, Lanes, greater, lesser, light, load, luminance, store},
    scratch::{BAND, MARGIN, Scratch, ScratchBand, band_rows, fit, padded_row},
};

/// Reflected rays, one for every block of 2×2 pixels: planes half as wide and half as high as the picture,
/// rounded up.
#[derive(Clone, Copy, Debug)]
pub struct ReflectionRays<'a> {
    /// Where the rays begin, world space.
    pub origin: &'a Plane3,
    /// Where they go, unit vectors.
    pub direction: &'a Plane3,
    /// How far they go, world units; infinite where they leave the scene.
    pub distance: &'a Plane,
    /// Density by which their directions were chosen, over solid angle; 0 where there is no ray.
    pub pdf: &'a Plane,
    /// Radiance that arrives along them.
    pub radiance: &'a Plane3,
}

/// The surfaces that reflect, at full size.
#[derive(Clone, Copy, Debug)]
pub struct ReflectionSurface<'a> {
    /// Position, world space.
    pub position: &'a Plane3,
    /// Unit normal of shading; zero where nothing is.
    pub normal: &'a Plane3,
    /// Perceptual roughness, the root of GGX's α.
    pub roughness: &'a Plane,
    /// Diameter of the pixel's cone at the surface, world units.
    pub footprint: &'a Plane,
    /// Where the eye is.
    pub eye: Vec3,
}

/// How a [`ReflectionResolve`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectionSettings {
    /// How far off a pixel's plane rays may begin, footprints.
    pub plane_distance: f32,
    /// The most that a ray counts: lobes that are much narrower than what was sampled are noisy.
    pub most_weight: f32,
}

impl Default for ReflectionSettings {
    fn default() -> Self {
        Self { plane_distance: 4.0, most_weight: 8.0 }
    }
}

impl ReflectionSettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        let name = "the distance from the plane";
        checks::setting(name, self.plane_distance, (1e-3, 1e6), "from 0.001 to 1000000")?;
        checks::setting("the most weight", self.most_weight, (1e-3, 1e6), "from 0.001 to 1000000")
    }
}

/// Reflections at full size.
#[derive(Clone, Debug, Default)]
pub struct Resolved {
    /// Light that the lobe sees on average; black where nothing is.
    pub radiance: Plane3,
    /// How far it comes, world units: the reciprocal of the mean reciprocal, no more than 10⁹.
    pub distance: Plane,
    /// Variance of the radiance's luminance, of what the rays differ in.
    pub variance: Plane,
}

/// Resolves reflected rays to full size.
#[derive(Clone, Debug)]
pub struct ReflectionResolve {
    isa: IsaLevel,
    rays: Scratch,
}

/// Channels of the rays, each value twice in a row.
const HIT: usize = 0;
const ORIGIN: usize = 3;
const RADIANCE: usize = 6;
const SHARE: usize = 9;
const NEARNESS: usize = 10;
const CHANNELS: usize = 11;

/// Narrower lobes are taken to be this wide: single precision tells no more of them, and pixels are wider.
const LEAST_ALPHA: f32 = 5e-3;

impl ReflectionResolve {
    /// For an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        Self { isa, rays: Scratch::default() }
    }

    /// Resolves rays for surfaces; planes of `out` get the surfaces' size. Rays with numbers that are none
    /// count as none; radiance that is negative or not a number counts as black.
    pub fn resolve(
        &mut self,
        rays: &ReflectionRays<'_>,
        surface: &ReflectionSurface<'_>,
        settings: &ReflectionSettings,
        out: &mut Resolved,
    ) -> Result<()> {
        settings.check()?;
        let size = surface.roughness.size();
        checks::picture(size)?;
        let half = (size.0.div_ceil(2), size.1.div_ceil(2));
        checks::size("the footprint", surface.footprint.size(), size)?;
        checks::size("the rays' distance", rays.distance.size(), half)?;
        checks::size("the rays' density", rays.pdf.size(), half)?;
        for c in 0..3 {
            checks::size("the position", surface.position.channels[c].size(), size)?;
            checks::size("the normal", surface.normal.channels[c].size(), size)?;
            checks::size("the rays' origin", rays.origin.channels[c].size(), half)?;
            checks::size("the rays' direction", rays.direction.channels[c].size(), half)?;
            checks::size("the rays' radiance", rays.radiance.channels[c].size(), half)?;
            fit(&mut out.radiance.channels[c], size)?;
        }
        fit(&mut out.distance, size)?;
        fit(&mut out.variance, size)?;
        self.rays.resize((2 * half.0, half.1), CHANNELS);
        let isa = self.isa;
        self.rays.bands_mut().for_each(|band| isa.dispatch(Spread { rays, band }));
        let rays = &self.rays;
        let [r, g, b] = &mut out.radiance.channels;
        let bands = band_rows(r).zip(band_rows(g)).zip(band_rows(b));
        let bands = bands.zip(band_rows(&mut out.distance)).zip(band_rows(&mut out.variance));
        bands.enumerate().for_each(|(i, ((((r, g), b), distance), variance))| {
            let (top, out) = (i * BAND, [r, g, b, distance, variance]);
            isa.dispatch(Gather { rays, surface, settings, top, out });
        });
        Ok(())
    }
}

/// Writes every ray twice, so that pixels and rays are side by side.
struct Spread<'a> {
    rays: &'a ReflectionRays<'a>,
    band: ScratchBand<'a>,
}

impl Kernel for Spread<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let width = self.rays.pdf.width() as usize;
        for y in self.band.rows() {
            let distance = &padded_row(self.rays.distance, y)[..width];
            for axis in 0..3 {
                let origin = &padded_row(&self.rays.origin.channels[axis], y)[..width];
                let direction = &padded_row(&self.rays.direction.channels[axis], y)[..width];
                let radiance = &padded_row(&self.rays.radiance.channels[axis], y)[..width];
                let out = self.band.row_mut(y, HIT + axis);
                let out = &mut out[MARGIN..][..2 * width];
                for x in 0..width {
                    let far = greater(lesser(distance[x], FARTHEST), 0.0);
                    let hit = coordinate(coordinate(origin[x]) + direction[x] * far);
                    (out[2 * x], out[2 * x + 1]) = (hit, hit);
                }
                let out = &mut self.band.row_mut(y, ORIGIN + axis)[MARGIN..][..2 * width];
                for x in 0..width {
                    let origin = coordinate(origin[x]);
                    (out[2 * x], out[2 * x + 1]) = (origin, origin);
                }
                let out = &mut self.band.row_mut(y, RADIANCE + axis)[MARGIN..][..2 * width];
                for x in 0..width {
                    let radiance = light(radiance[x]);
                    (out[2 * x], out[2 * x + 1]) = (radiance, radiance);
                }
            }
            let pdf = &padded_row(self.rays.pdf, y)[..width];
            let out = &mut self.band.row_mut(y, SHARE)[MARGIN..][..2 * width];
            for x in 0..width {
                let there = pdf[x] > 1e-12 && pdf[x] < 1e12 && distance[x] >= 0.0;
                let share = if there { 1.0 / pdf[x] } else { 0.0 };
                (out[2 * x], out[2 * x + 1]) = (share, share);
            }
            let out = &mut self.band.row_mut(y, NEARNESS)[MARGIN..][..2 * width];
            for x in 0..width {
                let nearness = 1.0 / greater(lesser(distance[x], FARTHEST), 1e-9);
                (out[2 * x], out[2 * x + 1]) = (nearness, nearness);
            }
            self.band.extend(y);
            // Nothing is beyond the picture.
            let share = self.band.row_mut(y, SHARE);
            share[..MARGIN].fill(0.0);
            share[MARGIN + 2 * width..].fill(0.0);
        }
    }
}

/// Gathers the rays around the pixels of some rows.
struct Gather<'a> {
    rays: &'a Scratch,
    surface: &'a ReflectionSurface<'a>,
    settings: &'a ReflectionSettings,
    top: usize,
    out: [&'a mut [f32]; 5],
}

/// Sixteen pixels' lobes.
struct Lobes {
    position: [Lanes; 3],
    normal: [Lanes; 3],
    /// Towards the eye.
    view: [Lanes; 3],
    /// Cosine between both.
    facing: Lanes,
    alpha2: Lanes,
    /// Part of the masking term that does not depend on the light.
    masking: Lanes,
    /// One over how far off the plane rays may begin.
    stiffness: Lanes,
}

impl Kernel for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let stride = self.surface.roughness.stride();
        for row in 0..self.out[0].len() / stride {
            let y = self.top + row;
            for x in (0..stride).step_by(LANES) {
                let lobes = self.lobes(y, x);
                let found = self.gather(y, x, &lobes);
                for c in 0..5 {
                    store(self.out[c], row * stride + x, &found[c]);
                }
            }
        }
    }
}

impl Gather<'_> {
    #[inline(always)]
    fn lobes(&self, y: usize, x: usize) -> Lobes {
        let zero = [0.0; LANES];
        let mut lobes = Lobes {
            position: [zero; 3],
            normal: [zero; 3],
            view: [zero; 3],
            facing: zero,
            alpha2: zero,
            masking: zero,
            stiffness: zero,
        };
        let eye = self.surface.eye.to_array();
        let roughness = load(padded_row(self.surface.roughness, y), x);
        let footprint = load(padded_row(self.surface.footprint, y), x);
        let mut length = zero;
        for axis in 0..3 {
            let position = load(padded_row(&self.surface.position.channels[axis], y), x);
            let normal = load(padded_row(&self.surface.normal.channels[axis], y), x);
            for i in 0..LANES {
                lobes.position[axis][i] = coordinate(position[i]);
                let inside = normal[i].abs() < 2.0;
                lobes.normal[axis][i] = if inside { normal[i] } else { 0.0 };
                let view = eye[axis] - lobes.position[axis][i];
                lobes.view[axis][i] = view;
                length[i] += view * view;
            }
        }
        for i in 0..LANES {
            let scale = 1.0 / greater(length[i], 1e-30).sqrt();
            let mut facing = 0.0;
            for axis in 0..3 {
                lobes.view[axis][i] *= scale;
                facing += lobes.view[axis][i] * lobes.normal[axis][i];
            }
            lobes.facing[i] = lesser(greater(facing, 1e-3), 1.0);
            let roughness = lesser(greater(roughness[i], 0.0), 1.0);
            let alpha = greater(roughness * roughness, LEAST_ALPHA);
            let alpha2 = alpha * alpha;
            lobes.alpha2[i] = alpha2;
            let facing2 = lobes.facing[i] * lobes.facing[i];
            lobes.masking[i] = (facing2 * (1.0 - alpha2) + alpha2).sqrt();
            let footprint = lesser(greater(footprint[i], 1e-12), 1e12);
            lobes.stiffness[i] = 1.0 / (footprint * self.settings.plane_distance);
        }
        lobes
    }

    /// Radiance, distance and variance.
    #[inline(always)]
    fn gather(&self, y: usize, x: usize, lobes: &Lobes) -> [Lanes; 5] {
        let mut sums = [[0.0; LANES]; 3];
        let mut nearness = [0.0; LANES];
        let mut squares = [0.0; LANES];
        let mut weights = [0.0; LANES];
        let mut weights2 = [0.0; LANES];
        let mut j = -1;
        while j <= 1 {
            let row = (y / 2) as isize + j;
            j += 1;
            if row < 0 || row >= self.rays.height() as isize {
                continue;
            }
            for i in 0..3 {
                let (row, at) = (row as usize, MARGIN + x + 2 * i - 2);
                let weight = self.weigh(row, at, lobes);
                let r = load(self.rays.row(row, RADIANCE), at);
                let g = load(self.rays.row(row, RADIANCE + 1), at);
                let b = load(self.rays.row(row, RADIANCE + 2), at);
                let near = load(self.rays.row(row, NEARNESS), at);
                for i in 0..LANES {
                    let luma = luminance(r[i], g[i], b[i]);
                    sums[0][i] += weight[i] * r[i];
                    sums[1][i] += weight[i] * g[i];
                    sums[2][i] += weight[i] * b[i];
                    nearness[i] += weight[i] * near[i];
                    squares[i] += weight[i] * (luma * luma);
                    weights[i] += weight[i];
                    weights2[i] += weight[i] * weight[i];
                }
            }
        }
        let mut distance = [0.0; LANES];
        let mut variance = [0.0; LANES];
        for i in 0..LANES {
            let mut length = 0.0;
            for axis in 0..3 {
                length += lobes.normal[axis][i] * lobes.normal[axis][i];
            }
            let there = length > 0.25 && weights[i] > 0.0;
            let share = if there { 1.0 / weights[i] } else { 0.0 };
            for c in 0..3 {
                sums[c][i] *= share;
            }
            let near = nearness[i] * share;
            distance[i] = if there { 1.0 / greater(near, 1.0 / FARTHEST) } else { 0.0 };
            let mean = luminance(sums[0][i], sums[1][i], sums[2][i]);
            let spread = greater(squares[i] * share - mean * mean, 0.0);
            variance[i] = spread * (weights2[i] * share * share);
        }
        [sums[0], sums[1], sums[2], distance, variance]
    }

    /// What a ray counts for sixteen pixels: the GGX lobe's value times the cosine (Walter et al.:
    /// "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007; Heitz: "Understanding the
    /// Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 2014), without Fresnel's term, over the
    /// ray's density.
    #[inline(always)]
    fn weigh(&self, row: usize, at: usize, lobes: &Lobes) -> Lanes {
        let hit = [
            load(self.rays.row(row, HIT), at),
            load(self.rays.row(row, HIT + 1), at),
            load(self.rays.row(row, HIT + 2), at),
        ];
        let origin = [
            load(self.rays.row(row, ORIGIN), at),
            load(self.rays.row(row, ORIGIN + 1), at),
            load(self.rays.row(row, ORIGIN + 2), at),
        ];
        let share = load(self.rays.row(row, SHARE), at);
        let mut weight = [0.0; LANES];
        for i in 0..LANES {
            let (mut length, mut to_light, mut to_view, mut off) = (0.0, 0.0, 0.0, 0.0);
            for axis in 0..3 {
                let (normal, position) = (lobes.normal[axis][i], lobes.position[axis][i]);
                let towards = hit[axis][i] - position;
                length += towards * towards;
                to_light += towards * normal;
                to_view += towards * lobes.view[axis][i];
                off += (origin[axis][i] - position) * normal;
            }
            let scale = 1.0 / greater(length, 1e-30).sqrt();
            let (to_light, to_view) = (to_light * scale, to_view * scale);
            let facing = lobes.facing[i];
            // The half vector's cosine, squared.
            let sum = to_light + facing;
            let half = lesser(sum * sum / greater(2.0 + 2.0 * to_view, 1e-6), 1.0);
            let alpha2 = lobes.alpha2[i];
            let core = 1.0 - half + half * alpha2;
            let masking = (to_light * to_light * (1.0 - alpha2) + alpha2).sqrt();
            let below = to_light * lobes.masking[i] + facing * masking;
            let lobe = to_light * alpha2 / (core * core * below);
            let likely = lobe * (0.5 / std::f32::consts::PI) * share[i];
            let likely = if to_light > 0.0 { likely } else { 0.0 };
            let off = off * lobes.stiffness[i];
            let same = greater(1.0 - off * off, 0.0);
            let counts = (lesser(likely, self.settings.most_weight) + LEAST_LIKELY) * same + LAST;
            weight[i] = if share[i] > 0.0 { counts } else { 0.0 };
        }
        weight
    }
}

/// What rays of the same surface count at least, and what all rays do: where there are no better ones.
const LEAST_LIKELY: f32 = 1e-4;
const LAST: f32 = 1e-9;
