//! Bundles of up to 64 coherent rays that go through the tree together.
//!
//! A bundle visits a node once for all its rays. An interval of rays (see [`Frustum`]) is tested
//! against the eight children first; each child that it meets is then tested against the groups of
//! sixteen rays until one group meets it (the first active group; Wald, Boulos, Shirley, "Ray tracing
//! deformable scenes using dynamic bounding volume hierarchies", 2007, who track the first ray), so a
//! child costs little more for 64 rays than for one. In leaves, triangles are tested against the
//! groups that meet the leaf's box.
//!
//! The rays of a bundle agree in the signs of their directions, in the longest component and in its
//! power of two. Rays for which the tests in groups are in doubt, and blocks that the filter has a say
//! in, are left to the tests of single rays, so that the answers are the same bits.

use std::{mem::MaybeUninit, ops::ControlFlow};

use rayburst_math::{Aabb, Ray};
use rayburst_simd::{
    Frustum, GROUP, Group16, GroupAxes, Isa, Kernel, Question16, Row16, Triangles4,
};

use super::{
    answers::Answers,
    count::Count,
    prepare::{self, PreparedRay, Span},
    query::{Asker, Candidate, OneHit, Place, Query, test_each},
};
use crate::{
    CandidateFilter,
    build::binned_sah::MAX_DEPTH,
    layout::{
        bvh8::{Node8, Reference},
        triangles::{BLOCK, TriangleId},
    },
    structure::{Structure, Tracer},
};

/// Rays in a bundle.
pub(crate) const BUNDLE: usize = 64;
const GROUPS: usize = BUNDLE / GROUP;

/// Rays that agree make a bundle only if there are as many.
const FEWEST: u32 = 16;

/// Seven siblings a level and one to spare, as a power of two.
const ENTRIES: usize = (7 * MAX_DEPTH + 1).next_power_of_two();

/// Rays side by side as they are given, in the space of the BLAS.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Raw16 {
    origin: [Row16; 3],
    direction: [Row16; 3],
    t_min: Row16,
    t_max: Row16,
    /// What rays of a bundle must agree in; [`UNABLE`] if they belong in none.
    key: [u32; GROUP],
}

/// The key of rays that no bundle takes: invalid, of extreme lengths, or backwards in time.
const UNABLE: u32 = u32::MAX;

/// Exponents of the longest component at which scales and distances are far from the ends of `f32`.
const EXPONENTS: std::ops::Range<u32> = 64..190;

impl Raw16 {
    const NONE: Self = Self {
        origin: [[0.0; GROUP]; 3],
        direction: [[0.0; GROUP]; 3],
        t_min: [0.0; GROUP],
        t_max: [0.0; GROUP],
        key: [UNABLE; GROUP],
    };

    #[inline(always)]
    fn set(&mut self, lane: usize, ray: &Ray) {
        for axis in 0..3 {
            self.origin[axis][lane] = ray.origin[axis];
            self.direction[axis][lane] = ray.direction[axis];
        }
        self.t_min[lane] = ray.t_min;
        self.t_max[lane] = ray.t_max;
    }

    #[inline(always)]
    fn find_keys(&mut self) {
        for lane in 0..GROUP {
            let [x, y, z] = [0, 1, 2].map(|axis| self.direction[axis][lane].abs());
            let xy = if x > y { x } else { y };
            let longest = if xy > z { xy } else { z };
            let axis = (u32::from(y > x) & u32::from(y >= z)) + 2 * u32::from(z > xy);
            let exponent = longest.to_bits() >> 23;
            let sign = |axis: usize| self.direction[axis][lane].to_bits() >> 31;
            let signs = sign(0) | sign(1) << 1 | sign(2) << 2;
            let [a, b, c] = [0, 1, 2].map(|axis| self.origin[axis][lane].abs());
            let most = prepare::MAX_ORIGIN;
            let (t_min, t_max) = (self.t_min[lane], self.t_max[lane]);
            // False for NaN.
            let able = (a <= most)
                & (b <= most)
                & (c <= most)
                & (x <= f32::MAX)
                & (y <= f32::MAX)
                & (z <= f32::MAX)
                & (t_min >= 0.0)
                & (t_min <= t_max)
                & EXPONENTS.contains(&exponent);
            let key = signs | axis << 3 | exponent << 5;
            self.key[lane] = if able { key } else { UNABLE };
        }
    }

