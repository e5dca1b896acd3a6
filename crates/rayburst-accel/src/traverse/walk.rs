//! The traversal loop of a wide tree: nearest child first, the others on a stack.

use std::{mem::MaybeUninit, ops::ControlFlow};

use rayburst_simd::{Isa, SlabRay};

use super::{count::Count, prepare::Span};
use crate::{
    build::binned_sah::MAX_DEPTH,
    layout::bvh8::{Bvh8, Node8, Reference},
};

/// Seven siblings a level and one to spare, as a power of two.
const ENTRIES: usize = (7 * MAX_DEPTH + 1).next_power_of_two();

#[derive(Clone, Copy)]
struct Entry {
    distance: f32,
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
}

/// What is done with the leaves that are visited. Not a closure: those are not inlined for sure, and
/// outside of a kernel's region there are only baseline instructions.
pub(crate) trait Leaves<C> {
    fn visit(&mut self, value: u32, span: &mut Span, count: &mut C) -> ControlFlow<()>;
}

/// Takes the first child out of the mask and asks for its memory.
#[inline(always)]
fn take<I: Isa>(isa: I, tree: &Bvh8, node: &Node8, distances: &[f32; 8], mask: &mut u32) -> Entry {
    let slot = mask.trailing_zeros() as usize % 8;
    *mask &= *mask - 1;
    let child = node.children[slot];
    let address = tree.address(child.value());
    isa.prefetch(address);
    isa.prefetch(address.wrapping_add(64));
    isa.prefetch(address.wrapping_add(128));
    isa.prefetch(address.wrapping_add(192));
    Entry { distance: distances[slot], child }
}

/// Visits the leaves whose boxes a ray may meet within `span`, which `leaves` may shorten;
/// nearest first if `ORDERED`. Stops when they break.
#[inline(always)]
pub(crate) fn walk<I: Isa, C: Count, const ORDERED: bool>(
    isa: I,
    tree: &Bvh8,
    ray: &SlabRay,
    span: &mut Span,
    stack: &mut Stack,
    count: &mut C,
    leaves: &mut impl Leaves<C>,
) -> ControlFlow<()> {
    let mut distances = [0.0; 8];
    let mut current = Reference::ROOT;
    let mut top = 0;
    loop {
        if current.is_leaf() {
            leaves.visit(current.value(), span, count)?;
        } else {
            count.node();
            let node = tree.node(current);
            let mut mask = isa.slab8(&node.boxes, ray, span.t_min, span.t_max, &mut distances);
            if mask != 0 {
                let mut nearest = take(isa, tree, node, &distances, &mut mask);
                if mask != 0 {
                    let base = top;
                    let mut entry = take(isa, tree, node, &distances, &mut mask);
                    if ORDERED && entry.distance < nearest.distance {
                        std::mem::swap(&mut entry, &mut nearest);
                    }
                    stack.set(top, entry);
                    top += 1;
                    while mask != 0 {
                        let mut entry = take(isa, tree, node, &distances, &mut mask);
                        let mut place = top;
                        if ORDERED {
                            if entry.distance < nearest.distance {
                                std::mem::swap(&mut entry, &mut nearest);
                            }
                            while place > base {
                                // SAFETY: `base ≤ place − 1 < top`: set above.
                                let below = unsafe { stack.get(place - 1) };
                                if below.distance >= entry.distance {
                                    break;
                                }
                                stack.set(place, below);
                                place -= 1;
                            }
                        }
                        stack.set(place, entry);
                        top += 1;
                    }
                }
                current = nearest.child;
                continue;
            }
        }
        loop {
            if top == 0 {
                return ControlFlow::Continue(());
            }
            top -= 1;
            // SAFETY: all entries below `top` were set.
            let entry = unsafe { stack.get(top) };
            // At equal distance a smaller index may wait.
            if !ORDERED || entry.distance <= span.t_max {
                current = entry.child;
                break;
            }
        }
    }
}
