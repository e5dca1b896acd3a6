//! The ray and the hit: 32 bytes each, plain data, the currency of every batch.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// A ray `q(t) = origin + t · direction` restricted to `t_min ≤ t ≤ t_max` (chapter 26, Eq. 26.1).
///
/// The direction may have any non-zero length: `t` is in units of it, and nothing normalises it
/// silently. `t_min` may be negative. A ray with a NaN anywhere, an infinite origin, or a zero
/// direction is *invalid* and is a miss by contract.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Origin, in world space unless said otherwise.
    pub origin: Vec3,
    /// Start of the interval in which hits are reported, in units of `direction`; inclusive.
    pub t_min: f32,
    /// Direction, of any non-zero length.
    pub direction: Vec3,
    /// End of the interval in which hits are reported; inclusive. May be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray over `0 ≤ t < ∞`.
    #[inline]
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }

    /// A ray over `t_min ≤ t ≤ t_max`.
    #[inline]
    pub const fn with_interval(origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Self {
        Self { origin, t_min, direction, t_max }
    }

    /// The point `q(t)`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }

    /// Whether the ray can hit anything: all numbers finite (`t_max` may be infinite, `t_min` may be
    /// minus infinity), a direction that is not zero, and an interval that is not empty.
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != Vec3::ZERO
            && self.t_min <= self.t_max
    }
}

/// Which side of what was hit (DXR's `HitKind`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct HitKind(pub u32);

impl HitKind {
    /// Nothing was hit.
    pub const NONE: Self = Self(0);
    /// The front face of a triangle: seen from the ray's origin in *object space* its vertices wind
    /// counter-clockwise (glTF's convention; a mirroring instance transform does not change it).
    pub const TRIANGLE_FRONT: Self = Self(0xFE);
    /// The back face of a triangle.
    pub const TRIANGLE_BACK: Self = Self(0xFF);

    /// Marks the kinds that intersection shaders report.
    const PROCEDURAL: u32 = 0x100;

    /// What an intersection shader reported, from 0 to 127; greater bits are dropped.
    #[inline]
    pub const fn procedural(kind: u8) -> Self {
        Self(Self::PROCEDURAL | (kind & 0x7F) as u32)
    }

    /// Whether a procedural primitive was hit.
    #[inline]
    pub const fn is_procedural(self) -> bool {
        self.0 & Self::PROCEDURAL != 0
    }

    /// Whether a triangle was hit.
    #[inline]
    pub const fn is_triangle(self) -> bool {
        self.0 == Self::TRIANGLE_FRONT.0 || self.0 == Self::TRIANGLE_BACK.0
    }

    /// What DXR's `HitKind()` returns: 254 and 255 for the faces of triangles, else what the intersection
    /// shader reported.
    #[inline]
    pub const fn code(self) -> u8 {
        self.0 as u8
    }
}

/// What a ray met: 32 bytes of plain data.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hit {
    /// Distance along the ray in units of its direction; infinite for a miss.
    pub t: f32,
    /// Barycentric coordinate of the triangle's second vertex.
    pub u: f32,
    /// Barycentric coordinate of the triangle's third vertex.
    pub v: f32,
    /// Index of the primitive in its geometry.
    pub primitive: u32,
    /// Index of the geometry in its BLAS.
    pub geometry: u32,
    /// Index of the instance in the TLAS.
    pub instance: u32,
    /// What was hit.
    pub kind: HitKind,
    /// Unused, zero.
    pub reserved: u32,
}

impl Hit {
    /// The result of a ray that met nothing.
    pub const MISS: Self = Self {
        t: f32::INFINITY,
        u: 0.0,
        v: 0.0,
        primitive: u32::MAX,
        geometry: u32::MAX,
        instance: u32::MAX,
        kind: HitKind::NONE,
        reserved: 0,
    };

    /// Whether this is a hit and not [`Hit::MISS`].
    #[inline]
    pub fn is_hit(&self) -> bool {
        self.kind != HitKind::NONE
    }

    /// The order in which hits win: the nearer one, and of two at equal `t` the one with the
    /// smallest `(instance, geometry, primitive)`.
    #[inline]
    pub fn precedes(&self, other: &Self) -> bool {
        self.t < other.t
            || (self.t == other.t
                && (self.instance, self.geometry, self.primitive)
                    < (other.instance, other.geometry, other.primitive))
    }
}

impl Default for Hit {
    fn default() -> Self {
        Self::MISS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_and_hits_are_32_bytes() {
        assert_eq!(size_of::<Ray>(), 32);
        assert_eq!(size_of::<Hit>(), 32);
    }

    #[test]
    fn kinds_are_told_apart() {
        assert_eq!(HitKind::TRIANGLE_FRONT.code(), 254);
        assert_eq!(HitKind::TRIANGLE_BACK.code(), 255);
        for code in 0..=255 {
            let kind = HitKind::procedural(code);
            assert_eq!(kind.code(), code & 0x7F);
            assert!(kind.is_procedural() && !kind.is_triangle() && kind != HitKind::NONE);
        }
        assert!(HitKind::TRIANGLE_BACK.is_triangle() && !HitKind::TRIANGLE_BACK.is_procedural());
        assert!(!HitKind::NONE.is_triangle() && !HitKind::NONE.is_procedural());
    }

    #[test]
    fn invalid_rays_are_recognised() {
        let good = Ray::new(Vec3::ZERO, Vec3::X);
        assert!(good.is_valid());
        assert!(Ray { t_min: f32::NEG_INFINITY, ..good }.is_valid());
        assert!(!Ray { origin: Vec3::splat(f32::NAN), ..good }.is_valid());
        assert!(!Ray { origin: Vec3::splat(f32::INFINITY), ..good }.is_valid());
        assert!(!Ray { direction: Vec3::ZERO, ..good }.is_valid());
        assert!(!Ray { t_max: f32::NAN, ..good }.is_valid());
        assert!(!Ray { t_min: 2.0, t_max: 1.0, ..good }.is_valid());
    }

    #[test]
    fn ties_go_to_the_smallest_ids() {
        let a = Hit { t: 1.0, primitive: 3, geometry: 0, instance: 1, ..Hit::MISS };
        let b = Hit { t: 1.0, primitive: 4, geometry: 0, instance: 0, ..Hit::MISS };
        assert!(b.precedes(&a) && !a.precedes(&b) && !a.precedes(&a));
        assert!(a.precedes(&Hit::MISS));
    }
}
