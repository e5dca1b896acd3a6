//! What the queries share: candidates, where they come from, and the leaf that finds them.

use std::ops::ControlFlow;

use rayburst_math::{Hit, HitKind, Ray};
use rayburst_simd::{Isa, TriangleHits, Triangles4};

use super::{
    count::Count,
    prepare::{PreparedRay, Span},
    walk::{Stack, walk},
};
use crate::{
    Blas, CandidateFilter, Cull, InstanceFlags, TraceOptions, layout::triangles::TriangleId,
};

/// A query, asked whether it wants the triangles that a ray meets.
pub(crate) trait Query {
    /// Whether near subtrees are visited first.
    const ORDERED: bool;

    /// The end of the interval that still matters, in units of the ray's direction.
    fn t_max(&self) -> f32;

    /// Whether taking the candidate would change the answer.
    fn wants(&self, candidate: &Candidate, place: &Place<'_>) -> bool;

    /// Takes a candidate that passed the filter.
    fn take(&mut self, candidate: &Candidate, place: &Place<'_>) -> ControlFlow<()>;
}

/// A triangle that a ray meets within the interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Distance in units of the ray's direction.
    pub(crate) t: f32,
    pub(crate) u: f32,
    pub(crate) v: f32,
    /// Number of the triangle in its BLAS.
    pub(crate) triangle: u32,
    /// Whether the front is seen.
    pub(crate) front: bool,
}

/// A BLAS and how it is seen.
pub(crate) struct Place<'a> {
    pub(crate) blas: &'a Blas,
    pub(crate) instance: u32,
    clockwise: bool,
    force_opaque: Option<bool>,
    /// Lanes kept of front faces, and of back faces.
    keep: [u32; 2],
}

impl<'a> Place<'a> {
    #[inline(always)]
    pub(crate) fn new(
        blas: &'a Blas,
        instance: u32,
        flags: InstanceFlags,
        options: &TraceOptions,
    ) -> Self {
        let cull = if flags.cull_disable { Cull::None } else { options.cull };
        let keep = |kept: bool| if kept { u32::MAX } else { 0 };
        Self {
            blas,
            instance,
            clockwise: flags.front_clockwise,
            force_opaque: flags.force_opaque,
            keep: [keep(cull != Cull::Front), keep(cull != Cull::Back)],
        }
    }

    /// Of lanes that wind counter-clockwise or not, those that show their front.
    #[inline(always)]
    fn front(&self, counter_clockwise: u32) -> u32 {
        if self.clockwise { !counter_clockwise } else { counter_clockwise }
    }

    #[inline(always)]
    fn is_opaque(&self, id: TriangleId) -> bool {
        self.force_opaque.unwrap_or(id.is_opaque())
    }

    /// The hit that a candidate would be.
    #[inline(always)]
    pub(crate) fn hit(&self, candidate: &Candidate) -> Hit {
        let (geometry, primitive) = self.blas.locate(candidate.triangle);
        Hit {
            t: candidate.t,
            u: candidate.u,
            v: candidate.v,
            primitive,
            geometry,
            instance: self.instance,
            kind: if candidate.front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK },
            reserved: 0,
        }
    }
}

/// The filter and what it is told of the ray.
pub(crate) struct Asker<'a, F> {
    pub(crate) filter: &'a F,
    pub(crate) ray: &'a Ray,
    pub(crate) index: u32,
}

/// Asks a query of one BLAS; `ray` is in its space.
#[inline(always)]
pub(crate) fn trace_blas<I: Isa, Q: Query, F: CandidateFilter, C: Count>(
    isa: I,
    place: &Place<'_>,
    ray: &PreparedRay,
    asker: &Asker<'_, F>,
    stack: &mut Stack,
    query: &mut Q,
    count: &mut C,
) -> ControlFlow<()> {
    let mut span = ray.span(asker.ray.t_min, query.t_max());
    let mut hits = TriangleHits::NONE;
    let tree = &place.blas.tree;
    let leaf = |value: u32, span: &mut Span, count: &mut C| {
        // SAFETY: values of a BLAS' leaves come from `TriangleLeaves::place`: a block is there.
        let block: &Triangles4 = unsafe { tree.block(value) };
        count.leaf(TriangleId::used_lanes(block));
        let mut mask = isa.triangles4(block, &ray.shear, span.t_min, span.t_max, &mut hits);
        if mask == 0 {
            return ControlFlow::Continue(());
        }
        let front = place.front(hits.front);
        mask &= (front & place.keep[0]) | (!front & place.keep[1]);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % 4;
            mask &= mask - 1;
            let id = TriangleId::of_lane(block, lane);
            let candidate = Candidate {
                t: ray.external(hits.t[lane]),
                u: hits.u[lane],
                v: hits.v[lane],
                triangle: id.triangle(),
                front: front >> lane & 1 != 0,
            };
            // Conversion is exact but for subnormal distances.
            let inside = asker.ray.t_min <= candidate.t && candidate.t <= query.t_max();
            if inside
                && query.wants(&candidate, place)
                && (!F::ACTIVE
                    || place.is_opaque(id)
                    || asker.filter.accept(asker.index, asker.ray, &place.hit(&candidate)))
            {
                query.take(&candidate, place)?;
                if Q::ORDERED {
                    span.t_max = hits.t[lane];
                }
            }
        }
        ControlFlow::Continue(())
    };
    if Q::ORDERED {
        walk::<I, C, true>(isa, tree, &ray.slab, &mut span, stack, count, leaf)
    } else {
        walk::<I, C, false>(isa, tree, &ray.slab, &mut span, stack, count, leaf)
    }
}
