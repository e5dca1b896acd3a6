//! Many rays in flight on one thread, so that the memory and the dependent chains of one are hidden
//! behind the work of the others.
//!
//! A single ray waits: for the lines of a node, then for the chain box test → sort → next node. Here
//! [`IN_FLIGHT`] rays advance by one node or one leaf a round. They are kept in three sets, inner,
//! leaf and done, and a step has no branch that depends on the ray: it tests the node, writes the
//! children that are met to the stack, sorted, finds the topmost stack entry that is still near
//! enough, takes the nearest child or else that entry, asks for its memory, and puts the ray into the
//! set where that belongs. The request has a whole round to arrive.
//!
//! Rays that are done hand in their answer and make place for the next of the batch. Instances are
//! entered in a leaf of the top level and left at a marker on the stack.

use std::{cell::Cell, marker::PhantomData, ops::ControlFlow};

use bytemuck::Zeroable;
use rayburst_math::Ray;
use rayburst_simd::{Isa, SLOT};

use super::{
    answers::Answers,
    bits::take_bit,
    count::Count,
    prepare::{PreparedRay, Span},
    query::{Asker, OneHit, Place, Query, test_leaf},
};
use crate::{
    CandidateFilter, TraceOptions,
    layout::{arena::Line, bvh8::Reference, view::TreeView},
    structure::{Structure, Tracer},
};

/// Rays in flight: 10 to 32 are alike.
const IN_FLIGHT: usize = 24;

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
        let mut inner = std::mem::take(&mut sets.inner);
        while inner != 0 {
            // SAFETY: flights in sets were started, and each is in one set only.
            unsafe {
                let slot = take_bit(&mut inner);
                (*pilot.flight::<A::Query, C>(slot)).count.beside(others);
                pilot.node::<A::Query, C>(slot, &mut sets);
            }
        }
        let mut leaf = std::mem::take(&mut sets.leaf);
        while leaf != 0 {
            // SAFETY: as above.
            unsafe {
                let slot = take_bit(&mut leaf);
                let flight = &mut *pilot.flight::<A::Query, C>(slot);
                // Instances are among leaves, and no visits.
                flight.count.beside(if flight.place.is_some() { others } else { 0 });
                pilot.leaf::<A::Query, C>(slot, &mut sets);
            }
        }
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

    /// Visits a node.
    ///
    /// # Safety
    /// `slot` must hold a flight that was started and is in no set.
    #[inline(always)]
    unsafe fn node<Q: OneHit, C: Count>(&self, slot: u32, sets: &mut Sets) {
        // SAFETY: the caller's promise; only nodes are in the set of inner references. The stack
        // has room for a node's children on every level, and eight entries above and below.
        unsafe {
            let flight = self.flight::<Q, C>(slot);
            let f = &mut *flight;
            f.count.node();
            let tree = if S::TWO_LEVEL { f.tree } else { self.tree };
            let top = f.top as usize;
            let keys = keys(flight);
            let references = keys.add(self.entries);
            let t_max = f.span.t_max;
            let found = &mut *references.add(top).cast::<[u32; 8]>();
            let (place, next);
            if Q::ORDERED {
                let sorted = &mut *keys.add(top).cast::<[u32; 8]>();
                let below = &*keys.add(top - 8).cast::<[u32; 8]>();
                let live = self.isa.last_within8(below, limit(t_max));
                let mut popped = top - 9 + live;
                let (count, nearest) =
                    tree.sorted8(self.isa, f.current, &f.ray.slab, &f.span, sorted, found);
                if (live == 0) & (count == 0) {
                    popped = self.pop(keys, top - 8, t_max);
                }
                place = if count != 0 { top + count - 1 } else { popped };
                let waiting = *references.add(popped).cast::<Reference>();
                let child = tree.child(f.current, nearest);
                next = if count != 0 { child } else { waiting };
            } else {
                let (count, first) = tree.met8(self.isa, f.current, &f.ray.slab, &f.span, found);
                place = top.wrapping_add(count).wrapping_sub(1);
                let waiting = *references.add(top - 1).cast::<Reference>();
                let child = tree.child(f.current, first);
                next = if count != 0 { child } else { waiting };
            }
            self.advance::<Q, C>(slot, tree, place, next, sets);
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
    /// As for [`Pilot::node`].
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
    /// As for [`Pilot::node`].
    #[inline(always)]
    unsafe fn leaf<Q: OneHit, C: Count>(&self, slot: u32, sets: &mut Sets) {
        // SAFETY: the caller's promise.
        unsafe {
            let flight = self.flight::<Q, C>(slot);
            let f = &mut *flight;
            let value = f.current.value();
            let Some(place) = &f.place else {
                self.enter::<Q, C>(slot, value, sets);
                return;
            };
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

    /// Goes into an instance, if its mask and its bounds allow.
    ///
    /// # Safety
    /// As for [`Pilot::node`].
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
    /// As for [`Pilot::node`].
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
    /// As for [`Pilot::node`].
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