    /// Makes the lanes that are not of `mask` copies of a ray.
    #[inline(always)]
    fn fill(&mut self, mask: u32, ray: &Ray) {
        for lane in 0..GROUP {
            let keep = mask >> lane & 1 != 0;
            for axis in 0..3 {
                let (o, d) = (self.origin[axis][lane], self.direction[axis][lane]);
                self.origin[axis][lane] = if keep { o } else { ray.origin[axis] };
                self.direction[axis][lane] = if keep { d } else { ray.direction[axis] };
            }
        }
    }
}

/// A subtree or leaf to visit later.
#[derive(Clone, Copy)]
struct Entry {
    /// No ray of the bundle is there before.
    near: f32,
    child: Reference,
    /// The node it is a child of, and four times the slot there plus the first group that meets it.
    parent: Reference,
    place: u32,
}

/// What a bundle is on its way.
struct Bundle {
    axes: GroupAxes,
    frustum: Frustum,
    groups: [Group16; GROUPS],
    /// Rays of each group that are still looking.
    active: [u32; GROUPS],
    t_min: f32,
    t_max: f32,
    smallest: f32,
    /// From internal distances to those in units of the direction.
    scale: f32,
    visits: u32,
}

/// Traces a batch of rays; those that belong in no bundle are appended to `others`.
#[inline(always)]
pub(crate) fn trace<'a, I: Isa, S: Structure, F: CandidateFilter, C: Count, A: Answers>(
    tracer: &mut Tracer<'a, I, S, F, C>,
    rays: &'a [Ray],
    first: usize,
    counts: &mut [C],
    answers: &mut A,
    others: &mut Vec<u32>,
) {
    let Some(place) = tracer.structure.place(tracer.options) else {
        others.extend((first..first + rays.len().min(BUNDLE)).map(|index| index as u32));
        return;
    };
    let part = &rays[first..];
    let count = part.len().min(BUNDLE);
    let mut raw = [Raw16::NONE; GROUPS];
    for (lane, ray) in part[..count].iter().enumerate() {
        raw[lane / GROUP].set(lane % GROUP, &tracer.structure.local(ray));
    }
    let mut left = [0; GROUPS];
    for (group, raw) in raw.iter_mut().enumerate() {
        raw.find_keys();
        let lanes = count.saturating_sub(group * GROUP).min(GROUP);
        left[group] = (1u32 << lanes) - 1;
    }
    while let Some(group) = left.iter().position(|&lanes| lanes != 0) {
        let leader = left[group].trailing_zeros() as usize % GROUP;
        let key = raw[group].key[leader];
        let mut members = [0; GROUPS];
        for g in 0..GROUPS {
            let alike = (0..GROUP).fold(0, |m, l| m | u32::from(raw[g].key[l] == key) << l);
            members[g] = alike & left[g];
            left[g] &= !alike;
        }
        let size: u32 = members.iter().map(|m| m.count_ones()).sum();
        if key != UNABLE && size >= FEWEST {
            let chief = tracer.structure.local(&part[group * GROUP + leader]);
            let mut bundle = Bundle::new(&raw, members, &chief, key, &place.blas.bounds());
            let mut pilot =
                Pilot { tracer: &mut *tracer, place: &place, rays, first, counts: &mut *counts };
            if C::ACTIVE {
                pilot.begin_counts(&members);
            }
            let complete = pilot.traverse::<A::Query>(&mut bundle);
            for g in 0..GROUPS {
                let mut lanes = members[g];
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % GROUP;
                    lanes &= lanes - 1;
                    let index = first + g * GROUP + lane;
                    if complete
                        || (!<A::Query as Query>::ORDERED && bundle.active[g] >> lane & 1 == 0)
                    {
                        let query = bundle.query::<A::Query>(g, lane, &rays[index], &place);
                        answers.end(tracer.structure, index, &query);
                    } else {
                        others.push(index as u32);
                    }
                }
            }
        } else {
            for (g, mut lanes) in members.into_iter().enumerate() {
                while lanes != 0 {
                    others.push((first + g * GROUP) as u32 + lanes.trailing_zeros());
                    lanes &= lanes - 1;
                }
            }
        }
    }
}

