//! Morph targets and skinning on the CPU (glTF 2.0, sections 3.7.2.2 and 3.7.3).

use glam::{Mat3, Mat4, Vec3};

use crate::Primitive;

/// The primitive with morph weights and joint matrices applied. Joint matrices lead from bind-pose
/// object space to where the mesh shall be (world space when they come from
/// [`crate::Pose::joint_matrices`]). Targets without a weight count as weight 0.
pub fn deform(primitive: &Primitive, weights: &[f32], joints: Option<&[Mat4]>) -> Primitive {
    let mut bent = Primitive { targets: Vec::new(), skin: None, ..primitive.clone() };
    for (target, &weight) in primitive.targets.iter().zip(weights) {
        if weight == 0.0 {
            continue;
        }
        add(&mut bent.positions, target.positions.as_deref(), weight);
        if let Some(normals) = &mut bent.normals {
            add(normals, target.normals.as_deref(), weight);
        }
        if let (Some(tangents), Some(deltas)) = (&mut bent.tangents, &target.tangents) {
            for (t, &d) in tangents.iter_mut().zip(deltas) {
                *t = (t.truncate() + weight * d).extend(t.w);
            }
        }
    }
    if let (Some(joints), Some(skin)) = (joints, &primitive.skin) {
        for (vertex, influence) in skin.iter().enumerate() {
            let mut matrix = Mat4::ZERO;
            for (&joint, &weight) in influence.joints.iter().zip(&influence.weights) {
                if let (true, Some(j)) = (weight != 0.0, joints.get(joint as usize)) {
                    matrix += *j * weight;
                }
            }
            if matrix == Mat4::ZERO {
                continue;
            }
            bent.positions[vertex] = matrix.transform_point3(bent.positions[vertex]);
            let linear = Mat3::from_mat4(matrix);
            if let Some(normals) = &mut bent.normals {
                let n = cofactor(linear) * normals[vertex];
                normals[vertex] = n.normalize_or(normals[vertex]);
            }
            if let Some(tangents) = &mut bent.tangents {
                let t = tangents[vertex];
                tangents[vertex] = (linear * t.truncate()).normalize_or(t.truncate()).extend(t.w);
            }
        }
    }
    bent
}

fn add(values: &mut [Vec3], deltas: Option<&[Vec3]>, weight: f32) {
    for (v, &d) in values.iter_mut().zip(deltas.unwrap_or_default()) {
        *v += weight * d;
    }
}

/// The cofactor matrix: maps normals as the inverse transpose does, up to a factor, and exists for
/// singular matrices too.
fn cofactor(m: Mat3) -> Mat3 {
    Mat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}
