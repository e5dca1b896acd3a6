//! One instant of a scene as plain data: structures to trace, records to shade.
//!
//! Static, unrepeated meshes are baked into one BLAS of many geometries, with the node's transform
//! applied at build (DXR's per-geometry transform). Meshes that move, deform or repeat get a BLAS
//! each and are placed by instances.

use std::{
    collections::{HashMap, hash_map::Entry},
    sync::Arc,
};

use glam::{Affine3A, Mat3A};
use rayburst_accel::{
    Blas, BuildError, BuildOptions, Instance, MovingBlas, Tlas, TriangleMesh, UpdatePolicy,
};
use rayburst_image::MipMap;
use rayburst_math::Aabb;

use crate::{
    AlphaMode, Environment, Light, LightKind, Material, Pose, Primitive, Scene, Texture,
    cutouts::{self, Shading},
    deform,
};

/// A scene at one instant, ready to be traced and shaded.
#[derive(Clone, Debug)]
pub struct FlatScene {
    /// The top-level structure; its instances are `instances`.
    pub tlas: Tlas,
    /// One record an instance of the TLAS.
    pub instances: Vec<FlatInstance>,
    /// Records of all geometries of all BLASes; an instance's begin at its `first_geometry`.
    pub geometries: Vec<FlatGeometry>,
    /// Materials.
    pub materials: Arc<[Material]>,
    /// Textures.
    pub textures: Arc<[Texture]>,
    /// Images.
    pub images: Arc<[Arc<MipMap>]>,
    /// Punctual lights in world space.
    pub lights: Vec<Light>,
    /// What rays that leave the scene see.
    pub environment: Environment,
    /// World bounds of everything that can be hit.
    pub bounds: Aabb,
}

/// What the renderer must know of an instance.
#[derive(Clone, Copy, Debug)]
pub struct FlatInstance {
    /// Index of its BLAS's first geometry in [`FlatScene::geometries`].
    pub first_geometry: u32,
    /// Number of its geometries.
    pub geometry_count: u32,
    /// The instance transform M.
    pub object_to_world: Affine3A,
    /// Inverse transpose of M's linear part.
    pub normal_to_world: Mat3A,
    /// Whether M is the identity, as it is for baked geometry.
    pub is_identity: bool,
}

/// What the renderer must know of a geometry.
#[derive(Clone, Debug)]
pub struct FlatGeometry {
    /// Vertices and indices, before the transform N.
    pub primitive: Arc<Primitive>,
    /// The transform N applied at build.
    pub transform: Affine3A,
    /// Inverse transpose of N's linear part.
    pub normal_transform: Mat3A,
    /// Whether N mirrors, so that the front is where vertices wind clockwise.
    pub mirrored: bool,
    /// Index of the material.
    pub material: u32,
    /// Index of the node in the scene; of the first node for repeated meshes.
    pub node: u32,
}

/// Why a scene could not be flattened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FlattenError {
    /// A structure could not be built.
    #[error("cannot build the acceleration structure of mesh '{mesh}': {source}")]
    Build {
        /// Name of the mesh, or what stands for all static ones.
        mesh: String,
        /// What the builder says.
        source: BuildError,
    },
}

/// Flattens the instants of one scene; structures that do not change are built once, and those of
/// deforming meshes are kept from instant to instant and refitted as a policy says. What is hit at one
/// instant does not depend on the instants before, nor on the policy.
#[derive(Debug)]
pub struct Flattener<'a> {
    scene: &'a Scene,
    options: BuildOptions<'a>,
    /// For each node, how its mesh is placed.
    placement: Vec<Placement>,
    baked: Option<Built>,
    /// By mesh and skin or node: rigid meshes are built once.
    rigid: HashMap<u32, Built>,
    /// By node.
    deforming: HashMap<usize, MovingBlas<'a>>,
    policy: UpdatePolicy,
    shared: Shared,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Placement {
    Nothing,
    Baked,
    Rigid,
    Deforming,
}

#[derive(Clone, Debug)]
struct Built {
    blas: Arc<Blas>,
    geometries: Vec<FlatGeometry>,
}

