//! One instant of a scene: animated local transforms and morph weights, composed to world space.

use std::collections::BTreeSet;

use glam::{Affine3A, Mat4, Quat, Vec3};

use crate::{LocalTransform, Scene};

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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

impl Channel {
    /// Writes the value at a time, seconds, to `value`, which holds `width` numbers. Before the
    /// first key and after the last, those keys' values hold (glTF 2.0, appendix C).
    pub fn sample(&self, time: f32, value: &mut [f32]) {
        let next = self.times.partition_point(|&t| t <= time);
        let last = next.saturating_sub(1);
        if next == 0 || next == self.times.len() || self.interpolation == Interpolation::Step {
            value.copy_from_slice(self.part(last, Part::Value));
            return;
        }
        let span = self.times[next] - self.times[last];
        let t = (time - self.times[last]) / span;
        let (a, b) = (self.part(last, Part::Value), self.part(next, Part::Value));
        let turns = self.property == Property::Rotation;
        match self.interpolation {
            Interpolation::Linear if turns => {
                let turn = unit_quaternion(a).slerp(unit_quaternion(b), t);
                value.copy_from_slice(&turn.to_array());
            }
            Interpolation::Linear | Interpolation::Step => {
                for ((v, a), b) in value.iter_mut().zip(a).zip(b) {
                    *v = a + t * (b - a);
                }
            }
            Interpolation::CubicSpline => {
                let (leaves, arrives) = (self.part(last, Part::Out), self.part(next, Part::In));
                let (t2, t3) = (t * t, t * t * t);
                let weight_a = 2.0 * t3 - 3.0 * t2 + 1.0;
                let weight_leaves = span * (t3 - 2.0 * t2 + t);
                let weight_b = 3.0 * t2 - 2.0 * t3;
                let weight_arrives = span * (t3 - t2);
                for (i, v) in value.iter_mut().enumerate() {
                    *v = weight_a * a[i]
                        + weight_leaves * leaves[i]
                        + weight_b * b[i]
                        + weight_arrives * arrives[i];
                }
            }
        }
    }

    fn part(&self, key: usize, part: Part) -> &[f32] {
        let start = match self.interpolation {
            Interpolation::CubicSpline => 3 * key + part as usize,
            _ => key,
        };
        &self.values[start * self.width..][..self.width]
    }
}

/// Parts of a cubic spline's key, in their order.
#[derive(Clone, Copy)]
enum Part {
    In = 0,
    Value = 1,
    Out = 2,
}

/// The unit quaternion in a direction; the identity for those that have none.
fn unit_quaternion(xyzw: &[f32]) -> Quat {
    let q = Quat::from_xyzw(xyzw[0], xyzw[1], xyzw[2], xyzw[3]);
    let length = q.length();
    if length.is_finite() && length > 0.0 { q * (1.0 / length) } else { Quat::IDENTITY }
}

impl Pose {
    /// The pose of the scene as authored, without animation.
    pub fn rest(scene: &Scene) -> Self {
        Self::at(scene, &[], 0.0)
    }

