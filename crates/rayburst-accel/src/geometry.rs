//! What goes into a structure: triangle meshes into a BLAS, instances into a TLAS.

use glam::{Affine3A, Vec3};
use rayburst_math::Aabb;

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
    /// Whether a ray must ask about a triangle once at most (DXR's `NO_DUPLICATE_ANYHIT_INVOCATION`). The
    /// structure only remembers it, pipelines keep to it, and a [`crate::RayQuery`] does not.
    pub no_duplicate_any_hit: bool,
}

impl<'a> TriangleMesh<'a> {
    /// An opaque mesh without a transform.
    pub const fn new(positions: &'a [Vec3], indices: &'a [[u32; 3]]) -> Self {
        Self { positions, indices, transform: None, opaque: true, no_duplicate_any_hit: false }
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

/// One geometry of a BLAS: boxes, each with something in it that an intersection shader knows of.
#[derive(Clone, Copy, Debug)]
pub struct ProceduralBoxes<'a> {
    /// The boxes of the primitives. One that is empty, not finite or beyond [`MAX_COORDINATE`] is never
    /// met; one without extent is.
    pub boxes: &'a [Aabb],
    /// Whether hits are final, as for triangles.
    pub opaque: bool,
    /// As for triangles: a box is met once by a ray, but may hold several hits.
    pub no_duplicate_any_hit: bool,
}

impl<'a> ProceduralBoxes<'a> {
    /// Opaque primitives.
    pub const fn new(boxes: &'a [Aabb]) -> Self {
        Self { boxes, opaque: true, no_duplicate_any_hit: false }
    }
}

/// One geometry of a BLAS, of either kind.
#[derive(Clone, Copy, Debug)]
pub enum Geometry<'a> {
    /// Triangles, tested here.
    Triangles(TriangleMesh<'a>),
    /// Boxes of primitives that somebody else tests.
    Procedural(ProceduralBoxes<'a>),
}

impl<'a> From<TriangleMesh<'a>> for Geometry<'a> {
    fn from(mesh: TriangleMesh<'a>) -> Self {
        Self::Triangles(mesh)
    }
}

impl<'a> From<ProceduralBoxes<'a>> for Geometry<'a> {
    fn from(boxes: ProceduralBoxes<'a>) -> Self {
        Self::Procedural(boxes)
    }
}

/// What a geometry consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GeometryKind {
    /// Triangles.
    Triangles,
    /// Procedural primitives.
    Procedural,
}

/// What a BLAS remembers of a geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeometryInfo {
    /// What it consists of.
    pub kind: GeometryKind,
    /// How many primitives it has, those included that are never met.
    pub primitives: u32,
    /// Whether hits are final.
    pub opaque: bool,
    /// Whether a ray must ask about a primitive once at most.
    pub no_duplicate_any_hit: bool,
}

impl Geometry<'_> {
    pub(crate) fn info(&self) -> GeometryInfo {
        match self {
            Self::Triangles(mesh) => GeometryInfo {
                kind: GeometryKind::Triangles,
                primitives: mesh.indices.len() as u32,
                opaque: mesh.opaque,
                no_duplicate_any_hit: mesh.no_duplicate_any_hit,
            },
            Self::Procedural(boxes) => GeometryInfo {
                kind: GeometryKind::Procedural,
                primitives: boxes.boxes.len() as u32,
                opaque: boxes.opaque,
                no_duplicate_any_hit: boxes.no_duplicate_any_hit,
            },
        }
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
    /// Index of the BLAS, or [`Instance::NO_BLAS`].
    pub blas: u32,
    /// From the BLAS' space to the world; may shear, mirror and scale non-uniformly. An instance
    /// whose transform has no inverse is never hit.
    pub transform: Affine3A,
    /// A ray visits the instance if its mask and this one share a bit.
    pub mask: u8,
    /// What differs from the rule.
    pub flags: InstanceFlags,
    /// A number for shaders (DXR's `InstanceID`); DXR has 24 bits for it.
    pub id: u32,
    /// What the instance adds to the index of its hit groups' records (DXR's
    /// `InstanceContributionToHitGroupIndex`); DXR has 24 bits for it.
    pub contribution: u32,
}

impl Instance {
    /// In place of a BLAS's index: the instance is never hit (DXR's null structure).
    pub const NO_BLAS: u32 = u32::MAX;

    /// An instance that every ray visits.
    pub fn new(blas: u32, transform: Affine3A) -> Self {
        Self {
            blas,
            transform,
            mask: 0xFF,
            flags: InstanceFlags::default(),
            id: 0,
            contribution: 0,
        }
    }
}
