//! The nodes of the scene that is shown (glTF 2.0, section 3.5), parents before children, with
//! skins, cameras, lights and `EXT_mesh_gpu_instancing`.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Mat4, Quat, Vec3};

use super::{accessor::Accessor, json, source::Source, warnings::Warnings};
use crate::{
    Light, LightKind, LocalTransform, Node, Projection, SceneCamera, Skin, import::ImportError,
};

/// Nodes in their new order, and where the file's nodes went.
pub(super) struct Hierarchy {
    pub(super) nodes: Vec<Node>,
    /// New index of each node of the file, if it is part of the scene.
    pub(super) new_index: Vec<Option<u32>>,
}

/// Reads the default scene, or the first, or all nodes where the file has no scene.
pub(super) fn read(source: &Source<'_>, warnings: &mut Warnings) -> Result<Hierarchy, ImportError> {
    let root = source.root;
    let parents = find_parents(source)?;
    let at = root.scene.unwrap_or(0);
    let mut roots: Vec<usize> = match root.scenes.get(at) {
        Some(scene) => scene.nodes.clone(),
        None if root.scene.is_some() => {
            return Err(source.malformed("/scene", format!("there is no scene {at}")));
        }
        None => (0..root.nodes.len()).filter(|&n| parents[n].is_none()).collect(),
    };
    if let Some(&missing) = roots.iter().find(|&&n| n >= root.nodes.len()) {
        let reason = format!("there is no node {missing}");
        return Err(source.malformed(format!("/scenes/{at}"), reason));
    }
    if roots.is_empty() && !root.nodes.is_empty() {
        if root.scenes.is_empty() {
            return Err(source.malformed("/nodes", "every node has a parent: they form a cycle"));
        }
        warnings.add("the scene has no nodes", format!("/scenes/{at}"), 1);
    }
    let visible = roots.len();
    roots.extend(roots_of_joints(source, &parents));

    let mut new_index: Vec<Option<u32>> = vec![None; root.nodes.len()];
    let mut nodes: Vec<Node> = Vec::new();
    for (number, &start) in roots.iter().enumerate() {
        let seen = number < visible;
        let mut stack = vec![(start, None)];
        while let Some((index, parent)) = stack.pop() {
            if new_index[index].is_some() {
                if !seen {
                    continue;
                }
                let reason = "it is reached twice: several parents, or a cycle";
                return Err(source.malformed(format!("/nodes/{index}"), reason));
            }
            let new = nodes.len() as u32;
            new_index[index] = Some(new);
            nodes.push(convert(source, index, parent, seen, warnings)?);
            stack.extend(root.nodes[index].children.iter().rev().map(|&c| (c, Some(new))));
        }
    }
    Ok(Hierarchy { nodes, new_index })
}

/// The parent of each node; each has one at most, so that what hangs from a root is a tree.
fn find_parents(source: &Source<'_>) -> Result<Vec<Option<usize>>, ImportError> {
    let nodes = &source.root.nodes;
    let mut parents = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            let Some(parent) = parents.get_mut(child) else {
                let reason = format!("there is no node {child}");
                return Err(source.malformed(format!("/nodes/{index}/children"), reason));
            };
            if let Some(other) = parent.replace(index) {
                let reason = format!("it is a child of both node {other} and node {index}");
                return Err(source.malformed(format!("/nodes/{child}"), reason));
            }
        }
    }
    Ok(parents)
}

/// Roots above joints: joints may hang from nodes outside the scene, whose meshes are not shown.
fn roots_of_joints(source: &Source<'_>, parents: &[Option<usize>]) -> Vec<usize> {
    let mut done = vec![false; parents.len()];
    let mut roots = Vec::new();
    for &joint in source.root.skins.iter().flat_map(|s| &s.joints) {
        let mut at = joint;
        while at < done.len() && !done[at] {
            done[at] = true;
            match parents[at] {
                Some(parent) => at = parent,
                None => roots.push(at),
            }
        }
    }
    roots
}

