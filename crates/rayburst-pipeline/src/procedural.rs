//! Procedural primitives: intersection shaders, what they report, and what becomes of it.

use std::{any::Any, ops::ControlFlow};

use bytemuck::Pod;
use rayburst_accel::{ProceduralCandidate, RayFlags};
use rayburst_math::{Hit, HitKind, Ray};

use crate::{AnyHitResult, hit_group::HitRecord, trace::Search};

/// Attributes as words, of which the first bytes are those of the type.
pub(crate) type Attributes = [u32; 8];

/// The attributes of a triangle.
pub(crate) fn barycentrics(hit: &Hit) -> Attributes {
    [hit.u.to_bits(), hit.v.to_bits(), 0, 0, 0, 0, 0, 0]
}

/// Attributes of at most 32 bytes as words.
pub(crate) fn words_of<A: Pod>(attributes: &A) -> Attributes {
    let mut words = [0; 8];
    let bytes = bytemuck::bytes_of(attributes);
    bytemuck::cast_slice_mut(&mut words)[..bytes.len()].copy_from_slice(bytes);
    words
}

/// A hit that an intersection shader reports.
pub(crate) fn report(candidate: &ProceduralCandidate, t: f32, kind: u8) -> Hit {
    Hit {
        t,
        u: 0.0,
        v: 0.0,
        primitive: candidate.primitive,
        geometry: candidate.geometry,
        instance: candidate.instance,
        kind: HitKind::procedural(kind),
        reserved: 0,
    }
}

/// What the intersection shaders of a ray have reported so far.
pub(crate) struct Reports<'b> {
    search: &'b Search<'b>,
    pub(crate) payload: &'b mut dyn Any,
    pub(crate) t_max: f32,
    /// The hit that the ray stops at so far, and whether its attributes are those below.
    best: Hit,
    attributes: Option<Attributes>,
    ended: bool,
    candidate: ProceduralCandidate,
    record: Option<&'b dyn HitRecord>,
}

impl Reports<'_> {
    /// Whether a hit is accepted; see [`crate::Intersection::report_hit`].
    pub(crate) fn report(&mut self, t: f32, kind: u8, attributes: Attributes) -> bool {
        let inside = t >= self.search.ray.ray.t_min && t <= self.t_max;
        let Some(record) = self.record.filter(|_| inside && !self.ended) else { return false };
        let candidate = &self.candidate;
        let hit = report(candidate, t, kind);
        // Of hits at one distance the least indices win, whatever the order; of one primitive the last.
        if self.best.is_hit() && self.best.precedes(&hit) {
            return false;
        }
        if !candidate.opaque && record.has_any_hit() {
            let (call, ray) = (&self.search.call, self.search.ray);
            match record.any_hit(call, ray, &hit, &attributes, &mut *self.payload) {
                AnyHitResult::Ignore => return false,
                AnyHitResult::Accept => {}
                AnyHitResult::AcceptAndEndSearch => self.ended = true,
            }
        }
        (self.best, self.attributes, self.t_max) = (hit, Some(attributes), t);
        self.ended |= self.search.ray.flags.contains(RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH);
        true
    }
}

/// The procedural hit at which a ray stops rather than at `triangle`, which may be none.
pub(crate) fn find(
    search: &Search<'_>,
    mask: u8,
    triangle: &Hit,
    payload: &mut dyn Any,
) -> Option<(Hit, Attributes)> {
    let options = search.ray.flags.options(mask);
    let t_max = if triangle.is_hit() { triangle.t } else { search.ray.ray.t_max };
    let ray = Ray { t_max, ..search.ray.ray };
    let none = ProceduralCandidate { instance: 0, geometry: 0, primitive: 0, opaque: true };
    let mut reports = Reports {
        search,
        payload,
        t_max,
        best: *triangle,
        attributes: None,
        ended: false,
        candidate: none,
        record: None,
    };
    let mut visit = |candidate: &ProceduralCandidate, _: f32| {
        let record = search.record(candidate.instance, candidate.geometry);
        if let Some(record) = record {
            (reports.candidate, reports.record) = (*candidate, Some(record));
            record.intersection(&search.call, search.ray, candidate, &mut reports);
        }
        if reports.ended { ControlFlow::Break(()) } else { ControlFlow::Continue(reports.t_max) }
    };
    search.call.dispatch.tlas.procedural_candidates(&ray, &options, &mut visit);
    reports.attributes.map(|attributes| (reports.best, attributes))
}
