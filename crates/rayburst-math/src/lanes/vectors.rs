//! Vectors of two and three coordinates.

use std::ops::{Add, Mul, Neg, Sub};

use glam::{Vec2, Vec3};

use super::numbers::{F32x16, Mask16, Select, U32x16};

/// Sixteen vectors of two coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vec2x16 {
    /// First coordinates.
    pub x: F32x16,
    /// Second coordinates.
    pub y: F32x16,
}

/// Sixteen vectors of three coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vec3x16 {
    /// First coordinates.
    pub x: F32x16,
    /// Second coordinates.
    pub y: F32x16,
    /// Third coordinates.
    pub z: F32x16,
}

macro_rules! coordinatewise {
    ($type:ident, $($c:ident),+) => {
        impl Add for $type {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self { $($c: self.$c + other.$c),+ }
            }
        }
        impl Sub for $type {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self { $($c: self.$c - other.$c),+ }
            }
        }
        impl Mul for $type {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self { $($c: self.$c * other.$c),+ }
            }
        }
        impl Mul<F32x16> for $type {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: F32x16) -> Self {
                Self { $($c: self.$c * other),+ }
            }
        }
        impl Neg for $type {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { $($c: -self.$c),+ }
            }
        }
        impl Select for $type {
            #[inline(always)]
            fn select(mask: Mask16, a: Self, b: Self) -> Self {
                Self { $($c: mask.select(a.$c, b.$c)),+ }
            }
        }
    };
}
coordinatewise!(Vec2x16, x, y);
coordinatewise!(Vec3x16, x, y, z);

impl Vec2x16 {
    /// Zeros.
    pub const ZERO: Self = Self { x: F32x16::ZERO, y: F32x16::ZERO };

    /// Scalar products with others.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F32x16 {
        self.x * other.x + self.y * other.y
    }

    /// x·y′ − y·x′.
    #[inline(always)]
    pub fn perp_dot(self, other: Self) -> F32x16 {
        self.x * other.y - self.y * other.x
    }

    /// One of the vectors.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> Vec2 {
        Vec2::new(self.x.0[i], self.y.0[i])
    }

    /// Sets one of the vectors.
    #[inline(always)]
    pub fn set_lane(&mut self, i: usize, value: Vec2) {
        self.x.0[i] = value.x;
        self.y.0[i] = value.y;
    }
}

impl Vec3x16 {
    /// Zeros.
    pub const ZERO: Self = Self { x: F32x16::ZERO, y: F32x16::ZERO, z: F32x16::ZERO };

    /// The same vector sixteen times.
    #[inline(always)]
    pub const fn splat(value: Vec3) -> Self {
        Self { x: F32x16::splat(value.x), y: F32x16::splat(value.y), z: F32x16::splat(value.z) }
    }

    /// Scalar products with others.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F32x16 {
        (self.x * other.x + self.y * other.y) + self.z * other.z
    }

    /// Vector products with others.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - other.y * self.z,
            y: self.z * other.x - other.z * self.x,
            z: self.x * other.y - other.x * self.y,
        }
    }

    /// Lengths.
    #[inline(always)]
    pub fn length(self) -> F32x16 {
        self.dot(self).sqrt()
    }

    /// Unit vectors; `fallback` where there is none.
    #[inline(always)]
    pub fn normalize_or(self, fallback: Self) -> Self {
        let scale = 1.0 / self.length();
        let fine = scale.is_finite() & scale.is_greater(F32x16::ZERO);
        fine.select(self * scale, fallback)
    }

    /// Coordinates without their signs.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    /// The greater coordinates.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self { x: self.x.max(other.x), y: self.y.max(other.y), z: self.z.max(other.z) }
    }

    /// The greatest coordinate of each vector.
    #[inline(always)]
    pub fn max_element(self) -> F32x16 {
        self.x.max(self.y).max(self.z)
    }

    /// One of the vectors.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> Vec3 {
        Vec3::new(self.x.0[i], self.y.0[i], self.z.0[i])
    }

    /// Sets one of the vectors.
    #[inline(always)]
    pub fn set_lane(&mut self, i: usize, value: Vec3) {
        self.x.0[i] = value.x;
        self.y.0[i] = value.y;
        self.z.0[i] = value.z;
    }
}

/// Sixteen orthonormal frames; see [`crate::Frame`].
#[derive(Clone, Copy, Debug)]
pub struct Frame16 {
    /// First axes.
    pub tangent: Vec3x16,
    /// Second axes.
    pub bitangent: Vec3x16,
    /// Third axes.
    pub normal: Vec3x16,
}

