//! Leaves of triangles that follow each other along a space-filling curve.

use glam::{Mat4, Vec3, Vec4};
use rayburst_math::Aabb;
use rayburst_simd::Triangles4;

use super::{
    bvh8::{Node8, Reference},
    triangles::{BLOCK, TriangleId, TriangleLeaves},
};
use crate::build::morton::Keys;

/// Words of a leaf.
pub(crate) const LEAF_WORDS: usize = size_of::<Triangles4>() / 4;

/// Lines of leaves next to each other.
pub(crate) fn leaf_lines(leaves: usize) -> usize {
    (leaves * LEAF_WORDS).div_ceil(16)
}

/// A box in four lanes, of which the last is meaningless.
#[derive(Clone, Copy)]
pub(crate) struct Bounds {
    pub(crate) lower: Vec4,
    pub(crate) upper: Vec4,
}

impl Bounds {
    pub(crate) const EMPTY: Self =
        Self { lower: Vec4::splat(f32::INFINITY), upper: Vec4::splat(f32::NEG_INFINITY) };

    #[inline(always)]
    pub(crate) fn grow(&mut self, lower: Vec4, upper: Vec4) {
        self.lower = self.lower.min(lower);
        self.upper = self.upper.max(upper);
    }

    pub(crate) fn aabb(&self) -> Aabb {
        Aabb { lower: self.lower.truncate(), upper: self.upper.truncate() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.lower.cmple(self.upper).bitmask() & 7 != 7
    }

    pub(crate) fn half_area(&self) -> f32 {
        let e = self.upper - self.lower;
        e.x * e.y + e.y * e.z + e.z * e.x
    }
}

impl Node8 {
    /// Sets a child.
    #[inline(always)]
    pub(crate) fn set(&mut self, slot: usize, bounds: &Bounds, reference: Reference) {
        for axis in 0..3 {
            self.boxes.planes[2 * axis][slot] = bounds.lower[axis];
            self.boxes.planes[2 * axis + 1][slot] = bounds.upper[axis];
        }
        self.children[slot] = reference;
    }
}

/// Writes leaves of triangles by their places in the order of keys.
pub(crate) struct CurveLeaves<'a> {
    keys: &'a Keys,
    triangles: &'a TriangleLeaves<'a>,
    /// The geometry of the last triangle.
    geometry: usize,
}

impl<'a> CurveLeaves<'a> {
    pub(crate) fn new(keys: &'a Keys, triangles: &'a TriangleLeaves<'a>) -> Self {
        Self { keys, triangles, geometry: 0 }
    }

    /// Writes the leaf of some keys; returns its box.
    #[inline(always)]
    pub(crate) fn write(&mut self, first: usize, end: usize, words: &mut [u32]) -> Bounds {
        let mut corners = [[Vec4::NAN; BLOCK]; 3];
        let mut ids = [TriangleId::NONE; BLOCK];
        let mut bounds = Bounds::EMPTY;
        for (lane, at) in (first..end).enumerate() {
            let triangle = self.keys.index(at);
            let (own, opaque) = self.corners(triangle);
            let [a, b, c] = own;
            bounds.grow(a.min(b).min(c), a.max(b).max(c));
            for (lanes, corner) in corners.iter_mut().zip(own) {
                lanes[lane] = corner;
            }
            ids[lane] = TriangleId::new(triangle, opaque);
        }
        let block = transpose(&corners, ids);
        words.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&block)));
        bounds
    }

    #[inline(always)]
    fn corners(&mut self, triangle: u32) -> ([Vec4; 3], bool) {
        let starts = self.triangles.starts;
        let is_in = |geometry: usize| {
            starts[geometry] <= triangle
                && starts.get(geometry + 1).is_none_or(|&next| triangle < next)
        };
        if !is_in(self.geometry) {
            self.geometry = starts.partition_point(|&start| start <= triangle) - 1;
        }
        let mesh = &self.triangles.geometries[self.geometry];
        let corners = mesh.triangle((triangle - starts[self.geometry]) as usize);
        (corners.map(|corner: Vec3| corner.extend(0.0)), mesh.opaque)
    }
}

/// A leaf from the corners of its lanes.
#[inline(always)]
pub(crate) fn transpose(corners: &[[Vec4; BLOCK]; 3], ids: [TriangleId; BLOCK]) -> Triangles4 {
    let vertices = corners.map(|[a, b, c, d]| {
        let rows = Mat4::from_cols(a, b, c, d).transpose();
        [rows.x_axis.to_array(), rows.y_axis.to_array(), rows.z_axis.to_array()]
    });
    Triangles4 { vertices, ids: ids.map(TriangleId::word) }
}
