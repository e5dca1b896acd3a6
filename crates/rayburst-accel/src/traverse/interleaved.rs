//! Many rays in flight on one thread, so that the memory and the dependent chains of one are hidden
//! behind the work of the others.
//!
//! A single ray waits: for the lines of a node, then for the chain box test → sort → next node. Here
//! [`IN_FLIGHT`] rays advance by one node or one leaf a round. They are kept in three sets, inner,
//! leaf and done, and a step has no branch that depends on the ray: it tests the node, writes the
//! children that are met to the stack, sorted, finds the topmost stack entry that is still near
//! enough, takes the nearest child or else that entry, asks for its memory, and puts the ray into the
//! set where that belongs. The request has a whole round to arrive.
//! Four rays at a time, stage by stage, so that no ray's chain of steps fills the CPU's window alone.
//!
//! Rays that are done hand in their answer and make place for the next of the batch. Instances are
//! entered in a leaf of the top level and left at a marker on the stack.

use std::{cell::Cell, hint::select_unpredictable, marker::PhantomData, ops::ControlFlow};

use bytemuck::Zeroable;
use rayburst_math::Ray;
use rayburst_simd::{Isa, SLOT};

use super::{
    answers::Answers,
    bits::take_bit,
    count::Count,
    prepare::{PreparedRay, Span},
    query::{Asker, OneHit, Place, Query, is_plain, take_plain, test_leaf},
};
use crate::{
    CandidateFilter, TraceOptions,
    layout::{
        arena::Line,
        bvh8::Reference,
        view::{Leaf, TreeView},
    },
    structure::{Structure, Tracer},
};

/// Rays in flight: 10 to 32 are alike.
const IN_FLIGHT: usize = 24;

/// Rays that take a step together.
const GROUP: usize = 4;

/// Entries below a stack's bottom that are never taken, so that eight can always be looked at.
const GUARD: usize = 8;
/// The bottom entry, which is always taken.
const BOTTOM: usize = GUARD + 1;
/// What guard entries hold: farther than everything.
const BEYOND: u32 = i32::MAX as u32;
/// A step writes eight entries whatever it finds.
const SLACK: usize = 8;
/// The reference at which a ray has seen everything, or everything of an instance. No child is the
/// root.
const DONE: Reference = Reference::ROOT;

/// A ray on its way.
#[repr(C, align(64))]
struct Flight<'a, Q, C> {
    ray: PreparedRay,
    span: Span,
    current: Reference,
    top: u32,
    index: u32,
    /// The tree that `current` leads into.
    tree: TreeView,
    query: Q,
    /// Where the ray is; nowhere while it is among instances.
    place: Option<Place<'a>>,
    count: C,
}

thread_local! {
    /// Memory for rays in flight, kept between batches. Taken while in use, so that a filter may
    /// trace rays itself.
    static SCRATCH: Cell<Vec<Line>> = const { Cell::new(Vec::new()) };
}

/// The memory of all rays in flight: each with its two stacks, of keys and of references.
struct Hangar<'a, Q, C> {
    lines: Vec<Line>,
    /// Lines a flight.
    stride: usize,
    /// Entries a stack.
    entries: usize,
    marker: PhantomData<(Flight<'a, Q, C>, Q, C)>,
}