fn convert(
    source: &Source<'_>,
    index: usize,
    parent: Option<u32>,
    seen: bool,
    warnings: &mut Warnings,
) -> Result<Node, ImportError> {
    let root = source.root;
    let json = &root.nodes[index];
    let location = || format!("/nodes/{index}");
    let check = |reference: Option<usize>, count: usize, what: &str| match reference {
        Some(i) if i >= count => {
            Err(source.malformed(location(), format!("there is no {what} {i}")))
        }
        Some(i) if seen => Ok(Some(i as u32)),
        _ => Ok(None),
    };
    let lights = root.extensions.lights.as_ref().map_or(0, |l| l.lights.len());
    let light = json.extensions.light.as_ref().map(|l| l.light);
    let local = local_transform(json);
    if !local.to_affine().is_finite() {
        return Err(source.malformed(location(), "its transform is not finite"));
    }
    let mut node = Node {
        name: json.name.clone(),
        parent,
        local,
        mesh: check(json.mesh, root.meshes.len(), "mesh")?,
        skin: check(json.skin, root.skins.len(), "skin")?,
        weights: json.weights.iter().map(|&w| if w.is_finite() { w } else { 0.0 }).collect(),
        camera: check(json.camera, root.cameras.len(), "camera")?,
        light: check(light, lights, "light")?,
        instances: Vec::new(),
    };
    if let (Some(instancing), Some(_)) = (&json.extensions.instancing, node.mesh) {
        node.instances = instances(source, instancing, &location())?;
        if node.instances.is_empty() {
            warnings.add("EXT_mesh_gpu_instancing without instances", location(), 1);
            node.mesh = None;
        }
    }
    Ok(node)
}

fn local_transform(json: &json::Node) -> LocalTransform {
    if let Some(matrix) = &json.matrix {
        return LocalTransform::Matrix(Affine3A::from_mat4(Mat4::from_cols_array(matrix)));
    }
    LocalTransform::Parts {
        translation: Vec3::from(json.translation.unwrap_or([0.0; 3])),
        rotation: unit_quaternion(json.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])),
        scale: Vec3::from(json.scale.unwrap_or([1.0; 3])),
    }
}

/// The unit quaternion in a direction; the identity for those that have none.
fn unit_quaternion(xyzw: [f32; 4]) -> Quat {
    let [x, y, z, w] = xyzw.map(f64::from);
    let length = (x * x + y * y + z * z + w * w).sqrt();
    if length > 0.0 && length.is_finite() {
        Quat::from_array([x, y, z, w].map(|c| (c / length) as f32))
    } else {
        Quat::IDENTITY
    }
}

fn instances(
    source: &Source<'_>,
    json: &json::Instancing,
    location: &str,
) -> Result<Vec<Affine3A>, ImportError> {
    let accessor = |name: &str, kind: &str| {
        json.attributes.get(name).map(|&index| Accessor::new(source, index, &[kind])).transpose()
    };
    let translation = accessor("TRANSLATION", "VEC3")?;
    let rotation = accessor("ROTATION", "VEC4")?;
    let scale = accessor("SCALE", "VEC3")?;
    let counts: Vec<usize> =
        [&translation, &rotation, &scale].into_iter().flatten().map(|a| a.count).collect();
    let count = counts.first().copied().unwrap_or(0);
    if counts.iter().any(|&c| c != count) {
        let reason = "the attributes of EXT_mesh_gpu_instancing differ in their numbers";
        return Err(source.malformed(location, reason));
    }
    source.charge((count * size_of::<Affine3A>()) as u64, || location.to_owned())?;
    let vec3 = |a: &Accessor<'_>| a.floats::<3>(source, None);
    let translation = translation.as_ref().map(vec3).transpose()?;
    let rotation = rotation.as_ref().map(|a| a.floats::<4>(source, None)).transpose()?;
    let scale = scale.as_ref().map(vec3).transpose()?;
    let instance = |i: usize| {
        Affine3A::from_scale_rotation_translation(
            scale.as_ref().map_or(Vec3::ONE, |s| Vec3::from(s[i])),
            rotation.as_ref().map_or(Quat::IDENTITY, |r| unit_quaternion(r[i])),
            translation.as_ref().map_or(Vec3::ZERO, |t| Vec3::from(t[i])),
        )
    };
    // An instance that is nowhere cannot be seen.
    Ok((0..count).map(instance).filter(Affine3A::is_finite).collect())
}