    /// The pose at a time, seconds, with animations playing together; where two move the same
    /// property, the later one in the list wins. Numbers that name no animation are ignored.
    pub fn at(scene: &Scene, animations: &[usize], time: f32) -> Self {
        let mut local: Vec<LocalTransform> = scene.nodes.iter().map(|n| n.local).collect();
        let mut weights: Vec<Vec<f32>> = scene
            .nodes
            .iter()
            .map(|node| match node.mesh {
                Some(mesh) if node.weights.is_empty() => {
                    scene.meshes[mesh as usize].weights.clone()
                }
                _ => node.weights.clone(),
            })
            .collect();
        let playing = animations.iter().filter_map(|&a| scene.animations.get(a));
        for channel in playing.flat_map(|a| &a.channels) {
            let node = channel.node as usize;
            if channel.property == Property::Weights {
                weights[node].resize(channel.width, 0.0);
                channel.sample(time, &mut weights[node]);
                continue;
            }
            let mut value = [0.0; 4];
            channel.sample(time, &mut value[..channel.width.min(4)]);
            let (mut translation, mut rotation, mut scale) = local[node].to_parts();
            let [x, y, z, _] = value;
            match channel.property {
                Property::Translation => translation = Vec3::new(x, y, z),
                Property::Scale => scale = Vec3::new(x, y, z),
                Property::Rotation => rotation = unit_quaternion(&value),
                Property::Weights => {}
            }
            local[node] = LocalTransform::Parts { translation, rotation, scale };
        }
        let mut world: Vec<Affine3A> = Vec::with_capacity(scene.nodes.len());
        for (node, local) in scene.nodes.iter().zip(local) {
            let local = local.to_affine();
            world.push(node.parent.map_or(local, |p| world[p as usize] * local));
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

impl Scene {
    /// The animation of a name, or of a number written out.
    pub fn animation_index(&self, name: &str) -> Option<usize> {
        self.animations
            .iter()
            .position(|a| a.name == name)
            .or_else(|| name.parse().ok().filter(|&index: &usize| index < self.animations.len()))
    }

    /// What plays when nothing is said: the first animation, and each further one that moves
    /// nothing that those before it move. So a walk and a run are not mixed, and ten clips of ten
    /// things play together.
    pub fn default_animations(&self) -> Vec<usize> {
        let mut moved = BTreeSet::new();
        let mut chosen = Vec::new();
        for (index, animation) in self.animations.iter().enumerate() {
            let moves: Vec<_> = animation.channels.iter().map(|c| (c.node, c.property)).collect();
            if moves.iter().all(|m| !moved.contains(m)) {
                moved.extend(moves);
                chosen.push(index);
            }
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Node;

    fn channel(
        property: Property,
        interpolation: Interpolation,
        times: &[f32],
        values: &[f32],
    ) -> Channel {
        let width = if property == Property::Rotation { 4 } else { 3 };
        let (times, values) = (times.to_vec(), values.to_vec());
        Channel { node: 0, property, interpolation, times, values, width }
    }

    fn sample(channel: &Channel, time: f32) -> Vec<f32> {
        let mut value = vec![f32::NAN; channel.width];
        channel.sample(time, &mut value);
        value
    }

    #[test]
    fn steps_hold_and_lines_connect() {
        let values = [0.0, 0.0, 0.0, 4.0, 8.0, -2.0];
        let step = channel(Property::Translation, Interpolation::Step, &[1.0, 3.0], &values);
        let linear = channel(Property::Scale, Interpolation::Linear, &[1.0, 3.0], &values);
        let expected = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.5, 0.0, 0.75), (3.0, 1.0, 1.0)];
        for (time, stepped, blended) in expected.into_iter().chain([(9.0, 1.0, 1.0)]) {
            let at = |s: f32| vec![4.0 * s, 8.0 * s, -2.0 * s];
            assert_eq!(sample(&step, time), at(stepped), "step at {time}");
            assert_eq!(sample(&linear, time), at(blended), "linear at {time}");
        }
        assert_eq!(sample(&linear, f32::NAN), [0.0; 3]);
    }

    #[test]
    fn a_cubic_spline_passes_its_keys_with_its_tangents() {
        // One key a line: in-tangent, value, out-tangent.
        #[rustfmt::skip]
        let values = [
            9.0, 9.0, 9.0,  1.0, 0.0, 0.0,  2.0, 0.0, 0.0,
            0.0, 4.0, 0.0,  3.0, 2.0, 0.0,  9.0, 9.0, 9.0,
        ];
        let cubic =
            channel(Property::Translation, Interpolation::CubicSpline, &[0.0, 2.0], &values);
        assert_eq!(sample(&cubic, 0.0), [1.0, 0.0, 0.0]);
        assert_eq!(sample(&cubic, 2.0), [3.0, 2.0, 0.0]);
        // t = 1/2 of 2 s: half of both values, tangents by 2 · (1/8) and -2 · (1/8).
        assert_eq!(sample(&cubic, 1.0), [2.0 + 0.5, 1.0 - 1.0, 0.0]);
        // t = 1/4: 27/32 and 5/32 of the values, tangents by 2 · 9/64 and -2 · 3/64.
        let expected = [27.0 / 32.0 + 15.0 / 32.0 + 36.0 / 64.0, 10.0 / 32.0 - 24.0 / 64.0, 0.0];
        assert_eq!(sample(&cubic, 0.5), expected);
        let rate = (sample(&cubic, 1e-3)[0] - 1.0) / 1e-3;
        assert!((rate - 2.0).abs() < 1e-2, "it leaves by its out-tangent, {rate}");
    }

    #[test]
    fn rotations_take_the_short_way_at_even_speed() {
        let quarter = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        // The same turn with the opposite sign: the long way, if signs were not heeded.
        let values = [[0.0, 0.0, 0.0, 1.0], (-quarter).to_array()].concat();
        let turn = channel(Property::Rotation, Interpolation::Linear, &[0.0, 1.0], &values);
        for time in [0.25, 0.5, 0.75] {
            let angle = time * std::f32::consts::FRAC_PI_2;
            let value = sample(&turn, time);
            let got = Quat::from_slice(&value);
            assert!(got.dot(Quat::from_rotation_y(angle)).abs() > 1.0 - 1e-6, "{got} at {time}");
            assert!((got.length() - 1.0).abs() < 1e-6);
        }
        let nothing = channel(Property::Rotation, Interpolation::Linear, &[0.0, 1.0], &[0.0; 8]);
        assert_eq!(sample(&nothing, 0.5), [0.0, 0.0, 0.0, 1.0]);
    }

    fn moving_pair() -> Scene {
        let mut scene = Scene::default();
        let matrix = LocalTransform::Matrix(Affine3A::from_scale(Vec3::splat(2.0)));
        scene.nodes.push(Node { local: matrix, ..Node::default() });
        let child = LocalTransform::Parts {
            translation: Vec3::X,
            rotation: Quat::IDENTITY,
            scale: Vec3::ONE,
        };
        scene.nodes.push(Node { local: child, parent: Some(0), ..Node::default() });
        for (name, property) in [("a", Property::Translation), ("b", Property::Scale)] {
            let keys = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
            let moves = channel(property, Interpolation::Linear, &[0.0, 1.0], &keys);
            let channels = vec![moves];
            scene.animations.push(Animation { name: name.into(), channels, duration: 1.0 });
        }
        let twice = scene.animations[0].clone();
        scene.animations.push(Animation { name: "c".into(), ..twice });
        scene
    }

    #[test]
    fn parents_move_children_and_matrices_become_parts() {
        let scene = moving_pair();
        let rest = Pose::rest(&scene);
        assert_eq!(rest.world[1].translation, glam::Vec3A::new(2.0, 0.0, 0.0));
        let moved = Pose::at(&scene, &[0], 0.5);
        assert_eq!(moved.world[1].translation, glam::Vec3A::new(2.5, 0.5, 0.5));
        let both = Pose::at(&scene, &[0, 1, 77], 0.5);
        assert_eq!(both.world[1].translation, glam::Vec3A::new(1.0, 0.5, 0.5));
    }

    #[test]
    fn animations_are_found_and_chosen() {
        let scene = moving_pair();
        assert_eq!(scene.animation_index("b"), Some(1));
        assert_eq!(scene.animation_index("2"), Some(2));
        assert_eq!(scene.animation_index("3"), None);
        assert_eq!(scene.default_animations(), [0, 1]);
    }
}
