//! Meshes as authored: triangle lists with vertex attributes, skins and morph targets.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};

/// A mesh: primitives that share a node.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, may be empty.
    pub name: String,
    /// Its parts, one material each.
    pub primitives: Vec<Arc<Primitive>>,
    /// Default morph weights.
    pub weights: Vec<f32>,
}

/// A list of triangles with one material. All attribute arrays that are present have one entry a
/// vertex; indices are in range (importers check).
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Vertex positions, object space.
    pub positions: Vec<Vec3>,
    /// Vertex indices of each triangle; counter-clockwise is the front.
    pub indices: Vec<[u32; 3]>,
    /// Unit shading normals; `None` shades flat.
    pub normals: Option<Vec<Vec3>>,
    /// Unit tangents; w is the handedness of the bitangent, ±1.
    pub tangents: Option<Vec<Vec4>>,
    /// UV sets; (0, 0) is the upper left corner of an image.
    pub uvs: Vec<Vec<Vec2>>,
    /// Linear vertex colours.
    pub colors: Option<Vec<Vec4>>,
    /// Joint influences.
    pub skin: Option<Vec<VertexSkin>>,
    /// Morph targets, all with the same number of vertices.
    pub targets: Vec<MorphTarget>,
    /// Index in the scene's materials.
    pub material: u32,
}

/// The joints that move a vertex; weights sum to one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VertexSkin {
    /// Indices into the skin's joints; the strongest eight at most.
    pub joints: [u16; 8],
    /// Their weights; unused ones are zero.
    pub weights: [f32; 8],
}

/// Displacements of a morph target.
#[derive(Clone, Debug, Default)]
pub struct MorphTarget {
    /// Added to positions.
    pub positions: Option<Vec<Vec3>>,
    /// Added to normals.
    pub normals: Option<Vec<Vec3>>,
    /// Added to tangents' xyz.
    pub tangents: Option<Vec<Vec3>>,
}