/// Skins, with joints among the new nodes.
pub(super) fn skins(
    source: &Source<'_>,
    new_index: &[Option<u32>],
) -> Result<Vec<Skin>, ImportError> {
    let mut skins = Vec::with_capacity(source.root.skins.len());
    for (index, json) in source.root.skins.iter().enumerate() {
        let location = format!("/skins/{index}");
        let joint = |&j: &usize| {
            new_index.get(j).copied().flatten().ok_or_else(|| {
                source.malformed(location.as_str(), format!("joint {j} is not a node"))
            })
        };
        let joints = json.joints.iter().map(joint).collect::<Result<Vec<_>, _>>()?;
        let inverse_bind = match json.inverse_bind_matrices {
            None => vec![Mat4::IDENTITY; joints.len()],
            Some(accessor) => {
                let accessor = Accessor::new(source, accessor, &["MAT4"])?;
                if accessor.count < joints.len() {
                    let (found, needed) = (accessor.count, joints.len());
                    let reason = format!("{found} inverse bind matrices for {needed} joints");
                    return Err(source.malformed(location, reason));
                }
                let matrices = accessor.floats::<16>(source, None)?;
                matrices.iter().take(joints.len()).map(Mat4::from_cols_array).collect()
            }
        };
        skins.push(Skin { joints, inverse_bind });
    }
    Ok(skins)
}

/// Cameras, in the file's order.
pub(super) fn cameras(source: &Source<'_>) -> Result<Vec<SceneCamera>, ImportError> {
    let read = |(index, json): (usize, &json::Camera)| {
        let projection = match (&json.perspective, &json.orthographic) {
            (Some(p), _) if p.yfov > 0.0 && p.yfov < PI => Projection::Perspective { fov: p.yfov },
            (_, Some(o)) if o.ymag != 0.0 && o.ymag.is_finite() => {
                Projection::Orthographic { half_height: o.ymag.abs() }
            }
            _ => {
                let reason = "neither a perspective (yfov in (0, π)) nor an orthographic camera";
                return Err(source.malformed(format!("/cameras/{index}"), reason));
            }
        };
        Ok(SceneCamera { name: json.name.clone(), projection })
    };
    source.root.cameras.iter().enumerate().map(read).collect()
}

/// Lights of `KHR_lights_punctual`, in the file's order.
pub(super) fn lights(
    source: &Source<'_>,
    warnings: &mut Warnings,
) -> Result<Vec<Light>, ImportError> {
    let lights = source.root.extensions.lights.as_ref();
    let mut read = Vec::new();
    for (index, json) in lights.iter().flat_map(|l| &l.lights).enumerate() {
        let location = format!("/extensions/KHR_lights_punctual/lights/{index}");
        let color = Vec3::from(json.color.unwrap_or([1.0; 3])).max(Vec3::ZERO);
        let mut intensity = color * json.intensity.unwrap_or(1.0).max(0.0);
        if !intensity.is_finite() {
            warnings.add("a light's intensity is not finite; it is dark", location.as_str(), 1);
            intensity = Vec3::ZERO;
        }
        let (position, direction) = (Vec3::ZERO, Vec3::NEG_Z);
        let kind = match json.kind.as_str() {
            "point" => LightKind::Point { position },
            "directional" => LightKind::Directional { direction, angular_radius: 0.0 },
            "spot" => {
                let default = json::Spot::default();
                let spot = json.spot.as_ref().unwrap_or(&default);
                let clean = |angle: Option<f32>, otherwise: f32| {
                    angle.filter(|a| a.is_finite()).unwrap_or(otherwise).clamp(0.0, FRAC_PI_2)
                };
                let outer = clean(spot.outer_cone_angle, PI / 4.0);
                let inner = clean(spot.inner_cone_angle, 0.0).min(outer);
                LightKind::Spot {
                    position,
                    direction,
                    cos_inner: inner.cos(),
                    cos_outer: outer.cos(),
                }
            }
            other => {
                let reason = format!("unknown type of light '{:.20}'", other);
                return Err(source.malformed(location, reason));
            }
        };
        read.push(Light { intensity, kind });
    }
    Ok(read)
}
