//! The guides of a frame as kernels read them: padded and finite.

use rayburst_image::Plane;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Guides, Result,
    stack::{BAND, BLOCK, Lanes, Stack, lanes},
};

/// Depth, world units; zero where nothing is.
pub(crate) const DEPTH: usize = 0;
/// Three channels: the unit normal; zero where nothing is.
pub(crate) const NORMAL: usize = 1;
/// The object's number, as bits.
pub(crate) const OBJECT: usize = 4;
/// Two channels: how depth changes from a pixel to the next, to the right and downwards.
pub(crate) const SLOPE: usize = 5;
/// Number of channels.
pub(crate) const CHANNELS: usize = 7;
/// Surfaces seen face on may change by this share of their depth from a pixel to the next.
pub(crate) const LEAST_SLOPE: f32 = 2.5e-4;

/// The object of what is beside the picture: that of no pixel.
const OUTSIDE: u32 = u32::MAX;
/// What is as far or farther counts as nothing.
const FAR: f32 = 1e15;

/// Fills a stack of [`CHANNELS`], with or without telling objects apart.
pub(crate) fn prepare(isa: IsaLevel, guides: &Guides<'_>, tells: bool, to: &mut Stack) {
    let (margin, stride, length) = (to.margin(), to.stride(), to.band_len(BAND));
    to.values_mut().par_chunks_mut(length).enumerate().for_each(|(band, rows)| {
        let top = band * BAND;
        isa.dispatch(Preparation { guides, tells, top, margin, stride, to: rows });
    });
}

/// Some rows of a stack.
struct Preparation<'a> {
    guides: &'a Guides<'a>,
    tells: bool,
    top: usize,
    margin: usize,
    stride: usize,
    to: &'a mut [f32],
}

impl Kernel for Preparation<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self { guides, tells, top, margin, stride, to } = self;
        let width = guides.depth.width() as usize;
        for (y, rows) in (top..).zip(to.chunks_mut(CHANNELS * stride)) {
            for value in &mut rows[OBJECT * stride..(OBJECT + 1) * stride] {
                *value = f32::from_bits(OUTSIDE);
            }
            for x in (0..width).step_by(BLOCK) {
                let block = block(guides, tells, x, y);
                for c in 0..CHANNELS {
                    rows[c * stride + margin + x..][..BLOCK].copy_from_slice(&block[c]);
                }
            }
        }
    }
}

/// All channels of a block of pixels.
#[inline(always)]
fn block(guides: &Guides<'_>, tells: bool, x: usize, y: usize) -> [Lanes; CHANNELS] {
    let mut out = [[0.0; BLOCK]; CHANNELS];
    let plane = guides.depth;
    let (width, height, stride) = (plane.width() as usize, plane.height() as usize, plane.stride());
    let at = y * stride + x;
    let depth = lanes(plane.values(), at);
    let [nx, ny, nz] = &guides.normal.channels;
    let (nx, ny, nz) = (lanes(nx.values(), at), lanes(ny.values(), at), lanes(nz.values(), at));
    let object: &[u32; BLOCK] =
        guides.object.values()[at..at + BLOCK].first_chunk().expect("a block");
    let beside = |offset: isize| shifted(plane, x, y, offset);
    let (left, right) = (beside(-1), beside(1));
    let missing = [f32::INFINITY; BLOCK];
    let above = if y > 0 { lanes(plane.values(), at - stride) } else { &missing };
    let below = if y + 1 < height { lanes(plane.values(), at + stride) } else { &missing };
    let inside = (width - x).min(BLOCK) as u32;
    for i in 0..BLOCK {
        let z = depth[i];
        let is_some = z.abs() < FAR && object[i] != 0;
        let [a, b, c] = [nx[i], ny[i], nz[i]];
        let squared = a * a + b * b + c * c;
        let is_unit = is_some && squared > 1e-30 && squared < 1e30;
        let scale = 1.0 / squared.sqrt();
        out[DEPTH][i] = if is_some { z } else { 0.0 };
        out[NORMAL][i] = if is_unit { a * scale } else { 0.0 };
        out[NORMAL + 1][i] = if is_unit { b * scale } else { 0.0 };
        out[NORMAL + 2][i] = if is_unit { c * scale } else { 0.0 };
        let known = if tells { object[i].min(OUTSIDE - 1) } else { 1 };
        let known = if is_some { known } else { 0 };
        let known = if (i as u32) < inside { known } else { OUTSIDE };
        out[OBJECT][i] = f32::from_bits(known);
        let across = smaller(z - left[i], right[i] - z);
        let down = smaller(z - above[i], below[i] - z);
        out[SLOPE][i] = if is_some { across } else { 0.0 };
        out[SLOPE + 1][i] = if is_some { down } else { 0.0 };
    }
    out
}

