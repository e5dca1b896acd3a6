//! Animations (glTF 2.0, section 3.11): keys, checked so that sampling them cannot fail.

use super::{accessor::Accessor, json, source::Source, warnings::Warnings};
use crate::{
    LocalTransform, Mesh, Node,
    import::ImportError,
    pose::{Animation, Channel, Interpolation, Property},
};

/// Reads all animations. Channels of nodes outside the scene are left out; a node that is animated
/// by parts and has a matrix gets parts.
pub(super) fn read(
    source: &Source<'_>,
    new_index: &[Option<u32>],
    nodes: &mut [Node],
    meshes: &[Mesh],
    warnings: &mut Warnings,
) -> Result<Vec<Animation>, ImportError> {
    let mut animations = Vec::with_capacity(source.root.animations.len());
    for (index, json) in source.root.animations.iter().enumerate() {
        let mut animation = Animation { name: json.name.clone(), ..Animation::default() };
        for (number, channel) in json.channels.iter().enumerate() {
            let location = format!("/animations/{index}/channels/{number}");
            let Some(target) = channel.target.node else { continue };
            if target >= new_index.len() {
                return Err(source.malformed(location, format!("there is no node {target}")));
            }
            let Some(node) = new_index[target] else { continue };
            let placed = &mut nodes[node as usize];
            let property = match channel.target.path.as_str() {
                "translation" => Property::Translation,
                "rotation" => Property::Rotation,
                "scale" => Property::Scale,
                "weights" => Property::Weights,
                other => {
                    let what = format!("'{other:.40}' cannot be animated; ignored");
                    warnings.add(what, location, 1);
                    continue;
                }
            };
            let width = match property {
                Property::Translation | Property::Scale => 3,
                Property::Rotation => 4,
                Property::Weights => placed.mesh.map_or(0, |m| meshes[m as usize].weights.len()),
            };
            if width == 0 {
                warnings.add("weights are animated where there are none", location, 1);
                continue;
            }
            let Some(sampler) = json.samplers.get(channel.sampler) else {
                let reason = format!("there is no sampler {}", channel.sampler);
                return Err(source.malformed(location, reason));
            };
            let Some(keys) = keys(source, sampler, property, width, &location, warnings)? else {
                continue;
            };
            if property != Property::Weights {
                let (translation, rotation, scale) = placed.local.to_parts();
                placed.local = LocalTransform::Parts { translation, rotation, scale };
            }
            animation.duration = animation.duration.max(keys.times.last().copied().unwrap_or(0.0));
            animation.channels.push(Channel { node, ..keys });
        }
        animations.push(animation);
    }
    Ok(animations)
}

/// The keys of a sampler; `None`, with a warning, for those that make no sense.
fn keys(
    source: &Source<'_>,
    json: &json::AnimationSampler,
    property: Property,
    width: usize,
    location: &str,
    warnings: &mut Warnings,
) -> Result<Option<Channel>, ImportError> {
    let interpolation = match json.interpolation.as_deref() {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::CubicSpline,
        Some(other) => {
            warnings.add(format!("unknown interpolation '{other:.20}'; linear"), location, 1);
            Interpolation::Linear
        }
    };
    let input = Accessor::new(source, json.input, &["SCALAR"])?;
    let kind = match property {
        Property::Translation | Property::Scale => "VEC3",
        Property::Rotation => "VEC4",
        Property::Weights => "SCALAR",
    };
    let output = Accessor::new(source, json.output, &[kind])?;
    let times: Vec<f32> = input.floats::<1>(source, None)?.into_iter().flatten().collect();
    let values = match output.width() {
        1 => output.floats::<1>(source, None)?.into_flattened(),
        3 => output.floats::<3>(source, None)?.into_flattened(),
        _ => output.floats::<4>(source, None)?.into_flattened(),
    };
    let per_key = if interpolation == Interpolation::CubicSpline { 3 * width } else { width };
    if times.is_empty() || values.len() < times.len() * per_key {
        let (numbers, keys) = (values.len(), times.len());
        let what =
            format!("{numbers} numbers for {keys} keys of {per_key}; the channel is ignored");
        warnings.add(what, location, 1);
        return Ok(None);
    }
    let mut channel =
        Channel { node: 0, property, interpolation, times: Vec::new(), values: Vec::new(), width };
    let mut skipped = 0;
    for (&time, value) in times.iter().zip(values.chunks_exact(per_key)) {
        let later = channel.times.last().is_none_or(|&last| time > last);
        if later && time.is_finite() && value.iter().all(|v| v.is_finite()) {
            channel.times.push(time);
            channel.values.extend_from_slice(value);
        } else {
            skipped += 1;
        }
    }
    if skipped > 0 {
        warnings.add("keys out of order or not finite; left out", location, skipped);
    }
    Ok((!channel.times.is_empty()).then_some(channel))
}
