//! Leaves of triangles: blocks of four beside each other.

use glam::Vec4;
use rayburst_simd::Triangles4;

use super::bvh8::Leaves;
use crate::{
    TriangleMesh,
    build::{primitives::MAX_PRIMITIVES, spatial::Shapes},
};

/// Triangles in a block, and so in a leaf.
pub(crate) const BLOCK: usize = 4;

/// The number of a triangle in its BLAS, and whether it is opaque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TriangleId(u32);

impl TriangleId {
    const TRANSLUCENT: u32 = 1 << 31;
    /// What lanes without a triangle hold.
    pub(crate) const NONE: Self = Self(Self::TRANSLUCENT - 1);

    pub(crate) fn new(triangle: u32, opaque: bool) -> Self {
        const { assert!(MAX_PRIMITIVES < Self::NONE.0 as usize) };
        Self(triangle | if opaque { 0 } else { Self::TRANSLUCENT })
    }

    /// What is stored in a block.
    #[inline(always)]
    pub(crate) fn word(self) -> u32 {
        self.0
    }

    /// What is stored as a word.
    #[inline(always)]
    pub(crate) fn of_word(word: u32) -> Self {
        Self(word)
    }

    #[inline(always)]
    pub(crate) fn of_lane(block: &Triangles4, lane: usize) -> Self {
        Self(block.ids[lane])
    }

    #[inline(always)]
    pub(crate) fn triangle(self) -> u32 {
        self.0 & !Self::TRANSLUCENT
    }

    #[inline(always)]
    pub(crate) fn is_opaque(self) -> bool {
        self.0 & Self::TRANSLUCENT == 0
    }

    /// Lanes whose triangles are not opaque, as bits.
    #[inline(always)]
    pub(crate) fn translucent_lanes(block: &Triangles4) -> u32 {
        (0..BLOCK).fold(0, |lanes, lane| lanes | (block.ids[lane] >> 31) << lane)
    }

    /// How many lanes hold triangles: the first ones.
    #[inline(always)]
    pub(crate) fn used_lanes(block: &Triangles4) -> u32 {
        block.ids.iter().map(|&id| u32::from(id != Self::NONE.0)).sum()
    }
}

/// Where the triangles of a BLAS come from.
pub(crate) struct TriangleLeaves<'a> {
    pub(crate) geometries: &'a [TriangleMesh<'a>],
    /// The number of each geometry's first triangle.
    pub(crate) starts: &'a [u32],
}

impl Leaves for TriangleLeaves<'_> {
    const HALF_LINES: usize = size_of::<Triangles4>() / 32;

    fn place(&self, _: &[u32], half_line: u32) -> u32 {
        half_line
    }

    fn write(&self, primitives: &[u32], words: &mut [u32]) {
        debug_assert!((1..=BLOCK).contains(&primitives.len()));
        let mut block =
            Triangles4 { vertices: [[[f32::NAN; BLOCK]; 3]; 3], ids: [TriangleId::NONE.0; BLOCK] };
        for (lane, &triangle) in primitives.iter().enumerate() {
            let (geometry, primitive) = locate(self.starts, triangle);
            let mesh = &self.geometries[geometry as usize];
            for (corner, position) in mesh.triangle(primitive as usize).iter().enumerate() {
                for axis in 0..3 {
                    block.vertices[corner][axis][lane] = position[axis];
                }
            }
            block.ids[lane] = TriangleId::new(triangle, mesh.opaque).0;
        }
        words.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&block)));
    }
}

impl Shapes for TriangleLeaves<'_> {
    #[inline(always)]
    fn corners(&self, index: u32) -> [Vec4; 3] {
        let (geometry, primitive) = locate(self.starts, index);
        let [a, b, c] = self.geometries[geometry as usize].triangle(primitive as usize);
        [a.extend(0.0), b.extend(0.0), c.extend(0.0)]
    }
}

/// The geometry and primitive of a triangle numbered through all geometries.
#[inline]
pub(crate) fn locate(starts: &[u32], triangle: u32) -> (u32, u32) {
    let geometry = starts.partition_point(|&start| start <= triangle) - 1;
    (geometry as u32, triangle - starts[geometry])
}
