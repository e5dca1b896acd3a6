//! Integrators: what a batch of eye rays brings back. One file each.
//!
//! All of them work on queues: plain slices of rays go to the structure in one call, the hits are
//! shaded one after the other, and what goes on becomes the next queue.

mod ao;
mod direct;
mod inspect;
mod path;
mod point_lights;
mod queue;
mod whitted;

use crate::{
    Display,
    batch::{Batch, Context},
};

pub use inspect::View;
pub(crate) use point_lights::PointLights;
use queue::Queues;
pub(crate) use queue::{ray_key, shadow_key};

/// What a pixel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum IntegratorKind {
    /// Light transport by path tracing.
    #[default]
    Path,
    /// Whitted's ray tracing: perfect reflection and refraction, sharp shadows.
    Whitted,
    /// Light that comes from lights directly.
    Direct,
    /// Ambient occlusion: the cosine-weighted share of the hemisphere that is open.
    AmbientOcclusion,
    /// A property of the first hit.
    Inspect(View),
}

impl IntegratorKind {
    /// All of them with the names that users type.
    pub const ALL: [(&'static str, Self); 12] = [
        ("path", Self::Path),
        ("whitted", Self::Whitted),
        ("direct", Self::Direct),
        ("ao", Self::AmbientOcclusion),
        ("albedo", Self::Inspect(View::Albedo)),
        ("normal", Self::Inspect(View::Normal)),
        ("geometric_normal", Self::Inspect(View::GeometricNormal)),
        ("depth", Self::Inspect(View::Depth)),
        ("uv", Self::Inspect(View::Uv)),
        ("instance", Self::Inspect(View::Instance)),
        ("material", Self::Inspect(View::Material)),
        ("nodes_visited", Self::Inspect(View::NodesVisited)),
    ];

    /// The name that users type.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }

    /// What its numbers mean to a screen.
    pub fn display(self) -> Display {
        match self {
            Self::Path | Self::Whitted | Self::Direct => Display::Radiance,
            Self::AmbientOcclusion => Display::Colours,
            Self::Inspect(view) => view.display(),
        }
    }
}

/// The queues of all integrators; allocated once a worker.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    queues: Queues,
    shadows: whitted::Shadows,
    inspect: inspect::Counts,
}

impl Scratch {
    /// Finds the radiance, and if asked for the features, of each slot of the batch.
    pub(crate) fn integrate(&mut self, context: &Context<'_>, batch: &mut Batch) {
        match context.settings.integrator {
            IntegratorKind::Path => path::integrate(context, batch, &mut self.queues),
            IntegratorKind::Direct => direct::integrate(context, batch, &mut self.queues),
            IntegratorKind::Whitted => {
                whitted::integrate(context, batch, &mut self.queues, &mut self.shadows);
            }
            IntegratorKind::AmbientOcclusion => ao::integrate(context, batch, &mut self.queues),
            IntegratorKind::Inspect(view) => {
                inspect::integrate(view, context, batch, &mut self.queues, &mut self.inspect);
            }
        }
    }
}
