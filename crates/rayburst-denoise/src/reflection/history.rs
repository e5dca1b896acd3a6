//! Reflections are accumulated along the motion of what is reflected.
//!
//! What a mirror shows is where its virtual image is: behind the surface, as far as the reflected ray went.
//! That point on the eye's ray is looked up in the frame before (Stachowiak: "Stochastic Screen-Space
//! Reflections", SIGGRAPH 2015 courses; Zhdan: "Fast Denoising with Self-Stabilizing Recurrent Blurs", GDC
//! 2020). It holds for flat mirrors and what stands still; where the frame before saw another distance
//! there, its light is not taken. The rougher a surface, the more its reflection moves with itself.

use glam::Mat4;
use rayburst_image::{Plane, Plane3};
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use super::{FARTHEST, coordinate};
use crate::{
    Guides, Result, Taps, checks,
    clip::{Blend, Blended, from_ycocg},
    lanes::{LANES, Lanes, greater, lesser, load, store},
    neighbourhood::Neighbourhood,
    scratch::{BAND, MARGIN, band_rows, fit, padded_row},
    texels::{Texel, Texels},
};

/// A frame of reflections.
#[derive(Clone, Copy, Debug)]
pub struct ReflectionFrame<'a> {
    /// Demodulated radiance.
    pub radiance: &'a Plane3,
    /// How far it comes from the surface, world units.
    pub distance: &'a Plane,
    /// Perceptual roughness.
    pub roughness: &'a Plane,
    /// Position of the surface, world space.
    pub position: &'a Plane3,
    /// Maps points of the world (as columns, with a fourth coordinate of one) to pixels times w, Y down, and
    /// w; without jitter.
    pub world_to_pixel: Mat4,
    /// The same of the frame before.
    pub world_to_pixel_before: Mat4,
}

/// How a [`ReflectionHistory`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectionHistorySettings {
    /// The most frames that a history counts for.
    pub longest: f32,
    /// Up to this roughness reflections move with their virtual image alone.
    pub sharp: f32,
    /// From this roughness on they move with the surface alone.
    pub broad: f32,
    /// Difference of distances, as a share of them, at which the frame before saw something else; of rough
    /// surfaces as much more as they are rough.
    pub distance: f32,
    /// Deviations of the 3×3 pixels around that the history may be off their mean.
    pub deviations: f32,
}

impl Default for ReflectionHistorySettings {
    fn default() -> Self {
        Self { longest: 16.0, sharp: 0.2, broad: 0.6, distance: 0.2, deviations: 4.0 }
    }
}

impl ReflectionHistorySettings {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        checks::setting("the longest history", self.longest, (0.0, 65536.0), "from 0 to 65536")?;
        checks::setting("the sharp roughness", self.sharp, (0.0, 2.0), "from 0 to 2")?;
        let range = (self.sharp + 1e-3, 3.0);
        checks::setting("the broad roughness", self.broad, range, "more than the sharp one, to 3")?;
        checks::setting("the distance", self.distance, (1e-3, 1e3), "from 0.001 to 1000")?;
        checks::setting("the deviations", self.deviations, (0.0, 1e6), "from 0 to 1000000")
    }
}

/// Accumulates reflections over time.
#[derive(Clone, Debug)]
pub struct ReflectionHistory {
    isa: IsaLevel,
    frame: Neighbourhood,
    now: Kept,
    before: Kept,
}

/// What is kept of a frame.
#[derive(Clone, Debug, Default)]
struct Kept {
    /// Luma, chromas and number of frames.
    light: Texels,
    /// Reciprocal of the distance, and the object.
    about: Texels,
}