impl Bundle {
    #[inline(always)]
    fn new(
        raw: &[Raw16; GROUPS],
        members: [u32; GROUPS],
        chief: &Ray,
        key: u32,
        bounds: &Aabb,
    ) -> Self {
        let negative = [key & 1 != 0, key & 2 != 0, key & 4 != 0];
        let axes = GroupAxes::new(negative, (key >> 3 & 3) as usize);
        let exponent = key >> 5;
        let scale = f32::from_bits((254 - exponent) << 23);
        let unscale = f32::from_bits(exponent << 23);
        let [kx, ky, kz] = axes.axes();
        let mut groups = [Group16::NONE; GROUPS];
        // Least and greatest origin, inverse direction and error by axis.
        let mut origins = [[[f32::INFINITY; GROUP], [f32::NEG_INFINITY; GROUP]]; 3];
        let mut inverses = origins;
        let mut errors = [[0.0; GROUP]; 3];
        let (mut starts, mut ends) = ([f32::INFINITY; GROUP], [-1.0; GROUP]);
        for (g, group) in groups.iter_mut().enumerate() {
            if members[g] == 0 {
                continue;
            }
            let mut raw = raw[g];
            raw.fill(members[g], chief);
            for lane in 0..GROUP {
                let o = [0, 1, 2].map(|axis| raw.origin[axis][lane]);
                let d = [0, 1, 2].map(|axis| raw.direction[axis][lane] * scale);
                let reach = [0, 1, 2].map(|axis| {
                    let (a, b) = (
                        (bounds.lower[axis] - o[axis]).abs(),
                        (bounds.upper[axis] - o[axis]).abs(),
                    );
                    if a > b { a } else { b }
                });
                for axis in 0..3 {
                    let error = prepare::box_error(reach[axis], reach[kz], o[axis]);
                    let size = d[axis].abs();
                    let size = if size > prepare::SMALLEST_COMPONENT {
                        size
                    } else {
                        prepare::SMALLEST_COMPONENT
                    };
                    let size = if negative[axis] { -size } else { size };
                    let inverse = 1.0 / size;
                    let margin = error * inverse.abs() + f32::MIN_POSITIVE;
                    let centre = o[axis] * inverse;
                    group.inverse[axis][lane] = inverse;
                    group.near_offset[axis][lane] = centre + margin;
                    group.far_offset[axis][lane] = centre - margin;
                    let least = |a: f32, b: f32| if a < b { a } else { b };
                    let greatest = |a: f32, b: f32| if a > b { a } else { b };
                    let [low, high] = &mut origins[axis];
                    low[lane] = least(low[lane], o[axis]);
                    high[lane] = greatest(high[lane], o[axis]);
                    let [low, high] = &mut inverses[axis];
                    low[lane] = least(low[lane], inverse);
                    high[lane] = greatest(high[lane], inverse);
                    errors[axis][lane] = greatest(errors[axis][lane], error);
                }
                group.origin[0][lane] = o[kx];
                group.origin[1][lane] = o[ky];
                group.origin[2][lane] = o[kz];
                group.shear[0][lane] = d[kx] / d[kz];
                group.shear[1][lane] = d[ky] / d[kz];
                group.shear[2][lane] = 1.0 / d[kz];
                // As in `PreparedRay::span`.
                let clamp = |t: f32| {
                    let t = if t < f32::MAX { t } else { f32::MAX };
                    if t > -f32::MAX { t } else { -f32::MAX }
                };
                let internal = |t: f32| clamp(clamp(t) * unscale) + 0.0;
                let member = members[g] >> lane & 1 != 0;
                let (start, end) = (internal(raw.t_min[lane]), internal(raw.t_max[lane]));
                group.t_min[lane] = if member { start } else { 0.0 };
                group.t_max[lane] = if member { end } else { -1.0 };
                let start = if member { start } else { f32::INFINITY };
                starts[lane] = if start < starts[lane] { start } else { starts[lane] };
                ends[lane] =
                    if group.t_max[lane] > ends[lane] { group.t_max[lane] } else { ends[lane] };
            }
        }
        let mut frustum = Frustum::default();
        for axis in 0..3 {
            let (low, high) = (least(&origins[axis][0]), greatest(&origins[axis][1]));
            let error = 2.0 * greatest(&errors[axis]);
            let ends = [least(&inverses[axis][0]), greatest(&inverses[axis][1])];
            frustum.scale[axis] = ends;
            frustum.near_offset[axis] = ends.map(|scale| {
                (low * scale).max(high * scale) + error * scale.abs() + 2.0 * f32::MIN_POSITIVE
            });
            frustum.far_offset[axis] = ends.map(|scale| {
                (low * scale).min(high * scale) - error * scale.abs() - 2.0 * f32::MIN_POSITIVE
            });
        }
        Self {
            axes,
            frustum,
            groups,
            active: members,
            t_min: least(&starts),
            t_max: greatest(&ends),
            smallest: f32::MIN_POSITIVE * unscale.max(1.0),
            scale,
            visits: 0,
        }
    }