impl Frame16 {
    /// Frames around unit normals; see [`crate::Frame::from_normal`].
    #[inline(always)]
    pub fn from_normal(normal: Vec3x16) -> Self {
        let one = F32x16::ONE;
        // Of −0, too.
        let sign = ((normal.z.to_bits() & U32x16::splat(1 << 31)) | one.to_bits()).as_f32();
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: Vec3x16 {
                x: one + sign * normal.x * normal.x * a,
                y: sign * b,
                z: -sign * normal.x,
            },
            bitangent: Vec3x16 { x: b, y: sign + normal.y * normal.y * a, z: -normal.y },
            normal,
        }
    }

    /// Frames around unit normals with tangents nearest to those given; see
    /// [`crate::Frame::from_normal_tangent`].
    #[inline(always)]
    pub fn from_normal_tangent(normal: Vec3x16, tangent: Vec3x16) -> Self {
        let arbitrary = Self::from_normal(normal).tangent;
        let tangent = (tangent - normal * normal.dot(tangent)).normalize_or(arbitrary);
        Self { tangent, bitangent: normal.cross(tangent), normal }
    }

    /// From world space into the frames.
    #[inline(always)]
    pub fn to_local(&self, v: Vec3x16) -> Vec3x16 {
        Vec3x16 { x: v.dot(self.tangent), y: v.dot(self.bitangent), z: v.dot(self.normal) }
    }

    /// From the frames into world space.
    #[inline(always)]
    pub fn to_world(&self, v: Vec3x16) -> Vec3x16 {
        (self.tangent * v.x + self.bitangent * v.y) + self.normal * v.z
    }
}

/// Origins of rays that leave surface points; see [`crate::offset::spawn_origin`].
#[inline(always)]
pub fn spawn_origin(p: Vec3x16, error: Vec3x16, normal: Vec3x16, direction: Vec3x16) -> Vec3x16 {
    let distance = normal.abs().dot(error);
    let below = direction.dot(normal).is_less(F32x16::ZERO);
    let offset = below.select(-normal, normal) * distance;
    let moved = p + offset;
    Vec3x16 {
        x: round(moved.x, offset.x),
        y: round(moved.y, offset.y),
        z: round(moved.z, offset.z),
    }
}

#[inline(always)]
fn round(value: F32x16, offset: F32x16) -> F32x16 {
    let still = offset.is_equal(F32x16::ZERO);
    still.select(value, value.next(offset.is_greater(F32x16::ZERO)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::Rng;

    #[test]
    fn frames_are_those_of_single_normals() {
        let mut rng = Rng::new(4);
        let (mut n, mut t) = (Vec3x16::ZERO, Vec3x16::ZERO);
        for i in 0..16 {
            n.set_lane(i, crate::warp::uniform_sphere(rng.vec2()));
            t.set_lane(i, rng.vec3() - 0.5);
        }
        n.set_lane(3, -Vec3::Z);
        t.set_lane(4, n.lane(4));
        let (any, near) = (Frame16::from_normal(n), Frame16::from_normal_tangent(n, t));
        for i in 0..16 {
            let one = crate::Frame::from_normal(n.lane(i));
            assert_eq!(any.tangent.lane(i), one.tangent);
            assert_eq!(any.bitangent.lane(i), one.bitangent);
            let v = t.lane(i);
            assert_eq!(any.to_local(t).lane(i), one.to_local(v));
            assert_eq!(any.to_world(t).lane(i), one.to_world(v));
            let one = crate::Frame::from_normal_tangent(n.lane(i), v);
            // Parallel tangents leave rounding.
            if i != 4 {
                assert!((near.tangent.lane(i) - one.tangent).length() < 1e-6);
                assert!((near.bitangent.lane(i) - one.bitangent).length() < 1e-6);
            }
        }
    }

    #[test]
    fn origins_are_those_of_single_points() {
        let mut rng = Rng::new(6);
        let [mut p, mut e, mut n, mut d] = [Vec3x16::ZERO; 4];
        for i in 0..16 {
            p.set_lane(i, 10.0 * (rng.vec3() - 0.5));
            e.set_lane(i, 1e-5 * rng.vec3());
            let axis = if i % 4 == 0 { Vec3::Y } else { crate::warp::uniform_sphere(rng.vec2()) };
            n.set_lane(i, axis);
            d.set_lane(i, rng.vec3() - 0.5);
        }
        let origins = spawn_origin(p, e, n, d);
        for i in 0..16 {
            let one = crate::offset::spawn_origin(p.lane(i), e.lane(i), n.lane(i), d.lane(i));
            assert_eq!(origins.lane(i), one);
        }
    }

    #[test]
    fn products_and_unit_vectors_are_those_of_single_vectors() {
        let mut rng = Rng::new(3);
        let (mut a, mut b) = (Vec3x16::ZERO, Vec3x16::ZERO);
        for i in 1..16 {
            a.set_lane(i, rng.vec3() - 0.5);
            b.set_lane(i, rng.vec3() - 0.5);
        }
        let fallback = Vec3x16::splat(Vec3::Y);
        let (dot, cross, unit) = (a.dot(b), a.cross(b), a.normalize_or(fallback));
        for i in 0..16 {
            let (x, y) = (a.lane(i), b.lane(i));
            assert_eq!(dot.0[i], x.dot(y));
            assert_eq!(cross.lane(i), x.cross(y));
            assert_eq!(unit.lane(i), x.normalize_or(Vec3::Y));
            assert_eq!(a.max_element().0[i], x.max_element());
        }
        let (mut p, mut q) = (Vec2x16::ZERO, Vec2x16::ZERO);
        p.set_lane(3, Vec2::new(1.0, 2.0));
        q.set_lane(3, Vec2::new(-0.5, 4.0));
        assert_eq!((p.dot(q).0[3], p.perp_dot(q).0[3]), (7.5, 5.0));
        assert_eq!((p + q).lane(3), Vec2::new(0.5, 6.0));
    }
}
