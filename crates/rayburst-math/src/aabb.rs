//! Axis-aligned bounding boxes.

use bytemuck::{Pod, Zeroable};
use glam::{Affine3A, Vec3};

/// A box `lower ≤ p ≤ upper`; empty when any `lower > upper`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Aabb {
    /// Smallest coordinates.
    pub lower: Vec3,
    /// Largest coordinates.
    pub upper: Vec3,
}

impl Aabb {
    /// The box that holds nothing, neutral under [`Aabb::union`].
    pub const EMPTY: Self =
        Self { lower: Vec3::splat(f32::INFINITY), upper: Vec3::splat(f32::NEG_INFINITY) };

    /// The box of one point.
    #[inline]
    pub const fn of_point(p: Vec3) -> Self {
        Self { lower: p, upper: p }
    }

    /// The smallest box around some points.
    pub fn of_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::grow)
    }

    /// This box grown to hold `p`.
    #[inline]
    pub fn grow(self, p: Vec3) -> Self {
        Self { lower: self.lower.min(p), upper: self.upper.max(p) }
    }

    /// The smallest box around both.
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// What both boxes share; may be empty.
    #[inline]
    pub fn intersection(self, other: Self) -> Self {
        Self { lower: self.lower.max(other.lower), upper: self.upper.min(other.upper) }
    }

    /// Whether the box holds nothing.
    #[inline]
    pub fn is_empty(&self) -> bool {
        !self.lower.cmple(self.upper).all()
    }

    /// Whether `p` lies in the closed box.
    #[inline]
    pub fn contains(&self, p: Vec3) -> bool {
        self.lower.cmple(p).all() && p.cmple(self.upper).all()
    }

    /// Whether `other` lies in the closed box; an empty box lies in every box.
    #[inline]
    pub fn contains_box(&self, other: &Self) -> bool {
        other.is_empty() || (self.contains(other.lower) && self.contains(other.upper))
    }

    /// Centre of the box; NaN when empty.
    #[inline]
    pub fn centre(&self) -> Vec3 {
        0.5 * self.lower + 0.5 * self.upper
    }

    /// Edge lengths; zero when empty.
    #[inline]
    pub fn extent(&self) -> Vec3 {
        (self.upper - self.lower).max(Vec3::ZERO)
    }

    /// Length of the diagonal; zero when empty.
    #[inline]
    pub fn diagonal(&self) -> f32 {
        self.extent().length()
    }

    /// Half the surface area (the surface area heuristic needs only ratios); zero when empty.
    #[inline]
    pub fn half_area(&self) -> f32 {
        let e = self.extent();
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// The box around the transformed box.
    pub fn transformed(&self, transform: &Affine3A) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        Self::of_points((0..8).map(|corner| {
            let pick = |bit: u32, axis: usize| {
                if corner & bit == 0 { self.lower[axis] } else { self.upper[axis] }
            };
            transform.transform_point3(Vec3::new(pick(1, 0), pick(2, 1), pick(4, 2)))
        }))
    }
}

impl Default for Aabb {
    fn default() -> Self {
        Self::EMPTY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_is_neutral() {
        let b = Aabb { lower: Vec3::ZERO, upper: Vec3::ONE };
        assert_eq!(Aabb::EMPTY.union(b), b);
        assert!(Aabb::EMPTY.is_empty() && !b.is_empty());
        assert_eq!(Aabb::EMPTY.half_area(), 0.0);
        assert_eq!(b.half_area(), 3.0);
        assert!(b.contains_box(&Aabb::EMPTY));
    }

    #[test]
    fn a_transformed_box_holds_its_corners() {
        let b = Aabb { lower: Vec3::ZERO, upper: Vec3::ONE };
        let m = Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.0));
        assert_eq!(
            b.transformed(&m),
            Aabb { lower: Vec3::new(-2.0, 0.0, 0.0), upper: Vec3::new(0.0, 1.0, 1.0) }
        );
    }
}