    /// The query of a ray as it stands.
    #[inline(always)]
    fn query<Q: OneHit>(&self, group: usize, lane: usize, ray: &Ray, place: &Place<'_>) -> Q {
        let g = &self.groups[group];
        let found =
            if Q::ORDERED { g.id[lane] != u32::MAX } else { self.active[group] >> lane & 1 == 0 };
        let candidate = found.then(|| Candidate {
            t: g.t_max[lane] * self.scale,
            u: g.u[lane],
            v: g.v[lane],
            triangle: g.id[lane],
            front: place.front(g.front) >> lane & 1 != 0,
        });
        Q::resume(ray, place, candidate.as_ref())
    }

    /// Where the last of the rays' intervals ends.
    #[inline(always)]
    fn end(&self) -> f32 {
        // Bits of numbers that are not negative sort like them, and those of −1 are negative.
        let mut ends = [i32::MIN; GROUP];
        for group in &self.groups {
            for lane in 0..GROUP {
                ends[lane] = ends[lane].max(group.t_max[lane].to_bits() as i32);
            }
        }
        f32::from_bits(ends.into_iter().fold(i32::MIN, i32::max) as u32)
    }
}

fn least(row: &Row16) -> f32 {
    row.iter().copied().fold(f32::INFINITY, f32::min)
}

fn greatest(row: &Row16) -> f32 {
    row.iter().copied().fold(f32::NEG_INFINITY, f32::max)
}

/// What the rays of a bundle need besides it.
struct Pilot<'a, 'b, I, S, F, C> {
    tracer: &'b mut Tracer<'a, I, S, F, C>,
    place: &'b Place<'a>,
    rays: &'a [Ray],
    first: usize,
    counts: &'b mut [C],
}

/// Nodes that a bundle may visit.
const BUDGET: u32 = 96;

