//! The traversal loop of a wide tree for one ray: nearest child first, the others on a stack.
//!
//! Branches on how many children are met are predicted well enough, and what the CPU guesses right it
//! need not wait for: a node of which one child is met leads on before its distances are compared. The
//! form without branches, which rays in flight use, is an eighth slower for a single ray.

use std::{mem::MaybeUninit, ops::ControlFlow};

use rayburst_simd::{Isa, SlabRay};

use super::{count::Count, prepare::Span};
use crate::{
    build::binned_sah::MAX_DEPTH,
    layout::{bvh8::Reference, view::TreeView},
};

/// Seven siblings a level, the bottom and one to spare, as a power of two.
const ENTRIES: usize = (7 * MAX_DEPTH + 2).next_power_of_two();
/// The reference at the bottom of the stack: no child that is met holds it.
const BOTTOM: Reference = Reference::NONE;

#[derive(Clone, Copy)]
struct Entry {
    /// Sorts like the distance at which the ray enters, but those before zero are alike.
    key: u32,
    child: Reference,
}

/// Subtrees to visit later. Kept by the caller so that a batch sets it up once.
pub(crate) struct Stack {
    entries: [MaybeUninit<Entry>; ENTRIES],
}

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [MaybeUninit::uninit(); ENTRIES] }
    }

    // Indices wrap at a power of two: no bounds check, and no write elsewhere whatever the tree.
    #[inline(always)]
    fn set(&mut self, index: usize, entry: Entry) {
        self.entries[index % ENTRIES].write(entry);
    }

    /// # Safety
    /// The entry must have been set.
    #[inline(always)]
    unsafe fn get(&self, index: usize) -> Entry {
        // SAFETY: the caller's promise.
        unsafe { self.entries[index % ENTRIES].assume_init() }
    }

    /// Takes the topmost entry whose key is within `limit`.
    ///
    /// # Safety
    /// All entries below `top` must have been set, the bottom one with a key of zero.
    #[inline(always)]
    unsafe fn pop(&self, top: &mut usize, limit: u32) -> Reference {
        loop {
            *top -= 1;
            // SAFETY: the caller's promise; the bottom entry is within every limit.
            let entry = unsafe { self.get(*top) };
            if entry.key <= limit {
                return entry.child;
            }
        }
    }

    /// Puts an entry, or `nearest` if that is farther, among those from `base` to `top`, which are
    /// sorted farthest first; returns the nearest.
    ///
    /// # Safety
    /// The entries from `base` to `top` must have been set.
    #[inline(always)]
    unsafe fn insert(
        &mut self,
        base: usize,
        top: usize,
        mut nearest: Entry,
        mut entry: Entry,
    ) -> Entry {
        if entry.key < nearest.key {
            std::mem::swap(&mut entry, &mut nearest);
        }
        let mut place = top;
        while place > base {
            // SAFETY: `base ≤ place − 1 < top`.
            let below = unsafe { self.get(place - 1) };
            if below.key >= entry.key {
                break;
            }
            self.set(place, below);
            place -= 1;
        }
        self.set(place, entry);
        nearest
    }
}

/// What is done with the leaves that are visited. Not a closure: those are not inlined for sure, and
/// outside of a kernel's region there are only baseline instructions.
pub(crate) trait Leaves<C> {
    fn visit(&mut self, value: u32, span: &mut Span, count: &mut C) -> ControlFlow<()>;
}

/// Bits of a distance, zero for distances before zero.
#[inline(always)]
fn key(distance: f32) -> u32 {
    (distance.to_bits() as i32).max(0) as u32
}

/// The first slot of the mask.
#[inline(always)]
fn first(mask: u32) -> usize {
    mask.trailing_zeros() as usize % 8
}

/// A met child, whose memory is asked for.
///
/// # Safety
/// The reference must be that of an inner node of the tree.
#[inline(always)]
unsafe fn take<I: Isa>(
    isa: I,
    tree: TreeView,
    node: Reference,
    distances: &[f32; 8],
    slot: usize,
) -> Entry {
    // SAFETY: the caller's promise.
    let child = unsafe { tree.child(node, slot as u32) };
    tree.prefetch(isa, child);
    Entry { key: key(distances[slot]), child }
}