impl ReflectionHistory {
    /// Without a history, for an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        let (now, before) = (Kept::default(), Kept::default());
        Self { isa, frame: Neighbourhood::default(), now, before }
    }

    /// Forgets the history: for cuts.
    pub fn reset(&mut self) {
        self.now.light.fill([0.0; 4]);
    }

    /// Takes a frame in, and gives the accumulated radiance; `out` gets its size. `taps` are where surfaces
    /// were found in the frame before. After a change of size there is no history. Radiance that is
    /// negative or not a number counts as black.
    pub fn accumulate(
        &mut self,
        frame: &ReflectionFrame<'_>,
        guides: &Guides<'_>,
        taps: &Plane<Taps>,
        settings: &ReflectionHistorySettings,
        out: &mut Plane3,
    ) -> Result<()> {
        settings.check()?;
        let size = guides.size();
        checks::size("the taps", taps.size(), size)?;
        checks::size("the distance", frame.distance.size(), size)?;
        checks::size("the roughness", frame.roughness.size(), size)?;
        for channel in &frame.position.channels {
            checks::size("the position", channel.size(), size)?;
        }
        self.frame.take(self.isa, frame.radiance, guides)?;
        for channel in &mut out.channels {
            fit(channel, size)?;
        }
        std::mem::swap(&mut self.now, &mut self.before);
        self.before.about.resize(size);
        if self.before.light.resize(size) {
            self.before.light.fill([0.0; 4]);
        }
        self.now.light.resize(size);
        self.now.about.resize(size);
        let (isa, around, before, object) = (self.isa, &self.frame, &self.before, guides.object);
        let Kept { light, about } = &mut self.now;
        let [r, g, b] = &mut out.channels;
        let bands = band_rows(r).zip(band_rows(g)).zip(band_rows(b));
        let bands = bands.zip(light.bands_mut()).zip(about.bands_mut());
        bands.enumerate().for_each(|(i, ((((r, g), b), light), about))| {
            let (top, out) = (i * BAND, [r, g, b]);
            isa.dispatch(Accumulate {
                frame,
                around,
                object,
                taps,
                before,
                settings,
                top,
                out,
                light,
                about,
            });
        });
        Ok(())
    }
}

struct Accumulate<'a> {
    frame: &'a ReflectionFrame<'a>,
    around: &'a Neighbourhood,
    object: &'a Plane<u32>,
    taps: &'a Plane<Taps>,
    before: &'a Kept,
    settings: &'a ReflectionHistorySettings,
    top: usize,
    out: [&'a mut [f32]; 3],
    light: &'a mut [Texel],
    about: &'a mut [Texel],
}

impl Kernel for Accumulate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        let width = self.before.light.width();
        let (stride, settings) = (self.object.stride(), self.settings);
        let (deviations, longest) = (settings.deviations, settings.longest);
        let blend = Blend { deviations, longest, dimming: 0.0 };
        let mut blended = Blended::EMPTY;
        blended.weight = [1.0; LANES];
        let mut found = [[0.0; LANES]; 4];
        for row in 0..self.light.len() / width {
            let y = self.top + row;
            for x in (0..width).step_by(LANES) {
                let at = MARGIN + x;
                let (mean, deviation) = (&mut blended.mean, &mut blended.deviation);
                self.around.statistics(y, at, mean, deviation);
                for c in 0..3 {
                    blended.now[c] = load(self.around.colour().row(y, c), at);
                }
                self.history(y, x, row, &mut blended.history);
                blended.blend(&blend, &mut found);
                let mut colour = [[0.0; LANES]; 3];
                for i in 0..LANES {
                    let rgb = from_ycocg([found[0][i], found[1][i], found[2][i]]);
                    for c in 0..3 {
                        colour[c][i] = greater(rgb[c], 0.0);
                    }
                }
                for c in 0..3 {
                    store(self.out[c], row * stride + x, &colour[c]);
                }
                for i in 0..LANES.min(width - x) {
                    self.light[row * width + x + i] =
                        [found[0][i], found[1][i], found[2][i], found[3][i]];
                }
            }
        }
    }
}

