//! What the queries share: candidates, where they come from, and the leaf that finds them.

use std::ops::ControlFlow;

use rayburst_math::{Hit, HitKind, Ray};
use rayburst_simd::{Isa, Nearest, TriangleHits, barycentric};

use super::{
    count::Count,
    prepare::{PreparedRay, Span},
    walk::{Leaves, Stack, walk},
};
use crate::{
    Blas, CandidateFilter, Cull, InstanceFlags, Skip, TraceOptions,
    layout::{triangles::TriangleId, view::Leaf},
};

/// A query, asked whether it wants the triangles that a ray meets.
pub(crate) trait Query {
    /// Whether near subtrees are visited first.
    const ORDERED: bool;
    /// Whether the interval of an ordered query ends at what it took last.
    const ENDS_AT_TAKEN: bool = true;

    /// The end of the interval that still matters, in units of the ray's direction.
    fn t_max(&self) -> f32;

    /// Whether taking the candidate would change the answer.
    fn wants(&self, candidate: &Candidate, place: &Place<'_>) -> bool;

    /// Takes a candidate that passed the filter.
    fn take(&mut self, candidate: &Candidate, place: &Place<'_>) -> ControlFlow<()>;
}

/// A query that one hit answers: any, or the nearest if it is ordered. It may note the hit and complete
/// it later, and be left to another traversal half-way.
pub(crate) trait OneHit: Query + Copy {
    /// Notes a hit, if it is one, that is better than all before.
    fn put_off(&mut self, hit: bool, pending: Pending) -> ControlFlow<()>;

    /// Completes the hit that was put off last, if any; where it was found, `span` ends at it.
    fn settle(&mut self, place: &Place<'_>, ray: &PreparedRay, span: &Span);

    /// Whether a triangle of `place` is the one that was taken or put off last.
    fn has(&self, triangle: u32, place: &Place<'_>) -> bool;

    /// The query of a ray that has found this in `place` so far.
    fn resume(ray: &Ray, place: &Place<'_>, found: Option<&Candidate>) -> Self;

    /// What was found; of queries that are not ordered only whether something was.
    fn found(&self) -> Option<Candidate>;
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
#[derive(Clone, Copy)]
pub(crate) struct Place<'a> {
    pub(crate) blas: &'a Blas,
    pub(crate) instance: u32,
    clockwise: bool,
    force_opaque: Option<bool>,
    skip: Skip,
    /// Lanes kept of triangles that wind counter-clockwise, and of those that wind clockwise.
    pub(crate) keep: [u32; 2],
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
            force_opaque: options.force_opaque.or(flags.force_opaque),
            skip: options.skip,
            keep: if flags.front_clockwise {
                [keep(!cull.skips_back()), keep(!cull.skips_front())]
            } else {
                [keep(!cull.skips_front()), keep(!cull.skips_back())]
            },
        }
    }

    /// Of lanes that wind counter-clockwise or not, those that show their front.
    #[inline(always)]
    pub(crate) fn front(&self, counter_clockwise: u32) -> u32 {
        if self.clockwise { !counter_clockwise } else { counter_clockwise }
    }

    /// Of lanes, those that the filter has a say in.
    #[inline(always)]
    pub(crate) fn translucent(&self, leaf: Leaf<'_>) -> u32 {
        match self.force_opaque {
            Some(true) => 0,
            Some(false) => u32::MAX,
            None => leaf.translucent_lanes(),
        }
    }

    #[inline(always)]
    pub(crate) fn is_opaque(&self, id: TriangleId) -> bool {
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

/// A hit of which only the distance and the place are known yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pending(u64);

impl Pending {
    pub(crate) const NONE: Self = Self(u64::MAX);

    /// The leaf and the lane.
    #[inline(always)]
    fn leaf<'a>(self, place: &Place<'a>) -> (Leaf<'a>, usize) {
        // SAFETY: the value is one that `test_leaf` had, of a leaf of the place's tree.
        let leaf = unsafe { place.blas.tree.view().leaf((self.0 >> 2) as u32) };
        (leaf, self.0 as usize % 4)
    }

    /// The triangle; there must be one.
    #[inline(always)]
    pub(crate) fn triangle(self, place: &Place<'_>) -> u32 {
        let (leaf, lane) = self.leaf(place);
        leaf.id(lane).triangle()
    }

    #[inline(always)]
    fn new(value: u32, lane: u32) -> Self {
        Self(u64::from(value) << 2 | u64::from(lane))
    }
}

/// Offers a query the triangles of a leaf of `place`'s BLAS that a ray meets within `span`, which
/// shrinks with what is taken if the query is ordered; `ray` is in the BLAS' space.
///
/// What a query wants is usually the nearest opaque hit or any one. That is found without a branch
/// that depends on the ray: each costs more than the triangles do. The rest is [`test_each`]'s.
#[inline(always)]
pub(crate) fn test_leaf<I: Isa, Q: OneHit, F: CandidateFilter, C: Count>(
    isa: I,
    place: &Place<'_>,
    ray: &PreparedRay,
    value: u32,
    asker: &Asker<'_, F>,
    span: &mut Span,
    query: &mut Q,
    count: &mut C,
) -> ControlFlow<()> {
    // SAFETY: values of a BLAS' leaves come from writers of its tree.
    let leaf = unsafe { place.blas.tree.view().leaf(value) };
    count.leaf(leaf);
    let nearest = leaf.nearest4(isa, &ray.shear, span, place.keep);
    if is_plain::<F>(&nearest, place, ray, leaf, span) {
        take_plain(&nearest, value, span, query)
    } else if is_met_again(&nearest, place, leaf, span, query) {
        ControlFlow::Continue(())
    } else {
        query.settle(place, ray, span);
        test_each(isa, place, ray, leaf, asker, span, query)
    }
}

/// Whether what was found in a leaf is what the query has already: after spatial splits several leaves
/// hold a triangle.
#[inline(always)]
pub(crate) fn is_met_again<Q: OneHit>(
    nearest: &Nearest,
    place: &Place<'_>,
    leaf: Leaf<'_>,
    span: &Span,
    query: &Q,
) -> bool {
    Q::ORDERED
        && !nearest.doubtful
        && nearest.t == span.t_max
        && query.has(leaf.id(nearest.lane as usize % 4).triangle(), place)
}

/// Whether there is nothing to decide about what was found in a leaf.
#[inline(always)]
pub(crate) fn is_plain<F: CandidateFilter>(
    nearest: &Nearest,
    place: &Place<'_>,
    ray: &PreparedRay,
    leaf: Leaf<'_>,
    span: &Span,
) -> bool {
    let mut plain = !nearest.doubtful & (nearest.t != span.t_max);
    // Distances that the ray's units cannot express exactly.
    plain &= nearest.t.abs() >= ray.smallest();
    if F::ACTIVE {
        plain &= nearest.mask & place.translucent(leaf) == 0;
    }
    plain
}

/// Takes what was found in the leaf of that value, if it is plain.
#[inline(always)]
pub(crate) fn take_plain<Q: OneHit>(
    nearest: &Nearest,
    value: u32,
    span: &mut Span,
    query: &mut Q,
) -> ControlFlow<()> {
    let hit = nearest.mask != 0;
    if Q::ORDERED {
        // Infinite without a hit, nearer with one: a minimum instead of a branch.
        let nearer = without_sign_of_zero(nearest.t);
        span.t_max = if nearer < span.t_max { nearer } else { span.t_max };
    }
    query.put_off(hit, Pending::new(value, nearest.lane))
}

/// Makes −0 a 0, whose bits sort like its value.
#[inline(always)]
pub(crate) fn without_sign_of_zero(t: f32) -> f32 {
    t + 0.0
}

/// The candidate that is pending in `place`; `t` is its internal distance.
#[inline(always)]
pub(crate) fn settle_candidate(
    place: &Place<'_>,
    ray: &PreparedRay,
    pending: Pending,
    t: f32,
) -> Candidate {
    let (leaf, lane) = pending.leaf(place);
    let (u, v, counter_clockwise) = barycentric(&leaf.corners_along(lane, &ray.shear), &ray.shear);
    Candidate {
        t: ray.external(t),
        u,
        v,
        triangle: leaf.id(lane).triangle(),
        front: place.front(u32::from(counter_clockwise)) & 1 != 0,
    }
}

/// Offers a query one by one the triangles of a leaf that a ray meets.
#[inline(always)]
pub(crate) fn test_each<I: Isa, Q: Query, F: CandidateFilter>(
    isa: I,
    place: &Place<'_>,
    ray: &PreparedRay,
    leaf: Leaf<'_>,
    asker: &Asker<'_, F>,
    span: &mut Span,
    query: &mut Q,
) -> ControlFlow<()> {
    let mut hits = TriangleHits::NONE;
    let mut mask = leaf.triangles4(isa, &ray.shear, span, &mut hits);
    if mask == 0 {
        return ControlFlow::Continue(());
    }
    mask &= (hits.front & place.keep[0]) | (!hits.front & place.keep[1]);
    let front = place.front(hits.front);
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize % 4;
        mask &= mask - 1;
        let id = leaf.id(lane);
        let t = without_sign_of_zero(hits.t[lane]);
        let candidate = Candidate {
            t: ray.external(t),
            u: hits.u[lane],
            v: hits.v[lane],
            triangle: id.triangle(),
            front: front >> lane & 1 != 0,
        };
        // Conversion is exact but for subnormal distances.
        let inside = asker.ray.t_min <= candidate.t && candidate.t <= query.t_max();
        let opaque = place.is_opaque(id);
        if inside
            && query.wants(&candidate, place)
            && !place.skip.skips(opaque)
            && (!F::ACTIVE
                || opaque
                || asker.filter.accept(asker.index, asker.ray, &place.hit(&candidate)))
        {
            query.take(&candidate, place)?;
            if F::ENDS && !opaque && asker.filter.ends() {
                return ControlFlow::Break(());
            }
            if Q::ORDERED {
                let exact = Q::ENDS_AT_TAKEN && t.abs() >= ray.smallest();
                span.t_max = if exact { t } else { ray.span(0.0, query.t_max()).t_max };
            }
        }
    }
    ControlFlow::Continue(())
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
    let tree = place.blas.tree.view();
    let mut leaves = Blocks { isa, place, ray, asker, query };
    // SAFETY: the place borrows the BLAS, which owns the tree.
    unsafe {
        if Q::ORDERED {
            walk::<I, C, true>(isa, tree, &ray.slab, &mut span, stack, count, &mut leaves)
        } else {
            walk::<I, C, false>(isa, tree, &ray.slab, &mut span, stack, count, &mut leaves)
        }
    }
}

/// The leaves of a BLAS for one ray at a time: [`test_each`] and not [`test_leaf`], since branches are
/// predicted there, and what comes after a leaf that is missed need not wait for it.
struct Blocks<'a, 'b, I, F, Q> {
    isa: I,
    place: &'a Place<'b>,
    ray: &'a PreparedRay,
    asker: &'a Asker<'b, F>,
    query: &'a mut Q,
}

impl<I: Isa, F: CandidateFilter, Q: Query, C: Count> Leaves<C> for Blocks<'_, '_, I, F, Q> {
    #[inline(always)]
    fn visit(&mut self, value: u32, span: &mut Span, count: &mut C) -> ControlFlow<()> {
        // SAFETY: values of a BLAS' leaves come from writers of its tree.
        let leaf = unsafe { self.place.blas.tree.view().leaf(value) };
        count.leaf(leaf);
        test_each(self.isa, self.place, self.ray, leaf, self.asker, span, self.query)
    }
}
