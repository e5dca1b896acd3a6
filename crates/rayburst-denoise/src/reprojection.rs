//! Where the surfaces of a frame were in the frame before, and what a history holds of them.
//!
//! Every pixel gets [`Taps`]: up to four pixels of the frame before around the point that its motion leads
//! to, with bilinear weights. A tap that shows another surface gets none, and the others share its weight;
//! if no tap is left, the nearest pixel of the right surface in the 3×3 around may stand in (Schied et al.:
//! "Spatiotemporal Variance-Guided Filtering", HPG 2017, section 4.1). Any number of planes is then
//! reprojected with one set of taps.

use rayburst_image::Plane;
use rayon::prelude::*;

use crate::{
    Guides, Result,
    error::check,
    slope::{Slope, slope},
    stack::{BAND, Stack},
};

/// Taps whose bilinear weights add up to less than this are not trusted.
const LEAST_WEIGHT: f32 = 0.01;

/// Pixels of the frame before that a pixel's history is made of: two by two, row by row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Taps {
    /// Column of the left ones.
    pub x: u32,
    /// Row of the upper ones.
    pub y: u32,
    /// Weights of the four: none is negative; they add up to one, or to zero without a history. Those of
    /// pixels outside the picture are zero.
    pub weights: [f32; 4],
}

impl Taps {
    /// No history.
    pub const NONE: Self = Self { x: 0, y: 0, weights: [0.0; 4] };

    /// Whether there is a history.
    #[inline(always)]
    pub fn is_some(&self) -> bool {
        self.weights[0] + self.weights[1] + self.weights[2] + self.weights[3] > 0.0
    }

    /// The average of a plane of the frame before; zero without a history. Pixels of weight zero are not
    /// looked at.
    #[inline]
    pub fn of(&self, plane: &Plane) -> f32 {
        let mut sum = 0.0;
        for (i, weight) in (0..).zip(self.weights) {
            let (x, y) = (self.x + i % 2, self.y + i / 2);
            if weight > 0.0 && x < plane.width() && y < plane.height() {
                sum += weight * plane.get(x, y);
            }
        }
        sum
    }

    /// The average of a channel of a stack; zero without a history. What the stack holds must be finite.
    #[inline(always)]
    pub(crate) fn of_channel(&self, stack: &Stack, channel: usize) -> f32 {
        let [a, b, c, d] = self.weights;
        let last = stack.size().1 - 1;
        let x = stack.margin() + self.x as usize;
        let upper = &stack.padded_row(channel, self.y.min(last))[x..x + 2];
        let lower = &stack.padded_row(channel, (self.y + 1).min(last))[x..x + 2];
        (a * upper[0] + b * upper[1]) + (c * lower[0] + d * lower[1])
    }
}

/// When a pixel of the frame before is taken to show the same surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTests {
    /// Most difference between a tap's depth and the expected one, as a share of the latter: 0 to 1.
    pub depth: f32,
    /// How many pixels of the surface's own change of depth are allowed on top of that: 0 to 100.
    pub slope: f32,
    /// Least cosine of the angle between normals: −1 to 1.
    pub normal: f32,
    /// Whether objects must be the same.
    pub object: bool,
    /// Whether the 3×3 pixels around are searched if no tap passes.
    pub search: bool,
}

impl Default for SurfaceTests {
    fn default() -> Self {
        Self { depth: 0.01, slope: 2.0, normal: 0.9, object: true, search: true }
    }
}

impl SurfaceTests {
    /// Fails where a setting is out of range.
    pub fn check(&self) -> Result<()> {
        check("the depth tolerance", self.depth, 0.0..=1.0, "from 0 to 1")?;
        check("the slope tolerance", self.slope, 0.0..=100.0, "from 0 to 100")?;
        check("the normals' least cosine", self.normal, -1.0..=1.0, "from −1 to 1")
    }
}

/// What a pixel showed.
#[derive(Clone, Copy, Debug, Default)]
struct Surface {
    depth: f32,
    normal: [f32; 3],
    object: u32,
}

impl Surface {
    #[inline(always)]
    fn at(guides: &Guides<'_>, index: usize) -> Self {
        let normal = guides.normal.at(index).to_array();
        Self { depth: guides.depth.at(index), normal, object: guides.object.at(index) }
    }

    /// Whether there is a surface at all.
    #[inline(always)]
    fn is_some(&self) -> bool {
        self.depth < f32::INFINITY && self.object != 0
    }

    /// Whether a pixel of the frame before shows the surface, expected at `depth` give or take `tolerance`.
    #[inline(always)]
    fn is_same(&self, before: &Self, depth: f32, tolerance: f32, tests: &SurfaceTests) -> bool {
        if !self.is_some() {
            return !before.is_some();
        }
        let ([a, b, c], [d, e, f]) = (self.normal, before.normal);
        (self.object == before.object || (!tests.object && before.is_some()))
            && (before.depth - depth).abs() <= tolerance
            && a * d + b * e + c * f >= tests.normal
    }
}

/// Remembers what the frame before showed, and finds the surfaces of the next frame in it.
#[derive(Clone, Debug, Default)]
pub struct Reprojection {
    before: Plane<Surface>,
    taps: Plane<Taps>,
    /// Whether `before` is a frame.
    started: bool,
}

impl Reprojection {
    /// Without a frame before.
    pub fn new() -> Self {
        Self::default()
    }

    /// Forgets the frame before: the next one finds nothing.
    pub fn reset(&mut self) {
        self.started = false;
    }

