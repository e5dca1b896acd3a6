//! Morph targets and skinning on the CPU (glTF 2.0, sections 3.7.2.2 and 3.7.3).
//!
//! Vertices are independent and worked on in parallel blocks; the result does not depend on how
//! the blocks are shared out.

use glam::{Mat3, Mat4, Vec3, Vec4};
use rayon::prelude::*;

use crate::{MorphTarget, Primitive, VertexSkin};

/// Vertices of one block.
const BLOCK: usize = 4096;

/// The primitive with morph weights and joint matrices applied. Joint matrices lead from bind-pose
/// object space to where the mesh shall be (world space when they come from
/// [`crate::Pose::joint_matrices`]). Targets without a weight count as weight 0.
///
/// A primitive without normals stays without them, and so flat.
pub fn deform(primitive: &Primitive, weights: &[f32], joints: Option<&[Mat4]>) -> Primitive {
    let mut bent = Primitive {
        positions: primitive.positions.clone(),
        indices: primitive.indices.clone(),
        normals: primitive.normals.clone(),
        tangents: primitive.tangents.clone(),
        uvs: primitive.uvs.clone(),
        colors: primitive.colors.clone(),
        skin: None,
        targets: Vec::new(),
        material: primitive.material,
    };
    let active: Vec<(&MorphTarget, f32)> =
        primitive.targets.iter().zip(weights.iter().copied()).filter(|(_, w)| *w != 0.0).collect();
    let skin = joints.zip(primitive.skin.as_deref());
    if active.is_empty() && skin.is_none() {
        return bent;
    }
    let count = bent.positions.len();
    let mut normals = bent.normals.iter_mut().flat_map(|n| n.chunks_mut(BLOCK));
    let mut tangents = bent.tangents.iter_mut().flat_map(|t| t.chunks_mut(BLOCK));
    let mut blocks: Vec<Block<'_>> = bent
        .positions
        .chunks_mut(BLOCK)
        .enumerate()
        .map(|(number, positions)| Block {
            first: number * BLOCK,
            positions,
            normals: normals.next().unwrap_or_default(),
            tangents: tangents.next().unwrap_or_default(),
        })
        .collect();
    let work = |block: &mut Block<'_>| {
        for &(target, weight) in &active {
            block.morph(target, weight);
        }
        match skin {
            Some((joints, skin)) => block.skin(joints, skin),
            None => block.normalize(),
        }
    };
    if count <= BLOCK {
        blocks.iter_mut().for_each(work);
    } else {
        blocks.par_iter_mut().for_each(work);
    }
    bent
}

/// Some vertices in a row; `normals` and `tangents` are empty where the primitive has none.
struct Block<'p> {
    first: usize,
    positions: &'p mut [Vec3],
    normals: &'p mut [Vec3],
    tangents: &'p mut [Vec4],
}

impl Block<'_> {
    fn morph(&mut self, target: &MorphTarget, weight: f32) {
        // A target without an attribute adds nothing to it.
        fn deltas(all: &Option<Vec<Vec3>>, first: usize) -> &[Vec3] {
            all.as_deref().and_then(|all| all.get(first..)).unwrap_or_default()
        }
        let positions = deltas(&target.positions, self.first);
        let normals = deltas(&target.normals, self.first);
        let tangents = deltas(&target.tangents, self.first);
        for (p, d) in self.positions.iter_mut().zip(positions) {
            *p += weight * *d;
        }
        for (n, d) in self.normals.iter_mut().zip(normals) {
            *n += weight * *d;
        }
        for (t, d) in self.tangents.iter_mut().zip(tangents) {
            *t += (weight * *d).extend(0.0);
        }
    }

    fn skin(&mut self, joints: &[Mat4], skin: &[VertexSkin]) {
        for (i, influence) in skin.iter().skip(self.first).take(self.positions.len()).enumerate() {
            let mut matrix = Mat4::ZERO;
            for (&joint, &weight) in influence.joints.iter().zip(&influence.weights) {
                if let (true, Some(j)) = (weight != 0.0, joints.get(joint as usize)) {
                    matrix += *j * weight;
                }
            }
            self.positions[i] = matrix.transform_point3(self.positions[i]);
            let linear = Mat3::from_mat4(matrix);
            if let Some(normal) = self.normals.get_mut(i) {
                *normal = (cofactor(linear) * *normal).normalize_or(*normal);
            }
            if let Some(tangent) = self.tangents.get_mut(i) {
                let t = tangent.truncate();
                *tangent = (linear * t).normalize_or(t).extend(tangent.w);
            }
        }
    }

    fn normalize(&mut self) {
        for normal in &mut *self.normals {
            *normal = normal.normalize_or_zero();
        }
        for tangent in &mut *self.tangents {
            *tangent = tangent.truncate().normalize_or_zero().extend(tangent.w);
        }
    }
}

