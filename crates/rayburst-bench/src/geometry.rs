//! A scene as one list of triangles, so that every engine gets the same geometry.

use glam::Vec3;
use rayburst_math::Aabb;
use rayburst_scene::{LightKind, Pose, Scene};

/// All placed triangles of a scene in world space, and where its first light is.
#[derive(Clone, Debug, Default)]
pub struct FlatMesh {
    /// Vertex positions, world space.
    pub positions: Vec<Vec3>,
    /// Vertices of each triangle.
    pub indices: Vec<[u32; 3]>,
    /// Position of the first point or spot light.
    pub light: Option<Vec3>,
}

impl FlatMesh {
    /// Flattens a scene at rest. `None` when it has more vertices than 32-bit indices can name.
    pub fn new(scene: &Scene) -> Option<Self> {
        let pose = Pose::rest(scene);
        let mut flat = Self::default();
        for (node, world) in scene.nodes.iter().zip(&pose.world) {
            let Some(mesh) = node.mesh else { continue };
            let once = node.instances.is_empty().then_some(*world);
            let places = once.into_iter().chain(node.instances.iter().map(|i| *world * *i));
            for place in places {
                for primitive in &scene.meshes[mesh as usize].primitives {
                    let first = u32::try_from(flat.positions.len()).ok()?;
                    let last = flat.positions.len() + primitive.positions.len();
                    u32::try_from(last).ok()?;
                    let moved = primitive.positions.iter().map(|&p| place.transform_point3(p));
                    flat.positions.extend(moved);
                    let shifted = primitive.indices.iter().map(|t| t.map(|i| i + first));
                    flat.indices.extend(shifted);
                }
            }
        }
        let placed = scene.nodes.iter().zip(&pose.world).filter_map(|(node, world)| {
            let light = &scene.lights[node.light? as usize];
            let local = matches!(light.kind, LightKind::Point { .. } | LightKind::Spot { .. });
            local.then_some(Vec3::from(world.translation))
        });
        let free = scene.world_lights.iter().filter_map(|light| match light.kind {
            LightKind::Point { position } | LightKind::Spot { position, .. } => Some(position),
            LightKind::Directional { .. } => None,
        });
        flat.light = free.chain(placed).next();
        Some(flat)
    }

    /// Bounds of all finite vertices.
    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(self.positions.iter().copied().filter(|p| p.is_finite()))
    }

    /// The unit normal of a triangle's plane; zero when it has no area.
    pub fn normal(&self, triangle: u32) -> Vec3 {
        let [a, b, c] = self.indices[triangle as usize].map(|i| self.positions[i as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    }
}