#[derive(Clone, Debug)]
struct Shared {
    materials: Arc<[Material]>,
    textures: Arc<[Texture]>,
    images: Arc<[Arc<MipMap>]>,
}

impl<'a> Flattener<'a> {
    /// Prepares a scene.
    pub fn new(scene: &'a Scene, options: BuildOptions<'a>) -> Self {
        let moving = moving_nodes(scene);
        let mut uses = vec![0u32; scene.meshes.len()];
        for node in &scene.nodes {
            if let Some(mesh) = node.mesh {
                uses[mesh as usize] += node.instances.len().max(1) as u32;
            }
        }
        let placement = scene
            .nodes
            .iter()
            .zip(&moving)
            .map(|(node, &moves)| match node.mesh {
                None => Placement::Nothing,
                Some(mesh) if deforms(scene, node, mesh) => Placement::Deforming,
                Some(mesh) if moves || uses[mesh as usize] > 1 => Placement::Rigid,
                Some(_) => Placement::Baked,
            })
            .collect();
        let mut shading = Shading {
            materials: scene.materials.clone(),
            textures: scene.textures.clone(),
            images: scene.images.clone(),
        };
        cutouts::keep_coverage(&mut shading);
        let shared = Shared {
            materials: shading.materials.into(),
            textures: shading.textures.into(),
            images: shading.images.into(),
        };
        Self {
            scene,
            options,
            placement,
            baked: None,
            rigid: HashMap::new(),
            deforming: HashMap::new(),
            policy: UpdatePolicy::default(),
            shared,
        }
    }

    /// The same with another policy for deforming meshes.
    pub fn with_policy(self, policy: UpdatePolicy) -> Self {
        Self { policy, deforming: HashMap::new(), ..self }
    }

    /// The scene in one pose.
    pub fn at(&mut self, pose: &Pose) -> Result<FlatScene, FlattenError> {
        let mut flat = Parts::default();
        self.place_baked(pose, &mut flat)?;
        for node in 0..self.scene.nodes.len() {
            match self.placement[node] {
                Placement::Rigid => self.place_rigid(node, pose, &mut flat)?,
                Placement::Deforming => self.place_deforming(node, pose, &mut flat)?,
                Placement::Nothing | Placement::Baked => {}
            }
        }
        let tlas = Tlas::build(flat.blases, &flat.tlas_instances, &self.options)
            .map_err(|source| FlattenError::Build { mesh: "(all instances)".into(), source })?;
        let bounds = tlas.bounds();
        Ok(FlatScene {
            tlas,
            instances: flat.instances,
            geometries: flat.geometries,
            materials: self.shared.materials.clone(),
            textures: self.shared.textures.clone(),
            images: self.shared.images.clone(),
            lights: place_lights(self.scene, pose),
            environment: self.scene.environment.clone().unwrap_or_default(),
            bounds,
        })
    }

    fn place_baked(&mut self, pose: &Pose, flat: &mut Parts) -> Result<(), FlattenError> {
        if self.baked.is_none() {
            let mut geometries = Vec::new();
            for (index, node) in self.scene.nodes.iter().enumerate() {
                let (Placement::Baked, Some(mesh)) = (self.placement[index], node.mesh) else {
                    continue;
                };
                let mut transform = pose.world[index];
                if let [only] = node.instances[..] {
                    transform *= only;
                }
                let primitives = &self.scene.meshes[mesh as usize].primitives;
                geometries.extend(primitives.iter().map(|p| geometry(p.clone(), transform, index)));
            }
            if !geometries.is_empty() {
                self.baked = Some(self.build("(static geometry)", geometries)?);
            }
        }
        if let Some(built) = &self.baked {
            flat.place(built, [Affine3A::IDENTITY]);
        }
        Ok(())
    }