impl<I: Isa, S: Structure, F: CandidateFilter, C: Count> Pilot<'_, '_, I, S, F, C> {
    /// Whether all rays were answered, or else it did not pay to go on.
    #[inline(always)]
    fn traverse<Q: OneHit>(&mut self, bundle: &mut Bundle) -> bool {
        let isa = self.tracer.isa;
        let tree = &self.place.blas.tree;
        let mut stack = [MaybeUninit::<Entry>::uninit(); ENTRIES];
        let mut top = 0;
        let mut current =
            Entry { near: 0.0, child: Reference::ROOT, parent: Reference::ROOT, place: 0 };
        loop {
            if current.child.is_leaf() {
                let ended = self.leaf::<Q>(bundle, &current);
                if ended.is_break() {
                    return true;
                }
            } else {
                bundle.visits += 1;
                if bundle.visits > BUDGET {
                    return false;
                }
                if C::ACTIVE {
                    let from = current.place as usize % GROUPS;
                    (from..GROUPS).for_each(|g| self.count(g, bundle.active[g], Count::node));
                }
                let node = tree.node(current.child);
                let mut distances = [0.0; 8];
                let mut mask = isa.frustum8(
                    &node.boxes,
                    &bundle.axes,
                    &bundle.frustum,
                    bundle.t_min,
                    bundle.t_max,
                    &mut distances,
                );
                let from = current.place as usize % GROUPS;
                let base = top;
                while mask != 0 {
                    let slot = mask.trailing_zeros() as usize % 8;
                    mask &= mask - 1;
                    let Some(group) = (from..GROUPS).find(|&g| {
                        isa.box16(&node.boxes, slot, &bundle.axes, &bundle.groups[g])
                            & bundle.active[g]
                            != 0
                    }) else {
                        continue;
                    };
                    let child = node.children[slot];
                    let address = tree.address(child.value());
                    isa.prefetch(address);
                    isa.prefetch(address.wrapping_add(64));
                    isa.prefetch(address.wrapping_add(128));
                    isa.prefetch(address.wrapping_add(192));
                    let entry = Entry {
                        near: distances[slot],
                        child,
                        parent: current.child,
                        place: (slot * GROUPS + group) as u32,
                    };
                    let mut place = top;
                    while place > base {
                        // SAFETY: entries below `top` were written.
                        let below = unsafe { stack[(place - 1) % ENTRIES].assume_init() };
                        if below.near >= entry.near {
                            break;
                        }
                        stack[place % ENTRIES].write(below);
                        place -= 1;
                    }
                    stack[place % ENTRIES].write(entry);
                    top += 1;
                }
            }
            loop {
                if top == 0 {
                    return true;
                }
                top -= 1;
                // SAFETY: entries below `top` were written.
                current = unsafe { stack[top % ENTRIES].assume_init() };
                if current.near <= bundle.t_max {
                    break;
                }
            }
        }
    }

