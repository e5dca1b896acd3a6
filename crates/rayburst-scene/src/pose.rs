//! One instant of a scene: animated local transforms and morph weights, composed to world space.

use glam::{Affine3A, Mat4};

use crate::Scene;

/// An animation: channels that move nodes (glTF 2.0, section 3.11).
#[derive(Clone, Debug, Default)]
pub struct Animation {
    /// Name, may be empty.
    pub name: String,
    /// What it moves.
    pub channels: Vec<Channel>,
    /// Time of the last key, seconds.
    pub duration: f32,
}

/// Keys of one property of one node.
#[derive(Clone, Debug)]
pub struct Channel {
    /// The node it moves.
    pub node: u32,
    /// What moves.
    pub property: Property,
    /// How values between keys are found.
    pub interpolation: Interpolation,
    /// Strictly increasing key times, seconds.
    pub times: Vec<f32>,
    /// `width` numbers a key (three times as many for cubic splines: in-tangent, value, out-tangent).
    pub values: Vec<f32>,
    /// Numbers a value: 3 for translations and scales, 4 for rotations, the number of morph targets
    /// for weights.
    pub width: usize,
}

/// Properties that an animation can move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Of a [`crate::LocalTransform::Parts`].
    Translation,
    /// Of a [`crate::LocalTransform::Parts`]; x, y, z, w.
    Rotation,
    /// Of a [`crate::LocalTransform::Parts`].
    Scale,
    /// Morph weights.
    Weights,
}

/// Interpolation between keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The previous key's value.
    Step,
    /// Linear; spherical for rotations.
    #[default]
    Linear,
    /// Cubic Hermite spline.
    CubicSpline,
}

/// World transforms and morph weights of all nodes.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    /// Node to world, one a node.
    pub world: Vec<Affine3A>,
    /// Morph weights, one list a node; empty where the mesh has no targets.
    pub weights: Vec<Vec<f32>>,
}

impl Pose {
    /// The pose of the scene as authored, without animation.
    pub fn rest(scene: &Scene) -> Self {
        let mut world: Vec<Affine3A> = Vec::with_capacity(scene.nodes.len());
        let mut weights = Vec::with_capacity(scene.nodes.len());
        for node in &scene.nodes {
            let local = node.local.to_affine();
            world.push(node.parent.map_or(local, |p| world[p as usize] * local));
            let own = if node.weights.is_empty() {
                node.mesh.map(|m| scene.meshes[m as usize].weights.clone()).unwrap_or_default()
            } else {
                node.weights.clone()
            };
            weights.push(own);
        }
        Self { world, weights }
    }

    /// Matrices of a skin's joints from bind-pose object space to world space.
    pub fn joint_matrices(&self, scene: &Scene, skin: u32) -> Vec<Mat4> {
        let skin = &scene.skins[skin as usize];
        skin.joints
            .iter()
            .zip(&skin.inverse_bind)
            .map(|(&joint, bind)| Mat4::from(self.world[joint as usize]) * *bind)
            .collect()
    }
}