impl<'a, Q, C> Hangar<'a, Q, C> {
    /// For stacks that hold `depth` entries besides the bottom.
    fn new(depth: usize) -> Self {
        let entries = (BOTTOM + depth + SLACK).next_multiple_of(16);
        // An odd number of lines spreads flights over the sets of the cache.
        let stride = (size_of::<Flight<'a, Q, C>>() / 64 + entries / 8) | 1;
        let mut lines = SCRATCH.take();
        if lines.len() < stride * IN_FLIGHT {
            lines.resize(stride * IN_FLIGHT, Line::zeroed());
        }
        for flight in lines.chunks_exact_mut(stride).take(IN_FLIGHT) {
            let stacks = &mut flight[size_of::<Flight<'a, Q, C>>() / 64..];
            let stacks: &mut [u32] = bytemuck::cast_slice_mut(stacks);
            stacks[..GUARD].fill(BEYOND);
            stacks[BOTTOM - 1] = 0;
            stacks[entries + BOTTOM - 1] = DONE.word();
        }
        Self { lines, stride, entries, marker: PhantomData }
    }
}

impl<Q, C> Drop for Hangar<'_, Q, C> {
    fn drop(&mut self) {
        SCRATCH.set(std::mem::take(&mut self.lines));
    }
}

/// The keys of a flight's stack; the references follow after `entries` keys.
#[inline(always)]
fn keys<Q, C>(flight: *mut Flight<'_, Q, C>) -> *mut u32 {
    flight.wrapping_add(1).cast()
}

/// Which flights are where, as bits.
///
/// Sets of bits and not lists of pointers: the addresses of appended entries would depend on the end
/// of a step, and loads behind such stores wait for them.
#[derive(Clone, Copy, Default)]
struct Sets {
    inner: u32,
    leaf: u32,
    done: u32,
}

impl Sets {
    /// Flights in all of them.
    #[inline(always)]
    fn len(&self) -> u32 {
        (self.inner | self.leaf | self.done).count_ones()
    }

    /// Puts a flight where its next reference belongs.
    #[inline(always)]
    fn sort_in(&mut self, slot: u32, next: Reference) {
        let (leaf, done) = (u32::from(next.is_leaf()), u32::from(next == DONE));
        self.leaf |= leaf << slot;
        self.done |= done << slot;
        self.inner |= (1 ^ leaf ^ done) << slot;
    }
}

/// Takes the lowest slots out of a set of at least as many.
#[inline(always)]
fn take_group(set: &mut u32) -> [u32; GROUP] {
    let mut slots = [0; GROUP];
    let mut i = 0;
    while i < GROUP {
        slots[i] = take_bit(set);
        i += 1;
    }
    slots
}

/// Traces the rays of a batch with these indices.
#[inline(always)]
pub(crate) fn trace<'a, I: Isa, S: Structure, F: CandidateFilter, C: Count, A: Answers>(
    tracer: &mut Tracer<'a, I, S, F, C>,
    rays: &'a [Ray],
    order: &[u32],
    counts: &mut [C],
    answers: &mut A,
) {
    let mut hangar = Hangar::<A::Query, C>::new(tracer.structure.stack_entries());
    let (structure, options, filter) = (tracer.structure, tracer.options, tracer.filter);
    let pilot = Pilot {
        isa: tracer.isa,
        structure,
        options,
        filter,
        rays,
        order,
        entries: hangar.entries,
        tree: structure.root_view(),
        memory: hangar.lines.as_mut_ptr(),
        stride: hangar.stride,
    };
    let mut sets = Sets::default();
    let mut next = 0;
    for slot in 0..IN_FLIGHT.min(order.len()) {
        // SAFETY: the slot is one of the hangar and in no set.
        unsafe { pilot.start(slot as u32, &mut next, tracer, counts, answers, &mut sets) };
    }
    loop {
        // Rays that are done make place for others: a round has about as many all the time.
        let others = if C::ACTIVE { sets.len().saturating_sub(1) } else { 0 };
        // Rays that are left of groups wait for others, unless none moves otherwise.
        let mut moved = false;
        let (mut inner, mut single) = (std::mem::take(&mut sets.inner), 0);
        if A::Query::ORDERED {
            while inner.count_ones() as usize >= GROUP {
                let slots = take_group(&mut inner);
                // SAFETY: flights in sets were started, and each is in one set only.
                unsafe {
                    if pilot.are_alike::<A::Query, C>(slots) {
                        pilot.nodes::<GROUP, A::Query, C>(slots, others, &mut sets);
                        moved = true;
                    } else {
                        single |= slots.iter().fold(0, |set, slot| set | 1 << slot);
                    }
                }
            }
        }
        if !A::Query::ORDERED || !(moved || sets.leaf.count_ones() as usize >= GROUP) {
            single |= std::mem::take(&mut inner);
        }
        while single != 0 {
            let slot = take_bit(&mut single);
            // SAFETY: as above.
            unsafe {
                if A::Query::ORDERED {
                    pilot.nodes::<1, A::Query, C>([slot], others, &mut sets);
                } else {
                    pilot.any_node::<A::Query, C>(slot, others, &mut sets);
                }
            }
            moved = true;
        }
        sets.inner |= inner;
        let mut leaf = std::mem::take(&mut sets.leaf);
        while leaf.count_ones() as usize >= GROUP {
            let slots = take_group(&mut leaf);
            // SAFETY: as above.
            if unsafe { pilot.leaves::<A::Query, C>(slots, others, &mut sets) } {
                moved = true;
            } else {
                single |= slots.iter().fold(0, |set, slot| set | 1 << slot);
            }
        }
        if !moved {
            single |= std::mem::take(&mut leaf);
        }
        while single != 0 {
            // SAFETY: as above.
            unsafe { pilot.leaf::<A::Query, C>(take_bit(&mut single), others, &mut sets) };
        }
        sets.leaf |= leaf;
        let mut done = std::mem::take(&mut sets.done);
        while done != 0 {
            let slot = take_bit(&mut done);
            // SAFETY: as above.
            unsafe {
                let flight = &mut *pilot.flight::<A::Query, C>(slot);
                // In registers: parts of it would be read before they have arrived in memory.
                let mut query = flight.query;
                if let Some(place) = &flight.place {
                    query.settle(place, &flight.ray, &flight.span);
                }
                if S::TWO_LEVEL && flight.place.is_some() && !A::is_final(&query) {
                    flight.query = query;
                    pilot.leave::<A::Query, C>(slot, &mut sets);
                } else {
                    counts[flight.index as usize] = flight.count;
                    answers.end(structure, flight.index as usize, &query);
                    pilot.start(slot, &mut next, tracer, counts, answers, &mut sets);
                }
            }
        }
        if sets.inner | sets.leaf | sets.done == 0 {
            break;
        }
    }
}

