//! Boxes as builders compute with them.

use glam::{Mat4, Vec4, Vec4Swizzles};
use rayburst_math::Aabb;

use super::primitives::PrimitiveRef;

/// A box in four lanes, of which the last is meaningless.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds4 {
    pub(super) lower: Vec4,
    pub(super) upper: Vec4,
}

impl Bounds4 {
    pub(super) const EMPTY: Self =
        Self { lower: Vec4::splat(f32::INFINITY), upper: Vec4::splat(f32::NEG_INFINITY) };

    #[inline(always)]
    pub(super) fn of(reference: &PrimitiveRef) -> Self {
        Self { lower: reference.lower(), upper: reference.upper() }
    }

    #[inline(always)]
    pub(super) fn of_aabb(bounds: &Aabb) -> Self {
        Self { lower: bounds.lower.extend(0.0), upper: bounds.upper.extend(0.0) }
    }

    #[inline(always)]
    pub(super) fn grow(&mut self, lower: Vec4, upper: Vec4) {
        self.lower = self.lower.min(lower);
        self.upper = self.upper.max(upper);
    }

    #[inline(always)]
    pub(super) fn merge(&mut self, other: &Self) {
        self.grow(other.lower, other.upper);
    }

    #[inline(always)]
    pub(super) fn union(mut self, other: &Self) -> Self {
        self.merge(other);
        self
    }

    #[inline(always)]
    pub(super) fn intersection(&self, other: &Self) -> Self {
        Self { lower: self.lower.max(other.lower), upper: self.upper.min(other.upper) }
    }

    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        !self.lower.cmple(self.upper).bitmask() & 7 != 0
    }

    /// Products of edge lengths, whose first three lanes add up to half the area.
    #[inline(always)]
    fn edge_products(&self) -> Vec4 {
        let e = self.upper - self.lower;
        e * e.yzxw()
    }

    #[inline(always)]
    pub(super) fn half_area(&self) -> f32 {
        let products = self.edge_products();
        products.x + products.y + products.z
    }

    pub(super) fn aabb(&self) -> Aabb {
        Aabb { lower: self.lower.truncate(), upper: self.upper.truncate() }
    }
}

/// Half the areas of three boxes; the last lane is meaningless.
#[inline(always)]
pub(super) fn half_areas(boxes: &[Bounds4; 3]) -> Vec4 {
    let [a, b, c] = boxes;
    let (a, b, c) = (a.edge_products(), b.edge_products(), c.edge_products());
    let lanes = Mat4::from_cols(a, b, c, c).transpose();
    lanes.x_axis + lanes.y_axis + lanes.z_axis
}

/// What is known of a node before it is split.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) bounds: Bounds4,
    /// The box around the centroids, times two.
    pub(super) centroids: Bounds4,
}

impl Extent {
    pub(super) const EMPTY: Self = Self { bounds: Bounds4::EMPTY, centroids: Bounds4::EMPTY };

    pub(super) fn of(refs: &[PrimitiveRef]) -> Self {
        let mut extent = Self::EMPTY;
        for reference in refs {
            extent.bounds.grow(reference.lower(), reference.upper());
            let centroid = reference.lower() + reference.upper();
            extent.centroids.grow(centroid, centroid);
        }
        extent
    }

    pub(super) fn merge(mut self, other: Self) -> Self {
        self.bounds.merge(&other.bounds);
        self.centroids.merge(&other.centroids);
        self
    }
}