impl Accumulate<'_> {
    /// What the histories of sixteen pixels are; keeps what the next frame is to know of the pixels.
    #[inline(always)]
    fn history(&mut self, y: usize, x: usize, row: usize, history: &mut [Lanes; 4]) {
        let width = self.before.light.width();
        let (settings, lanes) = (self.settings, LANES.min(width - x));
        let mut distance = load(padded_row(self.frame.distance, y), x);
        let mut roughness = load(padded_row(self.frame.roughness, y), x);
        let mut nearness = [0.0; LANES];
        let mut share = [0.0; LANES];
        let mut object = [0.0; LANES];
        let objects = &self.object.values()[y * self.object.stride() + x..][..LANES];
        let steep = 1.0 / (settings.broad - settings.sharp);
        for i in 0..LANES {
            distance[i] = greater(lesser(distance[i], FARTHEST), 1.0 / FARTHEST);
            nearness[i] = 1.0 / distance[i];
            roughness[i] = lesser(greater(roughness[i], 0.0), 1.0);
            let ramp = lesser(greater((roughness[i] - settings.sharp) * steep, 0.0), 1.0);
            share[i] = ramp * ramp * (3.0 - 2.0 * ramp);
            object[i] = (objects[i] & 0xff_ffff) as f32;
        }
        let images = self.images(y, x, &distance);
        let mut seen = [[0.0; LANES], [-1.0; LANES]];
        for i in 0..lanes {
            let (u, v) = (images[0][i], images[1][i]);
            if share[i] < 1.0 && self.before.light.contains(u, v) {
                let about = self.before.about.near((u + 4.5) as i32 - 4, (v + 4.5) as i32 - 4);
                (seen[0][i], seen[1][i]) = (about[0], about[1]);
            }
        }
        let mut weight = [0.0; LANES];
        for i in 0..LANES {
            let most = greater(greater(seen[0][i], nearness[i]), 1.0 / FARTHEST);
            let room = most * (settings.distance + roughness[i]);
            let off = (seen[0][i] - nearness[i]) / room;
            let alike = greater(1.0 - off * off, 0.0) * (1.0 - share[i]);
            weight[i] = if seen[1][i] == object[i] { alike } else { 0.0 };
        }
        for c in 0..4 {
            history[c] = [0.0; LANES];
        }
        for i in 0..lanes {
            let mut sum = [0.0; 4];
            if weight[i] > 0.0 {
                sum = self.before.light.cubic(images[0][i], images[1][i]);
                sum[3] = greater(sum[3], 0.0);
                for c in 0..4 {
                    sum[c] *= weight[i];
                }
            }
            if share[i] > 0.0 {
                let surface = self.surface(y * self.object.stride() + x + i);
                for c in 0..4 {
                    sum[c] += share[i] * surface[c];
                }
                weight[i] += if surface[3] > 0.0 { share[i] } else { 0.0 };
            }
            for c in 0..4 {
                history[c][i] = sum[c];
            }
            self.about[row * width + x + i] = [nearness[i], object[i], 0.0, 0.0];
        }
        for i in 0..LANES {
            let scale = 1.0 / greater(weight[i], 1e-6);
            for c in 0..3 {
                history[c][i] *= scale;
            }
        }
    }

    /// The history of a pixel's surface; zero without one.
    #[inline(always)]
    fn surface(&self, index: usize) -> Texel {
        let taps = self.taps.at(index);
        let mut sum = [0.0; 4];
        if taps.is_some() {
            let (x, y) = (taps.x as i32, taps.y as i32);
            for k in 0..4 {
                let texel = self.before.light.near(x + k % 2, y + k / 2);
                for c in 0..4 {
                    sum[c] += taps.weights[k as usize] * texel[c];
                }
            }
        }
        sum
    }

    /// Where the frame before saw what sixteen pixels' virtual images show, in pixels from the first one's
    /// centre; NaN where that is behind the eye.
    #[inline(always)]
    fn images(&self, y: usize, x: usize, distance: &Lanes) -> [Lanes; 2] {
        let frame = self.frame;
        let now = rows(&frame.world_to_pixel);
        let before = rows(&frame.world_to_pixel_before);
        let px = load(padded_row(&frame.position.channels[0], y), x);
        let py = load(padded_row(&frame.position.channels[1], y), x);
        let pz = load(padded_row(&frame.position.channels[2], y), x);
        let mut at = [[0.0; LANES]; 2];
        for i in 0..LANES {
            let point = [coordinate(px[i]), coordinate(py[i]), coordinate(pz[i])];
            let [u, v] = project(&now, point);
            // The eye's ray is what both rows of the matrix leave out.
            let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
            for axis in 0..3 {
                a[axis] = now[0][axis] - u * now[2][axis];
                b[axis] = now[1][axis] - v * now[2][axis];
            }
            let ray =
                [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            let length = (ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]).sqrt();
            let far = distance[i] / length;
            let image = [point[0] + far * ray[0], point[1] + far * ray[1], point[2] + far * ray[2]];
            let [q, r] = project(&before, image);
            at[0][i] = (x + i) as f32 + (q - u);
            at[1][i] = y as f32 + (r - v);
        }
        at
    }
}

/// Rows of a matrix that give x, y and w of points.
#[inline(always)]
fn rows(matrix: &Mat4) -> [[f32; 4]; 3] {
    let columns = matrix.to_cols_array_2d();
    let mut rows = [[0.0; 4]; 3];
    for axis in 0..4 {
        rows[0][axis] = columns[axis][0];
        rows[1][axis] = columns[axis][1];
        rows[2][axis] = columns[axis][3];
    }
    rows
}

/// Where a matrix maps a point to, in pixels; where that is behind the eye, nowhere.
#[inline(always)]
fn project(rows: &[[f32; 4]; 3], point: [f32; 3]) -> [f32; 2] {
    let mut mapped = [0.0; 3];
    for axis in 0..3 {
        let row = &rows[axis];
        mapped[axis] = (row[0] * point[0] + row[1] * point[1]) + (row[2] * point[2] + row[3]);
    }
    let share = if mapped[2] > 0.0 { 1.0 / mapped[2] } else { f32::NAN };
    [mapped[0] * share, mapped[1] * share]
}