/// The cofactor matrix: maps normals as the inverse transpose does, up to a positive factor of a
/// map that does not mirror, and exists for singular matrices too.
fn cofactor(m: Mat3) -> Mat3 {
    Mat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `count` vertices on a line along x, with normals, tangents, a target and two joints.
    fn line(count: usize) -> Primitive {
        let target = MorphTarget {
            positions: Some((0..count).map(|i| Vec3::new(0.0, i as f32, 0.0)).collect()),
            normals: Some(vec![Vec3::X; count]),
            tangents: None,
        };
        let skin = (0..count).map(|i| {
            let second = i as f32 / count as f32;
            let mut vertex = VertexSkin::default();
            (vertex.joints[1], vertex.weights[0], vertex.weights[1]) = (1, 1.0 - second, second);
            vertex
        });
        Primitive {
            positions: (0..count).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect(),
            normals: Some(vec![Vec3::Z; count]),
            tangents: Some(vec![Vec4::new(1.0, 0.0, 0.0, -1.0); count]),
            skin: Some(skin.collect()),
            targets: vec![target.clone(), target],
            ..Primitive::default()
        }
    }

    #[test]
    fn targets_add_up_by_weight() {
        let bent = deform(&line(4), &[0.5, 1.5], None);
        for (i, p) in bent.positions.iter().enumerate() {
            assert_eq!(*p, Vec3::new(i as f32, 2.0 * i as f32, 0.0));
        }
        let normal = Vec3::new(2.0, 0.0, 1.0).normalize();
        assert!(bent.normals.unwrap().iter().all(|n| n.abs_diff_eq(normal, 1e-6)));
        assert!(bent.targets.is_empty() && bent.skin.is_none());
        // Weights that are missing count as 0, and so does no weight at all.
        assert_eq!(deform(&line(4), &[], None).positions, line(4).positions);
        let flat = Primitive { normals: None, ..line(4) };
        assert!(deform(&flat, &[1.0], None).normals.is_none());
    }

    #[test]
    fn joints_blend_by_weight() {
        let up = Mat4::from_translation(Vec3::Y);
        let turn = Mat4::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let bent = deform(&line(2), &[], Some(&[up, turn]));
        // The first vertex follows the first joint; the second halves (1, 1, 0) and (0, 1, 0).
        assert_eq!(bent.positions[0], Vec3::Y);
        assert!(bent.positions[1].abs_diff_eq(Vec3::new(0.5, 1.0, 0.0), 1e-6));
        let tangents = bent.tangents.unwrap();
        assert_eq!(tangents[0], Vec4::new(1.0, 0.0, 0.0, -1.0));
        let diagonal = Vec3::new(1.0, 1.0, 0.0).normalize();
        assert!(tangents[1].abs_diff_eq(diagonal.extend(-1.0), 1e-6));
        assert!(bent.normals.unwrap()[1].abs_diff_eq(Vec3::Z, 1e-6));
    }

    #[test]
    fn normals_lean_with_squashed_joints() {
        let mut slope = line(1);
        slope.normals = Some(vec![Vec3::new(1.0, 1.0, 0.0).normalize()]);
        let squash = Mat4::from_scale(Vec3::new(0.5, 1.0, 1.0));
        let bent = deform(&slope, &[], Some(&[squash, squash]));
        let expected = Vec3::new(2.0, 1.0, 0.0).normalize();
        assert!(bent.normals.unwrap()[0].abs_diff_eq(expected, 1e-6));
    }

    #[test]
    fn blocks_do_not_show() {
        let (count, weights) = (3 * BLOCK + 17, [0.25, 0.0]);
        let joints = [Mat4::from_rotation_x(0.3), Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0))];
        let bent = deform(&line(count), &weights, Some(&joints));
        for i in [0, BLOCK - 1, BLOCK, 2 * BLOCK + 5, count - 1] {
            let all = line(count);
            let one = |v: &Vec<Vec3>| vec![v[i]];
            let alone = Primitive {
                positions: one(&all.positions),
                normals: all.normals.as_ref().map(one),
                tangents: all.tangents.as_ref().map(|t| vec![t[i]]),
                skin: all.skin.as_ref().map(|s| vec![s[i]]),
                targets: vec![MorphTarget {
                    positions: all.targets[0].positions.as_ref().map(one),
                    normals: all.targets[0].normals.as_ref().map(one),
                    tangents: None,
                }],
                ..Primitive::default()
            };
            let alone = deform(&alone, &weights, Some(&joints));
            assert_eq!(bent.positions[i], alone.positions[0]);
            assert_eq!(bent.normals.as_ref().unwrap()[i], alone.normals.unwrap()[0]);
            assert_eq!(bent.tangents.as_ref().unwrap()[i], alone.tangents.unwrap()[0]);
        }
    }
}
