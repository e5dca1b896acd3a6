//! The scene as authored: a hierarchy of nodes that place meshes, lights and cameras.

use std::sync::Arc;

use glam::{Affine3A, Mat4, Quat, Vec3};
use rayburst_image::MipMap;

use crate::{Camera, Environment, Light, Material, Mesh, Projection, Texture, pose::Animation};

/// Everything a file or a generator describes. Indices between the parts are in range.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// A short name, for messages.
    pub name: String,
    /// The hierarchy; every parent comes before its children, so one pass composes transforms.
    pub nodes: Vec<Node>,
    /// Meshes, placed by nodes.
    pub meshes: Vec<Mesh>,
    /// Skins, used by nodes with meshes.
    pub skins: Vec<Skin>,
    /// Animations, in the file's order.
    pub animations: Vec<Animation>,
    /// Materials; never empty when there is a mesh.
    pub materials: Vec<Material>,
    /// Names of the materials, for `info` and messages; as long as `materials`.
    pub material_names: Vec<String>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Images with their mip levels.
    pub images: Vec<Arc<MipMap>>,
    /// Cameras placed by nodes.
    pub cameras: Vec<SceneCamera>,
    /// Lights placed by nodes, with position and direction in node space (origin, −z).
    pub lights: Vec<Light>,
    /// Views in world space (from a view file or a generator); come before node cameras.
    pub views: Vec<View>,
    /// Lights in world space (from a view file or a generator; the sun is one of them).
    pub world_lights: Vec<Light>,
    /// What lies behind everything; `None` when the source says nothing, so that a default can step
    /// in, `Some(Environment::None)` when it says there is nothing.
    pub environment: Option<Environment>,
    /// Exposure in stops, if the source fixes it; `None` is automatic.
    pub exposure: Option<f32>,
    /// Length of one unit of the source in metres (already applied to nothing: informative, and used
    /// for the default lens and the sky).
    pub metres_per_unit: f32,
    /// What was skipped or mended while reading, one line each.
    pub warnings: Vec<String>,
}

/// A node of the hierarchy.
#[derive(Clone, Debug, Default)]
pub struct Node {
    /// Name, may be empty.
    pub name: String,
    /// Index of the parent, smaller than the node's own.
    pub parent: Option<u32>,
    /// Transform relative to the parent.
    pub local: LocalTransform,
    /// Mesh it places.
    pub mesh: Option<u32>,
    /// Skin that deforms the mesh.
    pub skin: Option<u32>,
    /// Morph weights; empty uses the mesh's.
    pub weights: Vec<f32>,
    /// Camera it places.
    pub camera: Option<u32>,
    /// Light it places.
    pub light: Option<u32>,
    /// Transforms of many instances of the mesh, relative to the node (`EXT_mesh_gpu_instancing`);
    /// empty places the mesh once.
    pub instances: Vec<Affine3A>,
}

/// A transform by parts, so that animation can move them, or a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalTransform {
    /// `translation · rotation · scale`.
    Parts {
        /// Offset.
        translation: Vec3,
        /// Unit quaternion.
        rotation: Quat,
        /// Factors along the axes; may be negative.
        scale: Vec3,
    },
    /// Any affine matrix.
    Matrix(Affine3A),
}

impl LocalTransform {
    /// The identity, by parts.
    pub const IDENTITY: Self =
        Self::Parts { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };

    /// As a matrix.
    pub fn to_affine(&self) -> Affine3A {
        match *self {
            Self::Parts { translation, rotation, scale } => {
                Affine3A::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(m) => m,
        }
    }

    /// By parts, so that an animation can move them. A matrix without an inverse keeps its offset
    /// only; shear is lost.
    pub fn to_parts(&self) -> (Vec3, Quat, Vec3) {
        match *self {
            Self::Parts { translation, rotation, scale } => (translation, rotation, scale),
            Self::Matrix(m) if m.matrix3.determinant() != 0.0 => {
                let (scale, rotation, translation) = m.to_scale_rotation_translation();
                (translation, rotation, scale)
            }
            Self::Matrix(m) => (m.translation.into(), Quat::IDENTITY, Vec3::ONE),
        }
    }
}

impl Default for LocalTransform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

/// Joints of a skinned mesh.
#[derive(Clone, Debug, Default)]
pub struct Skin {
    /// Nodes that move the vertices.
    pub joints: Vec<u32>,
    /// Object space to joint space at bind time, one a joint.
    pub inverse_bind: Vec<Mat4>,
}

/// A camera that a node places.
#[derive(Clone, Debug)]
pub struct SceneCamera {
    /// Name, may be empty.
    pub name: String,
    /// Projection; the transform is the node's.
    pub projection: Projection,
}

/// A named view in world space.
#[derive(Clone, Debug)]
pub struct View {
    /// Name for `--camera`.
    pub name: String,
    /// The camera.
    pub camera: Camera,
}

impl Scene {
    /// Adds a mesh of one primitive at the world's origin under a new root node; for generators.
    /// Returns the node's index.
    pub fn add_mesh(&mut self, name: &str, primitives: Vec<crate::Primitive>) -> u32 {
        let mesh = self.meshes.len() as u32;
        self.meshes.push(Mesh {
            name: name.to_owned(),
            primitives: primitives.into_iter().map(Arc::new).collect(),
            weights: Vec::new(),
        });
        self.nodes.push(Node { name: name.to_owned(), mesh: Some(mesh), ..Node::default() });
        self.nodes.len() as u32 - 1
    }

    /// Adds a material and returns its index.
    pub fn add_material(&mut self, name: &str, material: Material) -> u32 {
        self.materials.push(material);
        self.material_names.push(name.to_owned());
        self.materials.len() as u32 - 1
    }

    /// Triangles of all placed meshes, instances counted each time.
    pub fn placed_triangles(&self) -> u64 {
        self.nodes
            .iter()
            .filter_map(|n| n.mesh.map(|m| (n, &self.meshes[m as usize])))
            .map(|(n, mesh)| {
                let each: usize = mesh.primitives.iter().map(|p| p.indices.len()).sum();
                each as u64 * n.instances.len().max(1) as u64
            })
            .sum()
    }

    /// Whether any light, lamp or environment shines. Materials that glow by a texture are displays
    /// and decoration, not lamps.
    pub fn has_light(&self) -> bool {
        let is_lamp = |m: &Material| m.is_emissive() && m.emissive_texture.index().is_none();
        !self.world_lights.is_empty()
            || self.nodes.iter().any(|n| n.light.is_some())
            || self.materials.iter().any(is_lamp)
            || matches!(self.environment, Some(Environment::Constant(_) | Environment::Map(_)))
    }
}