    fn place_rigid(
        &mut self,
        index: usize,
        pose: &Pose,
        flat: &mut Parts,
    ) -> Result<(), FlattenError> {
        let node = &self.scene.nodes[index];
        let Some(mesh) = node.mesh else { return Ok(()) };
        if !self.rigid.contains_key(&mesh) {
            let source = &self.scene.meshes[mesh as usize];
            let geometries = source
                .primitives
                .iter()
                .map(|p| geometry(p.clone(), Affine3A::IDENTITY, index))
                .collect();
            let built = self.build(&source.name, geometries)?;
            self.rigid.insert(mesh, built);
        }
        flat.place_shared(mesh, &self.rigid[&mesh], instance_transforms(self.scene, index, pose));
        Ok(())
    }

    fn place_deforming(
        &mut self,
        index: usize,
        pose: &Pose,
        flat: &mut Parts,
    ) -> Result<(), FlattenError> {
        let node = &self.scene.nodes[index];
        let Some(mesh) = node.mesh else { return Ok(()) };
        let source = &self.scene.meshes[mesh as usize];
        let joints = node.skin.map(|s| pose.joint_matrices(self.scene, s));
        let geometries = source
            .primitives
            .iter()
            .map(|p| {
                let bent = deform::deform(p, &pose.weights[index], joints.as_deref());
                geometry(Arc::new(bent), Affine3A::IDENTITY, index)
            })
            .collect();
        let built = self.update(index, &source.name, geometries)?;
        // Joint matrices lead to world space: a skinned mesh ignores its node's transform
        // (glTF 2.0, section 3.7.3.3).
        if node.skin.is_some() {
            flat.place(&built, [Affine3A::IDENTITY]);
        } else {
            flat.place(&built, instance_transforms(self.scene, index, pose));
        }
        Ok(())
    }

    fn build(&self, mesh: &str, geometries: Vec<FlatGeometry>) -> Result<Built, FlattenError> {
        let blas = Blas::build(&triangles(self.scene, &geometries), &self.options)
            .map_err(|source| FlattenError::Build { mesh: mesh.to_owned(), source })?;
        Ok(Built { blas: Arc::new(blas), geometries })
    }

    /// The structure of a node's mesh as it is now, from that of the last instant if there is one.
    fn update(
        &mut self,
        node: usize,
        mesh: &str,
        geometries: Vec<FlatGeometry>,
    ) -> Result<Built, FlattenError> {
        let meshes = triangles(self.scene, &geometries);
        let failed = |source| FlattenError::Build { mesh: mesh.to_owned(), source };
        let moving = match self.deforming.entry(node) {
            Entry::Occupied(entry) => {
                let moving = entry.into_mut();
                moving.update(&meshes).map_err(failed)?;
                moving
            }
            Entry::Vacant(entry) => {
                let first = MovingBlas::build(&meshes, &self.options, self.policy);
                entry.insert(first.map_err(failed)?)
            }
        };
        let blas = moving.blas().clone();
        Ok(Built { blas, geometries })
    }
}

/// Geometries as a structure is built over them.
fn triangles<'g>(scene: &Scene, geometries: &'g [FlatGeometry]) -> Vec<TriangleMesh<'g>> {
    let triangles = |geometry: &'g FlatGeometry| TriangleMesh {
        positions: &geometry.primitive.positions,
        indices: &geometry.primitive.indices,
        transform: (geometry.transform != Affine3A::IDENTITY).then_some(geometry.transform),
        opaque: is_opaque(scene, &geometry.primitive),
        no_duplicate_any_hit: false,
    };
    geometries.iter().map(triangles).collect()
}

/// What is gathered for the TLAS.
#[derive(Default)]
struct Parts {
    blases: Vec<Arc<Blas>>,
    tlas_instances: Vec<Instance>,
    instances: Vec<FlatInstance>,
    geometries: Vec<FlatGeometry>,
    /// BLAS index and first geometry of meshes that several nodes place.
    placed: HashMap<u32, (u32, u32)>,
}

impl Parts {
    fn add(&mut self, built: &Built) -> (u32, u32) {
        let first_geometry = self.geometries.len() as u32;
        self.geometries.extend(built.geometries.iter().cloned());
        self.blases.push(built.blas.clone());
        (self.blases.len() as u32 - 1, first_geometry)
    }