/// A block of a row that begins one pixel earlier or later; infinite beside the picture.
#[inline(always)]
fn shifted(plane: &Plane, x: usize, y: usize, offset: isize) -> Lanes {
    let row = plane.row(y as u32);
    let mut out = [f32::INFINITY; BLOCK];
    let start = x.wrapping_add_signed(offset);
    if let Some(block) = row.get(start..).and_then(|row| row.first_chunk::<BLOCK>()) {
        return *block;
    }
    for i in 0..BLOCK {
        if let Some(value) = row.get(start.wrapping_add(i)) {
            out[i] = *value;
        }
    }
    out
}

/// The number of smaller magnitude, ignoring those that are not finite; zero without any.
#[inline(always)]
pub(crate) fn smaller(a: f32, b: f32) -> f32 {
    let x = if a.abs() < FAR { a } else { FAR };
    let y = if b.abs() < FAR { b } else { FAR };
    let z = if x.abs() <= y.abs() { x } else { y };
    if z.abs() < FAR { z } else { 0.0 }
}

/// Makes a stack of a size and at least a margin, if it is not one already.
pub(crate) fn fit(
    stack: &mut Stack,
    size: (u32, u32),
    channels: usize,
    margin: usize,
) -> Result<()> {
    if stack.size() != size || stack.channels() != channels || stack.margin() < margin {
        *stack = Stack::new(size, channels, margin)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rayburst_image::Plane3;

    use super::*;

    #[test]
    fn channels_are_finite_and_slopes_those_of_the_surface() {
        let (w, h) = (35, 5);
        let mut depth = Plane::new(w, h).unwrap();
        let mut normal = Plane3::new(w, h).unwrap();
        let mut object = Plane::new(w, h).unwrap();
        for y in 0..h {
            for x in 0..w {
                let far = if x < 20 { 0.0 } else { 100.0 };
                depth.set(x, y, 10.0 + far + 0.5 * x as f32 - 0.25 * y as f32);
                normal.set(x, y, glam::Vec3::new(0.0, 3.0, 4.0));
                object.set(x, y, 1 + x);
            }
        }
        depth.set(3, 2, f32::NAN);
        depth.set(4, 3, f32::INFINITY);
        normal.set(5, 4, glam::Vec3::splat(f32::NAN));
        normal.set(6, 4, glam::Vec3::ZERO);
        object.set(7, 4, 0);
        let motion = [depth.clone(), depth.clone()];
        let guides = Guides {
            depth: &depth,
            normal: &normal,
            object: &object,
            motion: &motion,
            depth_motion: None,
        };
        let mut stacks = Vec::new();
        for isa in IsaLevel::available() {
            let mut stack = Stack::new((w, h), CHANNELS, 32).unwrap();
            prepare(isa, &guides, true, &mut stack);
            for y in 0..h {
                for x in 0..w as usize {
                    let at = |channel| stack.row(channel, y)[x];
                    let nothing = [(3, 2), (4, 3), (7, 4)].contains(&(x, y));
                    let flat = nothing || [(5, 4), (6, 4)].contains(&(x, y));
                    let id = if nothing { 0 } else { 1 + x as u32 };
                    assert_eq!(at(OBJECT).to_bits(), id);
                    assert_eq!(at(DEPTH), if nothing { 0.0 } else { depth.get(x as u32, y) });
                    let length = at(NORMAL).hypot(at(NORMAL + 1)).hypot(at(NORMAL + 2));
                    assert!((length - if flat { 0.0 } else { 1.0 }).abs() < 1e-6);
                    // Below (4, 3), which is infinitely far, nothing is known.
                    if !nothing && (x, y) != (4, 4) {
                        assert_eq!((at(SLOPE), at(SLOPE + 1)), (0.5, -0.25), "{x} {y}");
                    }
                }
                let row = stack.padded_row(OBJECT, y);
                assert!(row[..32].iter().chain(&row[32 + 35..]).all(|v| v.to_bits() == OUTSIDE));
            }
            let bits: Vec<_> = stack.rows(2).iter().map(|v| v.to_bits()).collect();
            stacks.push(bits);
        }
        assert!(stacks.iter().all(|stack| *stack == stacks[0]));
    }
}