/// What all flights share.
struct Pilot<'a, 'b, I, S, F> {
    isa: I,
    structure: &'a S,
    options: &'a TraceOptions,
    filter: &'a F,
    rays: &'a [Ray],
    order: &'b [u32],
    entries: usize,
    tree: TreeView,
    memory: *mut Line,
    stride: usize,
}

impl<'a, I: Isa, S: Structure, F: CandidateFilter> Pilot<'a, '_, I, S, F> {
    #[inline(always)]
    fn flight<Q, C>(&self, slot: u32) -> *mut Flight<'a, Q, C> {
        debug_assert!((slot as usize) < IN_FLIGHT);
        self.memory.wrapping_add(slot as usize * self.stride).cast()
    }

    /// Starts the next ray of the batch that cannot be answered at once, if there is one.
    ///
    /// # Safety
    /// `slot` must be one of the hangar's and in no set.
    #[inline(always)]
    unsafe fn start<C: Count, A: Answers>(
        &self,
        slot: u32,
        next: &mut usize,
        tracer: &mut Tracer<'a, I, S, F, C>,
        counts: &mut [C],
        answers: &mut A,
        sets: &mut Sets,
    ) {
        while let Some(&index) = self.order.get(*next) {
            let index = index as usize;
            let ray = &self.rays[index];
            *next += 1;
            let mut query = A::begin(ray);
            let entered = self.structure.enter_root(ray, self.options);
            if let Some((prepared, place)) = entered {
                let span = prepared.span(ray.t_min, query.t_max());
                if span.t_min >= 0.0 {
                    // A bundle may have begun.
                    let mut count = if C::ACTIVE { counts[index] } else { C::default() };
                    if S::IS_INSTANCE {
                        count.instance();
                    }
                    let flight = self.flight::<A::Query, C>(slot);
                    // SAFETY: the caller's promise: memory for a flight and its stacks.
                    unsafe {
                        flight.write(Flight {
                            ray: prepared,
                            span,
                            current: Reference::ROOT,
                            top: BOTTOM as u32,
                            index: index as u32,
                            tree: self.structure.root_view(),
                            query,
                            place,
                            count,
                        });
                    }
                    sets.inner |= 1 << slot;
                    return;
                }
                // Keys are of distances that are not negative.
                tracer.count = C::default();
                tracer.trace(index, ray, &mut query);
                counts[index] = tracer.count;
            }
            answers.end(self.structure, index, &query);
        }
    }

    /// Visits a node, whatever it is that its ray meets first.
    ///
    /// # Safety
    /// `slot` must hold a flight that was started and is in no set.
    #[inline(always)]
    unsafe fn any_node<Q: OneHit, C: Count>(&self, slot: u32, others: u32, sets: &mut Sets) {
        // SAFETY: the caller's promise; only nodes are in the set of inner references. The stack
        // has room for a node's children on every level, and eight entries above and below.
        unsafe {
            let flight = self.flight::<Q, C>(slot);
            let f = &mut *flight;
            f.count.beside(others);
            f.count.node();
            let tree = if S::TWO_LEVEL { f.tree } else { self.tree };
            let top = f.top as usize;
            let references = keys(flight).add(self.entries);
            let found = &mut *references.add(top).cast::<[u32; 8]>();
            let (count, first) = tree.met8(self.isa, f.current, &f.ray.slab, &f.span, found);
            let waiting = *references.add(top - 1).cast::<Reference>();
            let child = tree.child(f.current, first);
            let next = select_unpredictable(count != 0, child, waiting);
            self.advance::<Q, C>(slot, tree, (top + count).wrapping_sub(1), next, sets);
        }
    }

    /// Whether flights are in trees of the same layout.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    unsafe fn are_alike<Q, C>(&self, slots: [u32; GROUP]) -> bool {
        let mut alike = true;
        if S::TWO_LEVEL {
            // SAFETY: the caller's promise.
            unsafe {
                let first = (*self.flight::<Q, C>(slots[0])).tree;
                for slot in slots {
                    alike &= first.is_like((*self.flight::<Q, C>(slot)).tree);
                }
            }
        }
        alike
    }

    /// Visits a node for each of some flights, the nearest children first, stage by stage.
    ///
    /// A choice that depends on the ray is never a branch: each would be wrong for one node in seven,
    /// and undo what is in flight. The compiler makes one of two loads to choose from; so there is
    /// one, from the place that is chosen.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`]; trees are of one layout.
    #[inline(always)]
    unsafe fn nodes<const N: usize, Q: OneHit, C: Count>(
        &self,
        slots: [u32; N],
        others: u32,
        sets: &mut Sets,
    ) {
        // SAFETY: as in `any_node`.
        unsafe {
            let first = self.flight::<Q, C>(slots[0]);
            let (mut flights, mut trees) = ([first; N], [self.tree; N]);
            let (mut current, mut tops) = ([DONE; N], [0; N]);
            let mut above: [[*mut [u32; 8]; N]; 2] = [[std::ptr::null_mut(); N]; 2];
            let (mut rays, mut spans) = ([&(*first).ray.slab; N], [[0.0; 2]; N]);
            let mut i = 0;
            while i < N {
                flights[i] = self.flight::<Q, C>(slots[i]);
                (*flights[i]).count.beside(others);
                (*flights[i]).count.node();
                let f = &*flights[i];
                if S::TWO_LEVEL {
                    trees[i] = f.tree;
                }
                (current[i], tops[i]) = (f.current, f.top as usize);
                (rays[i], spans[i]) = (&f.ray.slab, [f.span.t_min, f.span.t_max]);
                above[0][i] = keys(flights[i]).add(tops[i]).cast();
                above[1][i] = keys(flights[i]).add(self.entries + tops[i]).cast();
                i += 1;
            }
            // Each stack is of one flight.
            let [sorted, found] = [above[0].map(|keys| &mut *keys), above[1].map(|all| &mut *all)];
            let counts = TreeView::sorted8_of(self.isa, trees, current, rays, spans, sorted, found);
            let (mut places, mut none) = ([0; N], false);
            let mut i = 0;
            while i < N {
                let below = &*keys(flights[i]).add(tops[i] - 8).cast::<[u32; 8]>();
                let live = self.isa.last_within8(below, limit(spans[i][1]));
                let (met, waiting) = (tops[i] + counts[i] - 1, tops[i] - 9 + live);
                places[i] = select_unpredictable(counts[i] != 0, met, waiting);
                none |= live | counts[i] == 0;
                i += 1;
            }
            if none {
                let mut i = 0;
                while i < N {
                    if places[i] == tops[i] - 9 {
                        places[i] = self.pop(keys(flights[i]), tops[i] - 8, spans[i][1]);
                    }
                    i += 1;
                }
            }
            let mut i = 0;
            while i < N {
                let references = keys(flights[i]).add(self.entries);
                let next = *references.add(places[i]).cast::<Reference>();
                self.advance::<Q, C>(slots[i], trees[i], places[i], next, sets);
                i += 1;
            }
        }
    }

    /// The place of the topmost live entry below `top`.
    ///
    /// # Safety
    /// `keys` must be those of a flight that was started, and the bottom entry below `top`.
    #[inline(always)]
    unsafe fn pop(&self, keys: *mut u32, mut top: usize, t_max: f32) -> usize {
        loop {
            // SAFETY: the bottom entry is live: `top` is never below it, and guards are below that.
            let below = unsafe { &*keys.add(top - 8).cast::<[u32; 8]>() };
            let live = self.isa.last_within8(below, limit(t_max));
            if live != 0 {
                return top - 9 + live;
            }
            top -= 8;
        }
    }

    /// Goes to `next`, with the stack's top at `place`.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    unsafe fn advance<Q: OneHit, C: Count>(
        &self,
        slot: u32,
        tree: TreeView,
        place: usize,
        next: Reference,
        sets: &mut Sets,
    ) {
        let flight = self.flight::<Q, C>(slot);
        // SAFETY: the caller's promise.
        unsafe {
            (*flight).current = next;
            (*flight).top = place as u32;
        }
        tree.prefetch(self.isa, next);
        sets.sort_in(slot, next);
    }

    /// Visits a leaf, or an instance.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    unsafe fn leaf<Q: OneHit, C: Count>(&self, slot: u32, others: u32, sets: &mut Sets) {
        // SAFETY: the caller's promise.
        unsafe {
            let flight = self.flight::<Q, C>(slot);
            let f = &mut *flight;
            let value = f.current.value();
            let Some(place) = &f.place else {
                // Instances are among leaves, and no visits.
                self.enter::<Q, C>(slot, value, sets);
                return;
            };
            f.count.beside(others);
            let ray = self.rays.get_unchecked(f.index as usize);
            let asker = Asker { filter: self.filter, ray, index: f.index };
            let ended = test_leaf(
                self.isa,
                place,
                &f.ray,
                value,
                &asker,
                &mut f.span,
                &mut f.query,
                &mut f.count,
            );
            let top = f.top as usize;
            let tree = if S::TWO_LEVEL { f.tree } else { self.tree };
            let place = if ended == ControlFlow::Break(()) {
                BOTTOM - 1
            } else if Q::ORDERED {
                self.pop(keys(flight), top, f.span.t_max)
            } else {
                top - 1
            };
            let next = *keys(flight).add(self.entries + place).cast::<Reference>();
            self.advance::<Q, C>(slot, tree, place, next, sets);
        }
    }

    /// Visits a leaf for each of some flights; does nothing and says so if one is not of the usual
    /// kind.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    unsafe fn leaves<Q: OneHit, C: Count>(
        &self,
        slots: [u32; GROUP],
        others: u32,
        sets: &mut Sets,
    ) -> bool {
        // SAFETY: the caller's promise.
        unsafe {
            let first = self.flight::<Q, C>(slots[0]);
            let Some(place) = &(*first).place else { return false };
            let tree = if S::TWO_LEVEL { (*first).tree } else { self.tree };
            let Some(block) = tree.block((*first).current.value()) else { return false };
            let mut flights = [first; GROUP];
            let (mut blocks, mut places) = ([block; GROUP], [place; GROUP]);
            let mut rays = [&(*first).ray.shear; GROUP];
            let (mut spans, mut keep) = ([[0.0; 2]; GROUP], [place.keep; GROUP]);
            let mut i = 0;
            while i < GROUP {
                flights[i] = self.flight::<Q, C>(slots[i]);
                let f = &*flights[i];
                let mut tree = tree;
                if S::TWO_LEVEL {
                    let Some(place) = &f.place else { return false };
                    (places[i], keep[i], tree) = (place, place.keep, f.tree);
                }
                let Some(block) = tree.block(f.current.value()) else { return false };
                (blocks[i], rays[i]) = (block, &f.ray.shear);
                spans[i] = [f.span.t_min, f.span.t_max];
                i += 1;
            }
            let nearest = self.isa.nearest4_of4(blocks, rays, spans, keep);
            let mut plain = true;
            let mut i = 0;
            while i < GROUP {
                let (f, leaf) = (&*flights[i], Leaf::Block(blocks[i]));
                plain &= is_plain::<F>(&nearest[i], places[i], &f.ray, leaf, &f.span);
                i += 1;
            }
            if !plain {
                return false;
            }
            let (mut tops, mut none) = ([0; GROUP], false);
            let mut i = 0;
            while i < GROUP {
                let f = &mut *flights[i];
                f.count.beside(others);
                f.count.leaf(Leaf::Block(blocks[i]));
                let value = f.current.value();
                let taken = take_plain(&nearest[i], value, &mut f.span, &mut f.query);
                let top = f.top as usize;
                if Q::ORDERED {
                    let below = &*keys(flights[i]).add(top - 8).cast::<[u32; 8]>();
                    let live = self.isa.last_within8(below, limit(f.span.t_max));
                    none |= live == 0;
                    tops[i] = top - 9 + live;
                } else {
                    tops[i] = select_unpredictable(taken.is_break(), BOTTOM - 1, top - 1);
                }
                i += 1;
            }
            if none {
                let mut i = 0;
                while i < GROUP {
                    let f = &*flights[i];
                    tops[i] = self.pop(keys(flights[i]), f.top as usize, f.span.t_max);
                    i += 1;
                }
            }
            let mut i = 0;
            while i < GROUP {
                let tree = if S::TWO_LEVEL { (*flights[i]).tree } else { self.tree };
                let references = keys(flights[i]).add(self.entries);
                let next = *references.add(tops[i]).cast::<Reference>();
                self.advance::<Q, C>(slots[i], tree, tops[i], next, sets);
                i += 1;
            }
            true
        }
    }

    /// Goes into an instance, if its mask and its bounds allow.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    unsafe fn enter<Q: OneHit, C: Count>(&self, slot: u32, instance: u32, sets: &mut Sets) {
        // SAFETY: the caller's promise; the stack has room for the marker.
        unsafe {
            let flight = self.flight::<Q, C>(slot);
            let f = &mut *flight;
            let ray = self.rays.get_unchecked(f.index as usize);
            let entered = self.structure.enter(instance, ray, &f.ray, self.options);
            if let Some((prepared, place)) = entered {
                f.count.instance();
                f.span = prepared.span(ray.t_min, f.query.t_max());
                f.ray = prepared;
                f.tree = place.blas.tree.view();
                f.place = Some(place);
                f.current = Reference::ROOT;
                let top = f.top as usize;
                keys(flight).add(top).write(0);
                keys(flight).add(self.entries + top).cast::<Reference>().write(DONE);
                f.top += 1;
                sets.inner |= 1 << slot;
            } else {
                self.resume::<Q, C>(slot, sets);
            }
        }
    }

    /// Comes back from an instance.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    unsafe fn leave<Q: OneHit, C: Count>(&self, slot: u32, sets: &mut Sets) {
        // SAFETY: the caller's promise.
        unsafe {
            let flight = self.flight::<Q, C>(slot);
            let f = &mut *flight;
            let ray = self.rays.get_unchecked(f.index as usize);
            if let Some((prepared, place)) = self.structure.enter_root(ray, self.options) {
                f.span = prepared.span(ray.t_min, f.query.t_max());
                f.ray = prepared;
                f.place = place;
                f.tree = self.structure.root_view();
            }
            self.resume::<Q, C>(slot, sets);
        }
    }

    /// Goes on with what is on the stack.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    unsafe fn resume<Q: OneHit, C: Count>(&self, slot: u32, sets: &mut Sets) {
        // SAFETY: the caller's promise.
        unsafe {
            let flight = self.flight::<Q, C>(slot);
            let (top, t_max) = ((*flight).top as usize, (*flight).span.t_max);
            let place = if Q::ORDERED { self.pop(keys(flight), top, t_max) } else { top - 1 };
            let next = *keys(flight).add(self.entries + place).cast::<Reference>();
            self.advance::<Q, C>(slot, (*flight).tree, place, next, sets);
        }
    }
}

/// The greatest key of a distance that is no greater.
#[inline(always)]
fn limit(t_max: f32) -> u32 {
    t_max.to_bits() | SLOT
}