    fn place(&mut self, built: &Built, transforms: impl IntoIterator<Item = Affine3A>) {
        let at = self.add(built);
        self.instantiate(at, built, transforms);
    }

    fn place_shared(
        &mut self,
        mesh: u32,
        built: &Built,
        transforms: impl IntoIterator<Item = Affine3A>,
    ) {
        let at = match self.placed.get(&mesh) {
            Some(&at) => at,
            None => {
                let at = self.add(built);
                self.placed.insert(mesh, at);
                at
            }
        };
        self.instantiate(at, built, transforms);
    }

    fn instantiate(
        &mut self,
        (blas, first_geometry): (u32, u32),
        built: &Built,
        transforms: impl IntoIterator<Item = Affine3A>,
    ) {
        for transform in transforms {
            let normal_to_world = transform.matrix3.inverse().transpose();
            // A flattened or broken transform leaves nothing to see (scale 0 hides a node).
            if !transform.is_finite() || !normal_to_world.is_finite() {
                continue;
            }
            self.tlas_instances.push(Instance::new(blas, transform));
            self.instances.push(FlatInstance {
                first_geometry,
                geometry_count: built.geometries.len() as u32,
                object_to_world: transform,
                normal_to_world,
                is_identity: transform == Affine3A::IDENTITY,
            });
        }
    }
}

fn geometry(primitive: Arc<Primitive>, transform: Affine3A, node: usize) -> FlatGeometry {
    let determinant = transform.matrix3.determinant();
    let normal_transform =
        if determinant == 0.0 { Mat3A::IDENTITY } else { transform.matrix3.inverse().transpose() };
    FlatGeometry {
        material: primitive.material,
        primitive,
        transform,
        normal_transform,
        mirrored: determinant < 0.0,
        node: node as u32,
    }
}

fn instance_transforms<'s>(
    scene: &'s Scene,
    node: usize,
    pose: &Pose,
) -> impl Iterator<Item = Affine3A> + use<'s> {
    let world = pose.world[node];
    let own = &scene.nodes[node].instances;
    let once = own.is_empty().then_some(world);
    once.into_iter().chain(own.iter().map(move |i| world * *i))
}

fn deforms(scene: &Scene, node: &crate::Node, mesh: u32) -> bool {
    node.skin.is_some()
        || scene.meshes[mesh as usize].primitives.iter().any(|p| !p.targets.is_empty())
}

/// Whether every point of the primitive stops every ray.
fn is_opaque(scene: &Scene, primitive: &Primitive) -> bool {
    let Some(material) = scene.materials.get(primitive.material as usize) else { return true };
    let has_texture =
        material.base_color_texture.index().is_some() || material.alpha_texture.index().is_some();
    match material.alpha_mode() {
        AlphaMode::Opaque => true,
        AlphaMode::Mask | AlphaMode::Blend => {
            !has_texture && primitive.colors.is_none() && material.base_color[3] >= 1.0
        }
    }
}

/// Nodes that some animation moves, directly or through an ancestor.
fn moving_nodes(scene: &Scene) -> Vec<bool> {
    let mut moving = vec![false; scene.nodes.len()];
    for channel in scene.animations.iter().flat_map(|a| &a.channels) {
        moving[channel.node as usize] = true;
    }
    for (index, node) in scene.nodes.iter().enumerate() {
        if let Some(parent) = node.parent {
            moving[index] |= moving[parent as usize];
        }
    }
    moving
}

