//! What filters that stay on a surface need to know of it, prepared once for a frame.

use rayburst_image::Plane;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Guides, Result, checks,
    lanes::{LANES, Lanes, greater, lesser, load, store},
    scratch::{MARGIN, Scratch, ScratchBand, padded_row},
};

/// How far pixels may be apart that filters take for the same surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTolerance {
    /// Distance in depth from the plane through a pixel, in lengths of a pixel on the surface.
    pub depth: f32,
    /// Angle between normals, radians.
    pub angle: f32,
}

impl Default for SurfaceTolerance {
    fn default() -> Self {
        Self { depth: 2.0, angle: 0.5 }
    }
}

impl SurfaceTolerance {
    /// Fails if a setting is out of its range.
    pub fn check(&self) -> Result<()> {
        checks::setting("the depth's tolerance", self.depth, (1e-3, 1e3), "from 0.001 to 1000")?;
        checks::setting("the angle", self.angle, (1e-3, 1.57), "from 0.001 to π/2")
    }

    /// What depths that are off by so many lengths, and one minus the cosine between normals, are
    /// multiplied by: where the result is 1, surfaces are others.
    pub(crate) fn factors(&self) -> [f32; 2] {
        [1.0 / self.depth, 1.0 / (1.0 - self.angle.cos())]
    }
}

/// The surfaces that pixels show, as filters of space compare them: prepared once for a frame and used by
/// all of its filters.
///
/// On a plane the reciprocal of the depth is linear over a perspective picture, so a pixel and the slope at
/// it say how deep its neighbours are if they show the same plane.
#[derive(Clone, Debug)]
pub struct Surfaces {
    isa: IsaLevel,
    size: (u32, u32),
    shape: Scratch,
    local: Scratch,
}

/// Channels of [`Surfaces::shape`]: the reciprocal of the depth, 0 where nothing is, and the normal.
pub(crate) const NEARNESS: usize = 0;
pub(crate) const NORMAL: usize = 1;
/// Channels of [`Surfaces::local`], first along X, then along Y: the slope of the nearness, what turns a
/// difference of nearness into lengths of a pixel, and that length, world units; then the footprint.
pub(crate) const SLOPE: usize = 0;
pub(crate) const STIFFNESS: usize = 2;
pub(crate) const STEP: usize = 4;
pub(crate) const ACROSS: usize = 6;

/// Depths from here on are taken for nothing.
const FARTHEST: f32 = 1e12;
/// Depths below are taken for this.
const NEAREST: f32 = 1e-6;

impl Surfaces {
    /// For an instruction set; of no picture yet.
    pub fn new(isa: IsaLevel) -> Self {
        Self { isa, size: (0, 0), shape: Scratch::default(), local: Scratch::default() }
    }

    /// Width and height of the frame that was prepared last.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Prepares a frame. `footprint` is the diameter of a pixel's cone at the surface, world units. Where
    /// the depth is not a positive number, nothing is.
    pub fn prepare(&mut self, guides: &Guides<'_>, footprint: &Plane) -> Result<()> {
        guides.check()?;
        let size = guides.size();
        checks::picture(size)?;
        checks::size("the footprint", footprint.size(), size)?;
        for channel in &guides.normal.channels {
            checks::size("the normal", channel.size(), size)?;
        }
        self.size = size;
        self.shape.resize(size, 4);
        self.local.resize(size, 7);
        let isa = self.isa;
        self.shape.bands_mut().for_each(|band| isa.dispatch(Shape { guides, band }));
        let shape = &self.shape;
        self.local.bands_mut().for_each(|band| isa.dispatch(Local { shape, footprint, band }));
        Ok(())
    }

    pub(crate) fn shape(&self) -> &Scratch {
        &self.shape
    }

    pub(crate) fn local(&self) -> &Scratch {
        &self.local
    }

