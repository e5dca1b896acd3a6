//! Orthonormal frames around a normal.
//!
//! Duff, Burgess, Christensen, Hery, Kensler, Liani, Villemin: "Building an Orthonormal Basis,
//! Revisited", JCGT 2017.

use glam::Vec3;

/// A right-handed orthonormal frame; local z is the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Local x axis.
    pub tangent: Vec3,
    /// Local y axis.
    pub bitangent: Vec3,
    /// Local z axis.
    pub normal: Vec3,
}

impl Frame {
    /// A frame around a unit normal; the tangent is arbitrary but a continuous function of the
    /// normal except at z = −0.
    #[inline]
    pub fn from_normal(normal: Vec3) -> Self {
        let sign = 1.0f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// A frame around a unit normal whose tangent is nearest to `tangent`; falls back to
    /// [`Frame::from_normal`] when `tangent` is parallel to the normal or not finite.
    #[inline]
    pub fn from_normal_tangent(normal: Vec3, tangent: Vec3) -> Self {
        match (tangent - normal * normal.dot(tangent)).try_normalize() {
            Some(tangent) => Self { tangent, bitangent: normal.cross(tangent), normal },
            None => Self::from_normal(normal),
        }
    }

    /// From world space into the frame.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.tangent), v.dot(self.bitangent), v.dot(self.normal))
    }

    /// From the frame into world space.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{hash::Rng, warp};

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        let mut rng = Rng::new(1);
        let special = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        let random: Vec<Vec3> = (0..10_000).map(|_| warp::uniform_sphere(rng.vec2())).collect();
        for n in special.into_iter().chain(random) {
            let f = Frame::from_normal(n);
            assert!((f.tangent.cross(f.bitangent) - n).length() < 1e-5, "{n}");
            assert!(f.tangent.dot(f.bitangent).abs() < 1e-5);
            assert!((f.tangent.length() - 1.0).abs() < 1e-5);
            let v = warp::uniform_sphere(rng.vec2());
            assert!((f.to_world(f.to_local(v)) - v).length() < 1e-5);
        }
    }
}