/// All punctual lights in world space.
fn place_lights(scene: &Scene, pose: &Pose) -> Vec<Light> {
    let mut lights = scene.world_lights.clone();
    for (node, world) in scene.nodes.iter().zip(&pose.world) {
        let Some(light) = node.light else { continue };
        let Light { intensity, kind } = scene.lights[light as usize];
        let at = glam::Vec3::from(world.translation);
        let along = world.transform_vector3(-glam::Vec3::Z).try_normalize();
        let Some(along) = along else { continue };
        let kind = match kind {
            LightKind::Point { .. } => LightKind::Point { position: at },
            LightKind::Spot { cos_inner, cos_outer, .. } => {
                LightKind::Spot { position: at, direction: along, cos_inner, cos_outer }
            }
            LightKind::Directional { angular_radius, .. } => {
                LightKind::Directional { direction: along, angular_radius }
            }
        };
        lights.push(Light { intensity, kind });
    }
    lights
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use rayburst_accel::{AcceptAll, TraceOptions};
    use rayburst_math::Ray;

    use super::*;
    use crate::{LocalTransform, Material};

    /// A triangle in the plane z = 0 whose front faces +z.
    fn triangle() -> Primitive {
        Primitive {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            indices: vec![[0, 1, 2]],
            normals: Some(vec![Vec3::Z; 3]),
            uvs: vec![vec![Vec2::ZERO, Vec2::X, Vec2::Y]],
            ..Primitive::default()
        }
    }

    fn scene(transforms: &[Affine3A], shared: bool) -> Scene {
        let mut scene = Scene::default();
        scene.add_material("white", Material::diffuse(Vec3::ONE));
        for transform in transforms {
            let node = scene.add_mesh("triangle", vec![triangle()]) as usize;
            scene.nodes[node].local = LocalTransform::Matrix(*transform);
            if shared {
                scene.nodes[node].mesh = Some(0);
            }
        }
        scene
    }

    #[test]
    fn baked_and_instanced_surfaces_agree_under_any_transform() {
        let transforms = [
            Affine3A::from_translation(Vec3::new(-3.0, 0.0, 0.0)),
            Affine3A::from_scale(Vec3::new(-2.0, 1.0, 3.0)),
            Affine3A {
                matrix3: Mat3A::from_cols_array(&[1.0, 0.2, 0.5, 0.3, 1.0, 0.0, 0.0, 0.1, -1.0]),
                translation: glam::Vec3A::new(4.0, 0.0, 1.0),
            },
        ];
        let options = TraceOptions::default();
        let (baked, instanced) = (scene(&transforms, false), scene(&transforms, true));
        let flats = [&baked, &instanced].map(|s| {
            Flattener::new(s, BuildOptions::default()).at(&Pose::rest(s)).expect("builds")
        });
        assert_eq!(flats.each_ref().map(|f| f.instances.len()), [1, 3]);
        for transform in &transforms {
            let target = transform.transform_point3(Vec3::new(0.25, 0.25, 0.0));
            let ray = Ray::new(target + Vec3::new(0.3, 0.2, 5.0), Vec3::new(-0.3, -0.2, -5.0));
            let surfaces = flats.each_ref().map(|flat| {
                let hit = flat.tlas.closest_hit(&ray, &options, &AcceptAll);
                assert!(hit.is_hit());
                (flat.surface(&hit), flat.uv_at(&hit, 0))
            });
            let expected = (transform.matrix3.inverse().transpose() * Vec3::Z).normalize();
            for (surface, uv) in surfaces {
                assert!((surface.position - target).length() < 1e-5);
                assert!((surface.geometric_normal - expected).length() < 1e-5, "{surface:?}");
                assert!((surface.shading_normal - expected).length() < 1e-5);
                assert_eq!(surface.front, surface.geometric_normal.dot(ray.direction) < 0.0);
                assert!((uv - Vec2::splat(0.25)).length() < 1e-5);
                assert_eq!(surface.uv[0], uv);
                let area = transform
                    .transform_vector3(Vec3::X)
                    .cross(transform.transform_vector3(Vec3::Y))
                    .length();
                assert!((surface.uv_density(0) * area - 1.0).abs() < 1e-4);
            }
            assert_eq!(surfaces[0].0.front, surfaces[1].0.front);
        }
    }

    #[test]
    fn hidden_and_empty_nodes_leave_nothing() {
        let scene = scene(&[Affine3A::from_scale(Vec3::ZERO); 2], true);
        let flat = Flattener::new(&scene, BuildOptions::default())
            .at(&Pose::rest(&scene))
            .expect("builds");
        assert!(flat.instances.is_empty());
        let ray = Ray::new(Vec3::Z, -Vec3::Z);
        assert!(!flat.tlas.any_hit(&ray, &TraceOptions::default(), &AcceptAll));
    }
}
