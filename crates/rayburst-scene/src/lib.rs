//! Scenes: what a picture is made of, from files and from code.
//!
//! [`Scene`] holds assets as they were authored: a node hierarchy, meshes, materials, lights,
//! cameras, animations. One instant of it is flattened to plain data, ready to be traced and shaded.
#![forbid(unsafe_code)]

pub mod alpha;
pub mod bsdf;
pub mod builtin;
pub mod camera;
mod cutouts;
pub mod deform;
pub mod environment;
pub mod flatten;
pub mod footprint;
pub mod framing;
pub mod import;
pub mod light;
pub mod light_sampler;
pub mod ltc;
pub mod material;
pub mod mesh;
pub mod normals;
pub mod pose;
pub mod scene;
pub mod shading_point;
pub mod shapes;
pub mod sky;
pub mod surface;
pub mod tangents;
pub mod texture;
pub mod texture_ellipse;
pub mod texture_lookup;
mod trace;
pub mod wide;

pub use alpha::AlphaFilter;
pub use bsdf::{Bsdf, BsdfSample, LobeValues, SpecularPath};
pub use camera::{Camera, Projection};
pub use environment::Environment;
pub use flatten::{FlatGeometry, FlatInstance, FlatScene, FlattenError, Flattener};
pub use footprint::Footprint;
pub use light::{Light, LightKind};
pub use light_sampler::{Arrival, LightKinds, LightSample, LightSampler};
pub use material::{AlphaMode, Material, ShadingModel, TextureSlot};
pub use mesh::{Mesh, MorphTarget, Primitive, VertexSkin};
pub use pose::Pose;
pub use scene::{LocalTransform, Node, Scene, SceneCamera, Skin, View};
pub use shading_point::{ShadingOptions, ShadingPoint};
pub use sky::Sky;
pub use surface::Surface;
pub use texture::{FilterMode, Texture, WrapMode};
pub use texture_lookup::TextureLod;