    /// Fails unless a plane has the size of the frame that was prepared.
    pub(crate) fn check(&self, name: &'static str, found: (u32, u32)) -> Result<()> {
        checks::picture(self.size)?;
        checks::size(name, found, self.size)
    }
}

/// Fills in the nearness and the normals.
struct Shape<'a> {
    guides: &'a Guides<'a>,
    band: ScratchBand<'a>,
}

impl Kernel for Shape<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for y in self.band.rows() {
            let depth = padded_row(self.guides.depth, y);
            let out = &mut self.band.row_mut(y, NEARNESS)[MARGIN..][..depth.len()];
            for x in 0..depth.len() {
                let there = depth[x] > 0.0 && depth[x] < FARTHEST;
                let nearness = 1.0 / greater(depth[x], NEAREST);
                out[x] = if there { nearness } else { 0.0 };
            }
            for axis in 0..3 {
                let normal = padded_row(&self.guides.normal.channels[axis], y);
                let out = &mut self.band.row_mut(y, NORMAL + axis)[MARGIN..][..normal.len()];
                for x in 0..normal.len() {
                    let inside = normal[x] > -2.0 && normal[x] < 2.0;
                    out[x] = if inside { normal[x] } else { 0.0 };
                }
            }
            self.band.extend(y);
            // Nothing is beyond the picture.
            let row = self.band.row_mut(y, NEARNESS);
            row[..MARGIN].fill(0.0);
            row[MARGIN + self.guides.depth.width() as usize..].fill(0.0);
        }
    }
}

/// Fills in what is known of a pixel's plane.
struct Local<'a> {
    shape: &'a Scratch,
    footprint: &'a Plane,
    band: ScratchBand<'a>,
}

/// The lesser of the slopes to either side.
#[inline(always)]
fn slopes(before: &Lanes, own: &Lanes, after: &Lanes) -> Lanes {
    let mut slopes = [0.0; LANES];
    for i in 0..LANES {
        let (back, forth) = (own[i] - before[i], after[i] - own[i]);
        slopes[i] = if back.abs() < forth.abs() { back } else { forth };
    }
    slopes
}

impl Kernel for Local<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for y in self.band.rows() {
            let own_row = self.shape.row(y, NEARNESS);
            let above = y.checked_sub(1);
            let below = Some(y + 1).filter(|&y| y < self.shape.height());
            let footprint = padded_row(self.footprint, y);
            for x in (0..footprint.len()).step_by(LANES) {
                let at = MARGIN + x;
                let own = load(own_row, at);
                let (mut before, mut after) = ([0.0; LANES], [0.0; LANES]);
                if let Some(y) = above {
                    before = load(self.shape.row(y, NEARNESS), at);
                }
                if let Some(y) = below {
                    after = load(self.shape.row(y, NEARNESS), at);
                }
                let slope = [
                    slopes(&load(own_row, at - 1), &own, &load(own_row, at + 1)),
                    slopes(&before, &own, &after),
                ];
                let mut across = load(footprint, x);
                for i in 0..LANES {
                    across[i] = lesser(greater(across[i], 1e-12), FARTHEST);
                }
                store(self.band.row_mut(y, ACROSS), at, &across);
                for axis in 0..2 {
                    let mut stiffness = [0.0; LANES];
                    let mut step = [0.0; LANES];
                    for i in 0..LANES {
                        let nearness = greater(own[i], 1.0 / FARTHEST);
                        let square = 1.0 / (nearness * nearness);
                        // How much deeper the plane is a pixel farther.
                        let deeper = slope[axis][i] * square;
                        step[i] = (across[i] * across[i] + deeper * deeper).sqrt();
                        stiffness[i] = square / step[i];
                    }
                    store(self.band.row_mut(y, SLOPE + axis), at, &slope[axis]);
                    store(self.band.row_mut(y, STIFFNESS + axis), at, &stiffness);
                    store(self.band.row_mut(y, STEP + axis), at, &step);
                }
            }
        }
    }
}
