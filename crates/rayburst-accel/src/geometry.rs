//! What goes into a structure: triangle meshes into a BLAS, instances into a TLAS.

use glam::{Affine3A, Vec3};

/// Coordinates may be this large (2⁶⁰); triangles and instances beyond are never hit.
///
/// Areas and the products of the triangle test stay finite within it.
pub const MAX_COORDINATE: f32 = (1u64 << 60) as f32;

/// One geometry of a BLAS: an indexed triangle mesh, borrowed for the build.
#[derive(Clone, Copy, Debug)]
pub struct TriangleMesh<'a> {
    /// Vertex positions.
    pub positions: &'a [Vec3],
    /// Three vertices a triangle.
    pub indices: &'a [[u32; 3]],
    /// A transform applied to the positions once, at build.
    pub transform: Option<Affine3A>,
    /// Whether hits are final: opaque geometry never calls the candidate filter.
    pub opaque: bool,
}

impl<'a> TriangleMesh<'a> {
    /// An opaque mesh without a transform.
    pub const fn new(positions: &'a [Vec3], indices: &'a [[u32; 3]]) -> Self {
        Self { positions, indices, transform: None, opaque: true }
    }

    /// The corners of a triangle after the transform. All indices must have been checked.
    #[inline]
    pub(crate) fn triangle(&self, primitive: usize) -> [Vec3; 3] {
        let [a, b, c] = self.indices[primitive];
        let corner = |index: u32| {
            let p = self.positions[index as usize];
            match &self.transform {
                Some(transform) => transform.transform_point3(p),
                None => p,
            }
        };
        [corner(a), corner(b), corner(c)]
    }
}

/// What differs from the rule for one instance (DXR's instance flags).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InstanceFlags {
    /// Culling of triangles by their facing is off.
    pub cull_disable: bool,
    /// Front faces wind clockwise.
    pub front_clockwise: bool,
    /// Overrides the opacity of the BLAS' geometries.
    pub force_opaque: Option<bool>,
}

/// A BLAS placed in the world.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// Index of the BLAS.
    pub blas: u32,
    /// From the BLAS' space to the world; may shear, mirror and scale non-uniformly. An instance
    /// whose transform has no inverse is never hit.
    pub transform: Affine3A,
    /// A ray visits the instance if its mask and this one share a bit.
    pub mask: u8,
    /// What differs from the rule.
    pub flags: InstanceFlags,
}

impl Instance {
    /// An instance that every ray visits.
    pub fn new(blas: u32, transform: Affine3A) -> Self {
        Self { blas, transform, mask: 0xFF, flags: InstanceFlags::default() }
    }
}
