//! Many rays in flight on one thread, so that the memory and the dependent chains of one are hidden
//! behind the work of the others.
//!
//! A single ray waits: for the lines of a node, then for the chain box test → sort → next node. Here
//! [`IN_FLIGHT`] rays advance by one node or one leaf a round. They are kept in three sets, inner,
//! leaf and done, and a step has no branch that depends on the ray: it tests the node, writes the
//! children that are met to the stack, sorted, finds the topmost stack entry that is still near
//! enough, takes the nearest child or else that entry, asks for its memory, and puts the ray into the
//! set where that belongs. The request has a whole round to arrive. Steps are taken by [`GROUP`] rays
//! at a time, stage by stage.
//!
//! Rays that are done hand in their answer and make place for the next of the batch. Instances are
//! entered in a leaf of the top level and left at a marker on the stack.

mod flights;
mod steps;

use rayburst_math::Ray;
use rayburst_simd::Isa;

use self::flights::{
    BOTTOM, DONE, Flight, GROUP, Hangar, IN_FLIGHT, Sets, keys, set_of, take_group,
};
use super::{
    answers::Answers,
    bits::take_bit,
    count::Count,
    query::{OneHit, Query},
};
use crate::{
    CandidateFilter, TraceOptions,
    layout::{arena::Line, bvh8::Reference, view::TreeView},
    structure::{Structure, Tracer},
};

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
                        single |= set_of(slots);
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
            let left = unsafe { pilot.leaves::<A::Query, C>(slots, others, &mut sets) };
            moved |= left == 0;
            if left != 0 {
                single |= left;
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