/// Visits the leaves whose boxes a ray may meet within `span`, which `leaves` may shorten;
/// nearest first if `ORDERED`. Stops when they break.
///
/// # Safety
/// The tree must live until the walk is over.
#[inline(always)]
pub(crate) unsafe fn walk<I: Isa, C: Count, const ORDERED: bool>(
    isa: I,
    tree: TreeView,
    ray: &SlabRay,
    span: &mut Span,
    stack: &mut Stack,
    count: &mut C,
    leaves: &mut impl Leaves<C>,
) -> ControlFlow<()> {
    let mut distances = [0.0; 8];
    let mut current = Reference::ROOT;
    stack.set(0, Entry { key: 0, child: BOTTOM });
    let mut top = 1;
    loop {
        if current.is_leaf() {
            if current == BOTTOM {
                return ControlFlow::Continue(());
            }
            leaves.visit(current.value(), span, count)?;
        } else {
            count.node();
            let node = current;
            // SAFETY: the caller's promise; references to inner nodes come from the tree.
            let mask = unsafe { tree.slab8(isa, node, ray, span, &mut distances) };
            if mask != 0 {
                let slot = first(mask);
                // SAFETY: as above.
                let mut nearest = unsafe { take(isa, tree, node, &distances, slot) };
                let mut rest = mask & (mask - 1);
                if !ORDERED {
                    while rest != 0 {
                        // SAFETY: as above.
                        let child = unsafe { tree.child(node, first(rest) as u32) };
                        rest &= rest - 1;
                        stack.set(top, Entry { key: 0, child });
                        top += 1;
                    }
                } else if rest != 0 {
                    let other_slot = first(rest);
                    rest &= rest - 1;
                    // SAFETY: as above.
                    let mut other = unsafe { take(isa, tree, node, &distances, other_slot) };
                    if distances[other_slot] < distances[slot] {
                        std::mem::swap(&mut other, &mut nearest);
                    }
                    let base = top;
                    stack.set(top, other);
                    top += 1;
                    while rest != 0 {
                        // SAFETY: as above.
                        let entry = unsafe { take(isa, tree, node, &distances, first(rest)) };
                        rest &= rest - 1;
                        // SAFETY: entries from `base` to `top` were set above.
                        nearest = unsafe { stack.insert(base, top, nearest, entry) };
                        top += 1;
                    }
                }
                current = nearest.child;
                continue;
            }
        }
        // At equal distance a smaller index may wait.
        let limit = if ORDERED { key(span.t_max) } else { 0 };
        // SAFETY: all entries below `top` were set, and the bottom has a key of zero.
        current = unsafe { stack.pop(&mut top, limit) };
    }
}

/// A walk that stops at every leaf, the nearer ones first, and goes on when it is told to.
pub(crate) struct Cursor {
    stack: Stack,
    /// Entries on the stack; all of them were set. None if the walk is over.
    top: usize,
}

impl Cursor {
    /// A walk that is over.
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { stack: Stack::new(), top: 0 }
    }

    /// Ends the walk.
    #[inline(always)]
    pub(crate) fn end(&mut self) {
        self.top = 0;
    }

    /// Starts anew at the root of a tree.
    #[inline(always)]
    pub(crate) fn begin(&mut self) {
        self.stack.set(0, Entry { key: 0, child: BOTTOM });
        self.stack.set(1, Entry { key: 0, child: Reference::ROOT });
        self.top = 2;
    }

    /// Goes on to the next leaf whose box the ray may meet within `span`, which may have become shorter.
    ///
    /// # Safety
    /// The tree must live, and be the same in all calls since [`Self::begin`].
    #[inline(always)]
    pub(crate) unsafe fn next<I: Isa>(
        &mut self,
        isa: I,
        tree: TreeView,
        ray: &SlabRay,
        span: &Span,
    ) -> Option<u32> {
        if self.top == 0 {
            return None;
        }
        let Self { stack, top } = self;
        // At equal distance a smaller index may wait.
        let limit = key(span.t_max);
        let mut distances = [0.0; 8];
        // SAFETY: all entries below `top` were set, and the bottom has a key of zero.
        let mut current = unsafe { stack.pop(top, limit) };
        while !current.is_leaf() {
            let node = current;
            // SAFETY: references to inner nodes come from the tree; see above for the stack, of which
            // the entries from `base` to `top` are set here.
            unsafe {
                let mask = tree.slab8(isa, node, ray, span, &mut distances);
                current = if mask == 0 {
                    stack.pop(top, limit)
                } else {
                    let mut nearest = take(isa, tree, node, &distances, first(mask));
                    let (base, mut rest) = (*top, mask & (mask - 1));
                    while rest != 0 {
                        let entry = take(isa, tree, node, &distances, first(rest));
                        rest &= rest - 1;
                        nearest = stack.insert(base, *top, nearest, entry);
                        *top += 1;
                    }
                    nearest.child
                };
            }
        }
        (current != BOTTOM).then(|| current.value())
    }
}
