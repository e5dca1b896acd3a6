//! Where the rays in flight are kept, and which of them are where.

use std::{cell::Cell, marker::PhantomData};

use bytemuck::Zeroable;

use crate::{
    layout::{arena::Line, bvh8::Reference, view::TreeView},
    traverse::{
        bits::take_bit,
        prepare::{PreparedRay, Span},
        query::Place,
    },
};

/// Rays in flight: 10 to 32 are alike.
pub(super) const IN_FLIGHT: usize = 24;

/// Rays that take a step together.
pub(super) const GROUP: usize = 4;

/// Entries below a stack's bottom that are never taken, so that eight can always be looked at.
pub(super) const GUARD: usize = 8;
/// The bottom entry, which is always taken.
pub(super) const BOTTOM: usize = GUARD + 1;
/// What guard entries hold: farther than everything.
pub(super) const BEYOND: u32 = i32::MAX as u32;
/// A step writes eight entries whatever it finds.
pub(super) const SLACK: usize = 8;
/// The reference at which a ray has seen everything, or everything of an instance. No child is the
/// root.
pub(super) const DONE: Reference = Reference::ROOT;

/// A ray on its way.
#[repr(C, align(64))]
pub(super) struct Flight<'a, Q, C> {
    pub(super) ray: PreparedRay,
    pub(super) span: Span,
    pub(super) current: Reference,
    pub(super) top: u32,
    pub(super) index: u32,
    /// The tree that `current` leads into.
    pub(super) tree: TreeView,
    pub(super) query: Q,
    /// Where the ray is; nowhere while it is among instances.
    pub(super) place: Option<Place<'a>>,
    pub(super) count: C,
}

thread_local! {
    /// Memory for rays in flight, kept between batches. Taken while in use, so that a filter may
    /// trace rays itself.
    static SCRATCH: Cell<Vec<Line>> = const { Cell::new(Vec::new()) };
}

/// The memory of all rays in flight: each with its two stacks, of keys and of references.
pub(super) struct Hangar<'a, Q, C> {
    pub(super) lines: Vec<Line>,
    /// Lines a flight.
    pub(super) stride: usize,
    /// Entries a stack.
    pub(super) entries: usize,
    marker: PhantomData<(Flight<'a, Q, C>, Q, C)>,
}

impl<'a, Q, C> Hangar<'a, Q, C> {
    /// For stacks that hold `depth` entries besides the bottom.
    pub(super) fn new(depth: usize) -> Self {
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
pub(super) fn keys<Q, C>(flight: *mut Flight<'_, Q, C>) -> *mut u32 {
    flight.wrapping_add(1).cast()
}

/// Which flights are where, as bits.
///
/// Sets of bits and not lists of pointers: the addresses of appended entries would depend on the end
/// of a step, and loads behind such stores wait for them.
#[derive(Clone, Copy, Default)]
pub(super) struct Sets {
    pub(super) inner: u32,
    pub(super) leaf: u32,
    pub(super) done: u32,
}

impl Sets {
    /// Flights in all of them.
    #[inline(always)]
    pub(super) fn len(&self) -> u32 {
        (self.inner | self.leaf | self.done).count_ones()
    }

    /// Puts a flight where its next reference belongs.
    #[inline(always)]
    pub(super) fn sort_in(&mut self, slot: u32, next: Reference) {
        let (leaf, done) = (u32::from(next.is_leaf()), u32::from(next == DONE));
        self.leaf |= leaf << slot;
        self.done |= done << slot;
        self.inner |= (1 ^ leaf ^ done) << slot;
    }
}

/// A set of slots.
#[inline(always)]
pub(super) fn set_of(slots: [u32; GROUP]) -> u32 {
    let (mut set, mut i) = (0, 0);
    while i < GROUP {
        set |= 1 << slots[i];
        i += 1;
    }
    set
}

/// Takes the lowest slots out of a set of at least as many.
#[inline(always)]
pub(super) fn take_group(set: &mut u32) -> [u32; GROUP] {
    let mut slots = [0; GROUP];
    let mut i = 0;
    while i < GROUP {
        slots[i] = take_bit(set);
        i += 1;
    }
    slots
}
