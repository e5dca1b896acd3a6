//! Closed meshes from files.

use std::{collections::HashMap, path::Path};

use glam::{Affine3A, Vec3};
use rayburst_math::{Aabb, hash::Rng};
use rayburst_scene::{
    Pose,
    import::{self, LoadOptions},
};

use crate::meshes::{ClosedMesh, ClosedScene, winding_number};

/// Points from which rays start.
const POINTS: usize = 24;

/// All triangles of a scene at rest, vertices at the same place made one; an error if they are not
/// closed.
pub fn load(path: &Path) -> Result<ClosedScene, String> {
    let at = path.display();
    let scene = import::load(path, &LoadOptions::default()).map_err(|e| format!("{at}: {e}"))?;
    let mut mesh = ClosedMesh::default();
    let mut ids = HashMap::new();
    let pose = Pose::rest(&scene);
    for (node, world) in scene.nodes.iter().zip(&pose.world) {
        let Some(of_node) = node.mesh else { continue };
        for primitive in &scene.meshes[of_node as usize].primitives {
            for triangle in &primitive.indices {
                let vertices = triangle.map(|i| {
                    let p = world.transform_point3(primitive.positions[i as usize]);
                    // Minus zero is zero.
                    *ids.entry((p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert_with(|| {
                        mesh.positions.push(p);
                        mesh.positions.len() as u32 - 1
                    })
                });
                let [a, b, c] = vertices;
                if a != b && b != c && c != a {
                    mesh.indices.push(vertices);
                }
            }
        }
    }
    if let Some(defect) = mesh.defect() {
        return Err(format!("{at} is not closed: {defect}"));
    }
    mesh.inside = inside(&mesh);
    if mesh.inside.is_empty() {
        return Err(format!("{at}: no point well inside was found"));
    }
    Ok(ClosedScene { name: path.display().to_string(), mesh, instances: vec![] })
}

/// Small cubes around points that are inside, as are points near them.
fn inside(mesh: &ClosedMesh) -> Vec<Affine3A> {
    let bounds = Aabb::of_points(mesh.positions.iter().copied());
    let size = bounds.upper - bounds.lower;
    let mut rng = Rng::new(1);
    let mut cubes = vec![];
    for _ in 0..40 * POINTS {
        let p = bounds.lower + size * rng.vec3();
        let margin = 1e-3 * size.max_element();
        let near = mesh.positions.iter().any(|q| q.distance(p) < 4.0 * margin);
        if !near && winding_number(mesh, p) > 0.9 {
            cubes.push(Affine3A::from_translation(p) * Affine3A::from_scale(Vec3::splat(margin)));
            if cubes.len() == POINTS {
                break;
            }
        }
    }
    cubes
}