    /// Finds a frame's surfaces in the frame before, the one of the last call, and remembers this one. The
    /// first frame finds nothing, nor does the first of another size.
    pub fn advance(&mut self, guides: &Guides<'_>, tests: &SurfaceTests) -> Result<&Plane<Taps>> {
        guides.check()?;
        tests.check()?;
        let size @ (width, height) = guides.size();
        if self.taps.size() != size {
            self.taps = Plane::new(width, height)?;
            self.before = Plane::new(width, height)?;
            self.started = false;
        }
        let (before, started) = (&self.before, self.started);
        let stride = before.stride();
        let bands = self.taps.values_mut().par_chunks_mut(stride * BAND);
        bands.enumerate().for_each(|(band, taps)| {
            for (y, row) in (band * BAND..).zip(taps.chunks_mut(stride)) {
                for (x, taps) in row[..width as usize].iter_mut().enumerate() {
                    *taps = match started {
                        true => find(guides, before, tests, (x as u32, y as u32)),
                        false => Taps::NONE,
                    };
                }
            }
        });
        let bands = self.before.values_mut().par_chunks_mut(stride * BAND);
        bands.enumerate().for_each(|(band, surfaces)| {
            let start = band * BAND * stride;
            for (i, surface) in surfaces.iter_mut().enumerate() {
                *surface = Surface::at(guides, start + i);
            }
        });
        self.started = true;
        Ok(&self.taps)
    }

    /// What the last frame found; empty before the first.
    pub fn taps(&self) -> &Plane<Taps> {
        &self.taps
    }
}

/// Where the surface of a pixel was in the frame before.
#[inline]
fn find(
    guides: &Guides<'_>,
    before: &Plane<Surface>,
    tests: &SurfaceTests,
    (x, y): (u32, u32),
) -> Taps {
    let (width, height) = before.size();
    let index = before.index(x, y);
    let surface = Surface::at(guides, index);
    let px = snap(x as f32 + guides.motion[0].at(index));
    let py = snap(y as f32 + guides.motion[1].at(index));
    // False for NaN, too.
    let inside = px >= -0.5 && px <= width as f32 - 0.5 && py >= -0.5 && py <= height as f32 - 0.5;
    if !inside {
        return Taps::NONE;
    }
    let depth = surface.depth + guides.depth_motion.map_or(0.0, |plane| plane.at(index));
    let Slope { x: dx, y: dy } = slope(guides.depth, x, y);
    let tolerance = tests.depth * depth.abs() + tests.slope * (dx.abs() + dy.abs());
    let shows = |x: u32, y: u32| surface.is_same(&before.get(x, y), depth, tolerance, tests);

    let left = (px.max(0.0) as u32).min(width.saturating_sub(2));
    let top = (py.max(0.0) as u32).min(height.saturating_sub(2));
    let mut taps = Taps { x: left, y: top, weights: [0.0; 4] };
    let mut sum = 0.0;
    for (i, weight) in (0..).zip(&mut taps.weights) {
        let (x, y) = (left + i % 2, top + i / 2);
        if x < width && y < height {
            let bilinear = tent(x as f32 - px) * tent(y as f32 - py);
            if bilinear > 0.0 && shows(x, y) {
                *weight = bilinear;
                sum += bilinear;
            }
        }
    }
    if sum >= LEAST_WEIGHT {
        for weight in &mut taps.weights {
            *weight /= sum;
        }
        return taps;
    }
    if tests.search { search((px, py), (width, height), shows) } else { Taps::NONE }
}

/// The pixel of the 3×3 around a point that is nearest to it and shows the surface; the first such.
fn search(
    (px, py): (f32, f32),
    (width, height): (u32, u32),
    shows: impl Fn(u32, u32) -> bool,
) -> Taps {
    let (cx, cy) = ((px + 0.5) as u32, (py + 0.5) as u32);
    let mut nearest = (f32::INFINITY, Taps::NONE);
    for y in cy.saturating_sub(1)..(cy + 2).min(height) {
        for x in cx.saturating_sub(1)..(cx + 2).min(width) {
            let (dx, dy) = (x as f32 - px, y as f32 - py);
            let distance = dx * dx + dy * dy;
            if distance < nearest.0 && shows(x, y) {
                nearest = (distance, single(x, y, (width, height)));
            }
        }
    }
    nearest.1
}

/// One pixel with all the weight.
fn single(x: u32, y: u32, (width, height): (u32, u32)) -> Taps {
    let (left, top) = (x.min(width.saturating_sub(2)), y.min(height.saturating_sub(2)));
    let mut weights = [0.0; 4];
    weights[(x - left + 2 * (y - top)) as usize] = 1.0;
    Taps { x: left, y: top, weights }
}

/// Rounds to the next 256th, so that a point which should be in the middle of a pixel is, whatever the motion's
/// rounding: neighbours then have their taps side by side. Coarser beyond 16384.
#[inline(always)]
fn snap(x: f32) -> f32 {
    (x + 49_152.0) - 49_152.0
}

/// One at zero, falling to zero at one.
#[inline(always)]
fn tent(x: f32) -> f32 {
    (1.0 - x.abs()).max(0.0)
}

/// Reprojects a plane of the frame before; pixels without a history get `missing`.
pub fn reproject(taps: &Plane<Taps>, before: &Plane, missing: f32, now: &mut Plane) -> Result<()> {
    same_size("the plane before", before.size(), taps.size())?;
    same_size("the plane now", now.size(), taps.size())?;
    let stride = taps.stride();
    let bands = now.values_mut().par_chunks_mut(stride * BAND);
    bands.zip(taps.values().par_chunks(stride * BAND)).for_each(|(now, taps)| {
        for (now, taps) in now.iter_mut().zip(taps) {
            *now = if taps.is_some() { taps.of(before) } else { missing };
        }
    });
    Ok(())
}

/// Fails where a plane has another size than the picture.
pub(crate) fn same_size(name: &'static str, found: (u32, u32), expected: (u32, u32)) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(crate::DenoiseError::Mismatch { name, found, expected })
}
