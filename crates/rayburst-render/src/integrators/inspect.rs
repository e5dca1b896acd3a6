//! Inspection views: a property of what the eye ray meets, or of the search for it.

use rayburst_accel::Counters;
use rayburst_math::{Hit, glam::Vec3, hash};

use super::queue::Queues;
use crate::{
    Display, Features,
    batch::{Batch, Context},
};

/// A property of the first hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum View {
    /// Reflectance.
    Albedo,
    /// Shading normal on the side of the eye, −1…1 shown as 0…1.
    Normal,
    /// Normal of the triangle on the side of the eye, −1…1 shown as 0…1.
    GeometricNormal,
    /// Distance from the eye, world units; 0 without a hit.
    Depth,
    /// First UV set, in red and green.
    Uv,
    /// A colour for each instance.
    Instance,
    /// A colour for each material.
    Material,
    /// Nodes of the acceleration structures that the ray visited.
    NodesVisited,
}

impl View {
    /// What its numbers mean to a screen.
    pub fn display(self) -> Display {
        match self {
            Self::Depth | Self::NodesVisited => Display::Amounts,
            _ => Display::Colours,
        }
    }
}

/// Counters of a batch's rays.
#[derive(Debug, Default)]
pub(super) struct Counts(Vec<Counters>);

pub(super) fn integrate(
    view: View,
    context: &Context<'_>,
    batch: &mut Batch,
    queues: &mut Queues,
    counts: &mut Counts,
) {
    let queue = &mut queues.current;
    queue.start(batch);
    if view == View::NodesVisited {
        queue.trace_counted(context, &mut counts.0);
    } else {
        queue.trace(context);
    }
    for slot in 0..batch.len() {
        let hit = queue.hits[slot];
        let features = hit.is_hit().then(|| {
            let footprint = queue.footprints.get(slot);
            Features::of_hit(context, &queue.rays[slot], &hit, &footprint)
        });
        batch.radiance[slot] = match (view, &features) {
            (View::NodesVisited, _) => Vec3::splat(counts.0[slot].nodes as f32),
            (_, None) => Vec3::ZERO,
            (_, Some(features)) => show(view, context, &queue.rays[slot].direction, &hit, features),
        };
        if let (Some(out), Some(features)) = (batch.features.get_mut(slot), features) {
            *out = features;
        }
    }
}

fn show(
    view: View,
    context: &Context<'_>,
    direction: &Vec3,
    hit: &Hit,
    features: &Features,
) -> Vec3 {
    let normal = |n: Vec3| 0.5 * n + 0.5;
    match view {
        View::Albedo => features.albedo,
        View::Normal => normal(features.normal),
        View::GeometricNormal => normal(context.scene.surface(hit).normal_towards(-*direction)),
        View::Depth => Vec3::splat(features.depth),
        View::Uv => {
            let uv = context.scene.uv_at(hit, 0);
            (uv - uv.floor()).extend(0.0)
        }
        View::Instance => colour_of(features.instance),
        View::Material => colour_of(features.material),
        View::NodesVisited => Vec3::ZERO,
    }
}

/// A colour for a number, never dark.
fn colour_of(id: u32) -> Vec3 {
    let h = hash::pcg(id.wrapping_add(0x51));
    let channel = |shift: u32| ((h >> shift) & 0xFF) as f32 / 255.0;
    let c = Vec3::new(channel(0), channel(8), channel(16));
    0.15 + 0.85 * c * c / (c * c).max_element().max(1e-3)
}
