//! Joint influences of vertices (glTF 2.0, section 3.7.3.3): up to eight, weights summing to one.

use super::{mesh::Attributes, warnings::Warnings};
use crate::{VertexSkin, import::ImportError};

/// Reads `JOINTS_0`, `JOINTS_1` and their weights.
pub(super) fn read(
    attributes: &Attributes<'_>,
    vertices: usize,
    warnings: &mut Warnings,
) -> Result<Option<Vec<VertexSkin>>, ImportError> {
    if !attributes.has("JOINTS_0") || !attributes.has("WEIGHTS_0") {
        return Ok(None);
    }
    if attributes.has("JOINTS_2") {
        let what = "more than eight joints a vertex; the first eight are used";
        warnings.add(what, attributes.location(), 1);
    }
    attributes
        .source
        .charge((vertices * size_of::<VertexSkin>()) as u64, || attributes.location().to_owned())?;
    let mut skin = vec![VertexSkin::default(); vertices];
    for (set, names) in [("JOINTS_0", "WEIGHTS_0"), ("JOINTS_1", "WEIGHTS_1")].iter().enumerate() {
        let (Some(joints), Some(weights)) =
            (attributes.accessor(names.0, &["VEC4"])?, attributes.accessor(names.1, &["VEC4"])?)
        else {
            continue;
        };
        let joints = attributes.integers4(&joints)?;
        let weights = attributes.read4(&weights)?;
        for ((vertex, joints), weights) in skin.iter_mut().zip(joints).zip(weights) {
            for i in 0..4 {
                // What weighs nothing may point anywhere.
                if weights[i] > 0.0 && weights[i].is_finite() {
                    let Ok(joint) = u16::try_from(joints[i]) else {
                        let reason = format!("joint {} is out of range", joints[i]);
                        return Err(attributes.source.malformed(attributes.location(), reason));
                    };
                    vertex.joints[4 * set + i] = joint;
                    vertex.weights[4 * set + i] = weights[i];
                }
            }
        }
    }
    for vertex in &mut skin {
        let sum: f32 = vertex.weights.iter().sum();
        let scale = 1.0 / sum;
        if scale.is_finite() && scale > 0.0 {
            vertex.weights = vertex.weights.map(|w| w * scale);
        } else {
            // A vertex that nothing moves follows the first joint.
            *vertex = VertexSkin::default();
            vertex.weights[0] = 1.0;
        }
    }
    Ok(Some(skin))
}
