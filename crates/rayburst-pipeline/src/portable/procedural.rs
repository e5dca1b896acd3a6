//! Procedural primitives of portable pipelines: what intersection shaders report, and what becomes of it.

use std::ops::ControlFlow;

use rayburst_accel::TraceOptions;
use rayburst_math::{Hit, Ray};

use super::{
    PortableCandidate, PortablePipeline,
    group::AnyHit,
    shade::{State, Step},
};
use crate::{
    AnyHitResult,
    procedural::{Attributes, report},
    table::RayTypeInfo,
};

/// A ray that has been asked about triangles.
pub(super) struct Search<'a, P> {
    pub(super) pipeline: &'a PortablePipeline<'a, P>,
    pub(super) step: Step<'a>,
    pub(super) state: &'a State<P>,
    /// The ray that was asked for.
    pub(super) ray: Ray,
    pub(super) ray_type: &'a RayTypeInfo,
    pub(super) options: &'a TraceOptions,
    /// Whether any hit will do.
    pub(super) first: bool,
}

impl<P> Search<'_, P> {
    /// The procedural hit at which the ray stops rather than at `triangle`, which may be none.
    pub(super) fn find(&self, triangle: &Hit) -> Option<(Hit, Attributes)> {
        let Step { tlas, .. } = self.step;
        let (state, pipeline) = (self.state, self.pipeline);
        let t_max = if triangle.is_hit() { triangle.t } else { self.ray.t_max };
        let ray = Ray { t_max, ..self.ray };
        let mut best = *triangle;
        let mut found = None;
        let mut visit = |primitive: &rayburst_accel::ProceduralCandidate, t_current: f32| {
            let (mut t_max, mut ended) = (t_current, false);
            let instance = &tlas.instances()[primitive.instance as usize];
            let index = self.ray_type.record(instance.contribution, primitive.geometry);
            let Some(Some(record)) = pipeline.hits.get(index as usize) else {
                return ControlFlow::Continue(t_max);
            };
            let shown = self.step.ray(state, &self.ray);
            let candidate = PortableCandidate {
                ray: shown,
                primitive: *primitive,
                t_current,
                record: &(),
                tlas,
            };
            let mut consider = |t: f32, kind: u8, attributes: &Attributes| {
                let inside = t >= ray.t_min && t <= t_max;
                let hit = report(primitive, t, kind);
                if !inside || ended || best.is_hit() && best.precedes(&hit) {
                    return;
                }
                if !primitive.opaque && record.has_any_hit() {
                    let hit = AnyHit { ray: shown, hit: &hit, attributes, tlas };
                    if record.any_hit(&hit, &state.payload) == AnyHitResult::Ignore {
                        return;
                    }
                }
                (best, t_max, ended) = (hit, t, self.first);
                found = Some((hit, *attributes));
            };
            record.intersection(&candidate, &state.payload, &mut consider);
            if ended { ControlFlow::Break(()) } else { ControlFlow::Continue(t_max) }
        };
        tlas.procedural_candidates(&ray, self.options, &mut visit);
        found
    }
}
