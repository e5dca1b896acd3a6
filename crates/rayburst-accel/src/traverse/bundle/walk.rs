//! The way of a bundle through a tree.

use std::{mem::MaybeUninit, ops::ControlFlow};

use rayburst_math::Ray;
use rayburst_simd::{GROUP, Isa, Kernel, Question16};

use super::{
    super::{
        bits::take_bit,
        count::Count,
        prepare::{PreparedRay, Span},
        query::{Asker, OneHit, Place, test_each},
    },
    GROUPS,
    rays::Bundle,
};
use crate::{
    CandidateFilter,
    build::binned_sah::MAX_DEPTH,
    layout::{
        bvh8::Reference,
        triangles::{BLOCK, TriangleId},
        view::{BlockRoom, Leaf, NodeRoom},
    },
    structure::{Structure, Tracer},
};

/// Seven siblings a level and one to spare, as a power of two.
const ENTRIES: usize = (7 * MAX_DEPTH + 1).next_power_of_two();

/// A subtree or leaf to visit later.
#[derive(Clone, Copy)]
struct Entry {
    /// No ray of the bundle is there before, from the waist on.
    near: f32,
    child: Reference,
    /// The node it is a child of, and four times the slot there plus the first group that meets it.
    parent: Reference,
    place: u32,
}

/// What the rays of a bundle need besides it.
pub(super) struct Pilot<'a, 'b, I, S, F, C> {
    pub(super) tracer: &'b mut Tracer<'a, I, S, F, C>,
    pub(super) place: &'b Place<'a>,
    pub(super) rays: &'a [Ray],
    pub(super) first: usize,
    pub(super) counts: &'b mut [C],
}

/// Nodes that a bundle may visit.
const BUDGET: u32 = 128;

impl<I: Isa, S: Structure, F: CandidateFilter, C: Count> Pilot<'_, '_, I, S, F, C> {
    /// Whether all rays were answered, or else it did not pay to go on.
    #[inline(always)]
    pub(super) fn traverse<Q: OneHit>(&mut self, bundle: &mut Bundle) -> bool {
        let isa = self.tracer.isa;
        let (tree, mut room) = (self.place.blas.tree.view(), NodeRoom::new());
        let mut stack = [MaybeUninit::<Entry>::uninit(); ENTRIES];
        let (mut top, mut visits) = (0, 0);
        let mut current = Entry {
            near: f32::NEG_INFINITY,
            child: Reference::ROOT,
            parent: Reference::ROOT,
            place: 0,
        };
        loop {
            if current.child.is_leaf() {
                let ended = self.leaf::<Q>(bundle, &current);
                if ended.is_break() {
                    return true;
                }
            } else {
                visits += 1;
                if visits > BUDGET {
                    return false;
                }
                if C::ACTIVE {
                    let from = current.place as usize % GROUPS;
                    let rays: u32 =
                        bundle.active[from..].iter().map(|rays| rays.count_ones()).sum();
                    let visit = |count: &mut C| {
                        count.node();
                        count.bundled();
                        count.beside(rays - 1);
                    };
                    (from..GROUPS).for_each(|g| self.count(g, bundle.active[g], visit));
                }
                // SAFETY: references to inner nodes come from the tree, which the place borrows.
                let (boxes, words) = unsafe { tree.node(isa, current.child, &mut room) };
                let children: &[Reference; 8] = bytemuck::cast_ref(words);
                let mut distances = [0.0; 8];
                let mut mask = isa.frustum8(
                    boxes,
                    &bundle.axes,
                    &bundle.frustum,
                    bundle.t_min,
                    bundle.t_max,
                    &mut distances,
                );
                let from = current.place as usize % GROUPS;
                let base = top;
                while mask != 0 {
                    // Stacked last, the first slot is visited first.
                    let slot =
                        if Q::ORDERED { mask.trailing_zeros() } else { mask.ilog2() } as usize % 8;
                    mask &= !(1 << slot);
                    // An empty slot, which an interval of infinite slack meets.
                    if boxes.planes[0][slot] > boxes.planes[1][slot] {
                        continue;
                    }
                    let Some(group) = (from..GROUPS).find(|&g| {
                        isa.box16(boxes, slot, &bundle.axes, &bundle.groups[g]) & bundle.active[g]
                            != 0
                    }) else {
                        continue;
                    };
                    let child = children[slot];
                    tree.prefetch(isa, child);
                    let entry = Entry {
                        near: distances[slot],
                        child,
                        parent: current.child,
                        place: (slot * GROUPS + group) as u32,
                    };
                    let mut place = top;
                    while Q::ORDERED && place > base {
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
        let tree = self.place.blas.tree.view();
        let (mut node_room, mut block_room) = (NodeRoom::new(), BlockRoom::new());
        // SAFETY: the reference and the value come from the tree, which the place borrows.
        let ((parent, _), stored) =
            unsafe { (tree.node(isa, entry.parent, &mut node_room), tree.leaf(value)) };
        let block = stored.block(isa, &mut block_room);
        let slot = entry.place as usize / GROUPS % 8;
        let from = entry.place as usize % GROUPS;
        let general = F::ACTIVE && self.place.translucent(stored) != 0;
        for g in from..GROUPS {
            let mut changed = false;
            let group = &mut bundle.groups[g];
            let rays = isa.box16(parent, slot, &bundle.axes, group) & bundle.active[g];
            if rays == 0 {
                continue;
            }
            if C::ACTIVE {
                self.count(g, rays, |count| {
                    count.leaf(stored);
                    count.beside(rays.count_ones() - 1);
                });
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
                let lane = take_bit(&mut doubtful) as usize % GROUP;
                changed |= self.ask::<Q>(bundle, g, lane, stored);
            }
            if changed {
                bundle.shorten(isa, g);
            }
        }
        if !Q::ORDERED && bundle.active == [0; GROUPS] {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }

    pub(super) fn begin_counts(&mut self, members: &[u32; GROUPS]) {
        for (g, &lanes) in members.iter().enumerate() {
            self.count(g, lanes, |count| {
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
            what(&mut self.counts[self.first + g * GROUP + take_bit(&mut lanes) as usize]);
        }
    }

    /// Tests one ray against a leaf; says whether that changed anything.
    fn ask<Q: OneHit>(
        &mut self,
        bundle: &mut Bundle,
        g: usize,
        lane: usize,
        leaf: Leaf<'_>,
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
            self.tracer.isa.vectorize(AskOne { place, leaf, prepared, asker, query, span });
        let Some(found) = query.found() else {
            return false;
        };
        let group = &mut bundle.groups[g];
        let bit = 1 << lane;
        // Numbers so small are not exact in both units of distance.
        let inexact = Q::ORDERED && span.t_max < 2.0 * bundle.smallest;
        if inexact {
            bundle.left[g] |= bit;
            group.t_max[lane] = -1.0;
        }
        if inexact || !Q::ORDERED {
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

/// A ray that is tested against a leaf by itself. A kernel, so that it stays out of the loops.
struct AskOne<'a, F, Q> {
    place: &'a Place<'a>,
    leaf: Leaf<'a>,
    prepared: PreparedRay,
    asker: Asker<'a, F>,
    query: Q,
    span: Span,
}

impl<F: CandidateFilter, Q: OneHit> Kernel for AskOne<'_, F, Q> {
    type Output = (Q, Span);

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) -> (Q, Span) {
        let Self { place, leaf, prepared, asker, query, span } = &mut self;
        // Whether the search ended is in the query.
        let _ = test_each(isa, place, prepared, *leaf, asker, span, query);
        (self.query, self.span)
    }
}