    /// Tests the triangles of a leaf.
    #[inline(always)]
    fn leaf<Q: OneHit>(&mut self, bundle: &mut Bundle, entry: &Entry) -> ControlFlow<()> {
        let isa = self.tracer.isa;
        let value = entry.child.value();
        let parent: &Node8 = self.place.blas.tree.node(entry.parent);
        // SAFETY: values of a BLAS' leaves come from `TriangleLeaves::place`: a block is there.
        let block: &Triangles4 = unsafe { self.place.blas.tree.block(value) };
        let slot = entry.place as usize / GROUPS % 8;
        let from = entry.place as usize % GROUPS;
        let general = F::ACTIVE && self.place.translucent(block) != 0;
        let mut changed = false;
        for g in from..GROUPS {
            let group = &mut bundle.groups[g];
            let rays = isa.box16(&parent.boxes, slot, &bundle.axes, group) & bundle.active[g];
            if rays == 0 {
                continue;
            }
            if C::ACTIVE {
                self.count(g, rays, |count| count.leaf(block));
            }
            let mut doubtful = rays;
            if !general {
                doubtful = 0;
                let mut question = Question16 {
                    active: rays,
                    keep: self.place.keep,
                    smallest: bundle.smallest,
                    id: 0,
                };
                for lane in 0..BLOCK {
                    let id = TriangleId::of_lane(block, lane);
                    if id == TriangleId::NONE {
                        break;
                    }
                    question.id = id.triangle();
                    let (met, unsure) = if Q::ORDERED {
                        isa.triangle16::<true>(block, lane, &bundle.axes, group, &question)
                    } else {
                        isa.triangle16::<false>(block, lane, &bundle.axes, group, &question)
                    };
                    doubtful |= unsure;
                    changed |= met != 0;
                    if !Q::ORDERED {
                        question.active &= !met;
                    }
                }
                if !Q::ORDERED {
                    let met = rays & !question.active;
                    bundle.active[g] &= !met;
                    doubtful &= !met;
                }
            }
            while doubtful != 0 {
                let lane = doubtful.trailing_zeros() as usize % GROUP;
                doubtful &= doubtful - 1;
                changed |= self.ask::<Q>(bundle, g, lane, block);
            }
        }
        if changed {
            if Q::ORDERED {
                bundle.t_max = bundle.end();
            } else if bundle.active == [0; GROUPS] {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }

    fn begin_counts(&mut self, members: &[u32; GROUPS]) {
        for (g, &lanes) in members.iter().enumerate() {
            self.count(g, lanes, |count| {
                *count = C::default();
                if S::IS_INSTANCE {
                    count.instance();
                }
            });
        }
    }

    /// Counts something for rays of a group.
    #[inline(always)]
    fn count(&mut self, g: usize, mut lanes: u32, what: impl Fn(&mut C)) {
        while lanes != 0 {
            what(&mut self.counts[self.first + g * GROUP + lanes.trailing_zeros() as usize]);
            lanes &= lanes - 1;
        }
    }

    /// Tests one ray against a block; says whether that changed anything.
    fn ask<Q: OneHit>(
        &mut self,
        bundle: &mut Bundle,
        g: usize,
        lane: usize,
        block: &Triangles4,
    ) -> bool {
        let index = self.first + g * GROUP + lane;
        let ray = &self.rays[index];
        let structure = self.tracer.structure;
        let Some((prepared, _)) = structure.enter_root(ray, self.tracer.options) else {
            return false;
        };
        let query: Q = bundle.query(g, lane, ray, self.place);
        let span = prepared.span(ray.t_min, query.t_max());
        let asker = Asker { filter: self.tracer.filter, ray, index: index as u32 };
        let place = self.place;
        let (query, span) =
            self.tracer.isa.vectorize(AskOne { place, block, prepared, asker, query, span });
        let Some(found) = query.found() else {
            return false;
        };
        let group = &mut bundle.groups[g];
        let bit = 1 << lane;
        if !Q::ORDERED {
            bundle.active[g] &= !bit;
            return true;
        }
        group.t_max[lane] = span.t_max;
        (group.u[lane], group.v[lane], group.id[lane]) = (found.u, found.v, found.triangle);
        let front = self.place.front(if found.front { bit } else { 0 });
        group.front = (group.front & !bit) | (front & bit);
        true
    }
}

/// A ray that is tested against a block by itself. A kernel, so that it stays out of the loops.
struct AskOne<'a, F, Q> {
    place: &'a Place<'a>,
    block: &'a Triangles4,
    prepared: PreparedRay,
    asker: Asker<'a, F>,
    query: Q,
    span: Span,
}

impl<F: CandidateFilter, Q: OneHit> Kernel for AskOne<'_, F, Q> {
    type Output = (Q, Span);

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) -> (Q, Span) {
        let Self { place, block, prepared, asker, query, span } = &mut self;
        // Whether the search ended is in the query.
        let _ = test_each(isa, place, prepared, block, asker, span, query);
        (self.query, self.span)
    }
}
