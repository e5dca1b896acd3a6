//! Eight boxes and the ray that meets them: the conservative slab test of wide nodes.
//!
//! After Kay and Kajiya, "Ray tracing complex scenes", 1986. The test must never miss a box that
//! holds a triangle the triangle test would report, so whoever prepares the ray moves the near planes
//! towards it and the far planes away by a bound on all rounding errors, those of this test with or
//! without fused multiply-add included. Instruction sets may therefore differ in boxes barely missed,
//! never in hits.

use bytemuck::{Pod, Zeroable};

/// Eight boxes: rows of lower x, upper x, lower y, upper y, lower z, upper z.
///
/// An empty slot has lower = +∞ and upper = −∞: no ray meets it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Boxes8 {
    /// The rows.
    pub planes: [[f32; 8]; 6],
}

impl Boxes8 {
    /// Eight empty slots.
    pub const EMPTY: Self = {
        let (lower, upper) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        Self { planes: [lower, upper, lower, upper, lower, upper] }
    };
}

/// A ray prepared for [`Boxes8`]: the distance to plane `p` of an axis is `p · inverse − offset`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct SlabRay {
    inverse: [f32; 4],
    near_offset: [f32; 4],
    far_offset: [f32; 4],
    near_plane: [u32; 4],
}

impl SlabRay {
    /// From one over the direction, finite and not zero, and the offsets of near and far planes,
    /// finite; the fourth numbers do not matter.
    #[inline(always)]
    pub fn new(inverse: [f32; 4], near_offset: [f32; 4], far_offset: [f32; 4]) -> Self {
        const LOWER: [u32; 4] = [0, 2 * ROW_BYTES, 4 * ROW_BYTES, 0];
        let row = |axis: usize| LOWER[axis] + (inverse[axis].to_bits() >> 31) * ROW_BYTES;
        Self { inverse, near_offset, far_offset, near_plane: [row(0), row(1), row(2), row(3)] }
    }

    /// One over the direction.
    #[inline(always)]
    pub fn inverse(&self) -> [f32; 3] {
        first_three(self.inverse)
    }

    /// What is subtracted at near planes.
    #[inline(always)]
    pub fn near_offset(&self) -> [f32; 3] {
        first_three(self.near_offset)
    }

    /// What is subtracted at far planes.
    #[inline(always)]
    pub fn far_offset(&self) -> [f32; 3] {
        first_three(self.far_offset)
    }

    /// One over the direction, and what is subtracted at near and at far planes, of four numbers each.
    #[inline(always)]
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) fn fours(&self) -> [&[f32; 4]; 3] {
        [&self.inverse, &self.near_offset, &self.far_offset]
    }

    /// The rows of [`Boxes8::planes`] that the ray meets first, less than six; the others are these
    /// with the lowest bit flipped.
    #[inline(always)]
    pub fn near_plane(&self) -> [usize; 3] {
        first_three(self.near_plane).map(|bytes| (bytes / ROW_BYTES) as usize)
    }

    /// Where those rows start in [`Boxes8`], in bytes; the others start where bit
    /// [`SlabRay::FAR_ROW`] is flipped.
    #[inline(always)]
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) fn near_row(&self) -> [usize; 3] {
        first_three(self.near_plane).map(|bytes| bytes as usize)
    }

    /// The bit that tells the rows of lower and upper planes apart in [`SlabRay::near_row`].
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) const FAR_ROW: usize = ROW_BYTES as usize;
}

const ROW_BYTES: u32 = 32;

#[inline(always)]
fn first_three<T>([x, y, z, _]: [T; 4]) -> [T; 3] {
    [x, y, z]
}
