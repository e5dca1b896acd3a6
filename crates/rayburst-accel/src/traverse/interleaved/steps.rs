//! The steps of rays in flight: nodes and leaves, of one ray or a group.

use std::{hint::select_unpredictable, ops::ControlFlow};

use rayburst_simd::{Isa, Nearest, SLOT};

use super::{
    Pilot,
    flights::{BOTTOM, DONE, GROUP, Sets, keys, set_of},
};
use crate::{
    CandidateFilter,
    layout::{
        bvh8::Reference,
        view::{Leaf, TreeView},
    },
    structure::Structure,
    traverse::{
        count::Count,
        query::{Asker, OneHit, is_met_again, is_plain, take_plain, test_leaf},
    },
};

/// All rays of a group, as bits.
const ALL: u32 = (1 << GROUP) - 1;

impl<I: Isa, S: Structure, F: CandidateFilter> Pilot<'_, '_, I, S, F> {
    /// Visits a node, whatever it is that its ray meets first.
    ///
    /// # Safety
    /// `slot` must hold a flight that was started and is in no set.
    #[inline(always)]
    pub(super) unsafe fn any_node<Q: OneHit, C: Count>(
        &self,
        slot: u32,
        others: u32,
        sets: &mut Sets,
    ) {
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
    pub(super) unsafe fn are_alike<Q, C>(&self, slots: [u32; GROUP]) -> bool {
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
    pub(super) unsafe fn nodes<const N: usize, Q: OneHit, C: Count>(
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
            let counts = TreeView::sorted8(self.isa, trees, current, rays, spans, sorted, found);
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
    pub(super) unsafe fn pop(&self, keys: *mut u32, mut top: usize, t_max: f32) -> usize {
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
    pub(super) unsafe fn advance<Q: OneHit, C: Count>(
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
    pub(super) unsafe fn leaf<Q: OneHit, C: Count>(&self, slot: u32, others: u32, sets: &mut Sets) {
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
            self.after_leaf::<Q, C>(slot, ended, sets);
        }
    }

    /// Goes on with what is on the stack, unless the query has ended.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    unsafe fn after_leaf<Q: OneHit, C: Count>(
        &self,
        slot: u32,
        ended: ControlFlow<()>,
        sets: &mut Sets,
    ) {
        // SAFETY: the caller's promise.
        unsafe {
            let flight = self.flight::<Q, C>(slot);
            let (top, t_max) = ((*flight).top as usize, (*flight).span.t_max);
            let tree = if S::TWO_LEVEL { (*flight).tree } else { self.tree };
            let place = if ended.is_break() {
                BOTTOM - 1
            } else if Q::ORDERED {
                self.pop(keys(flight), top, t_max)
            } else {
                top - 1
            };
            let next = *keys(flight).add(self.entries + place).cast::<Reference>();
            self.advance::<Q, C>(slot, tree, place, next, sets);
        }
    }

    /// Visits a leaf for each of some flights; gives the set of those whose leaves are left, since there
    /// is something to decide about them.
    ///
    /// # Safety
    /// As for [`Pilot::any_node`].
    #[inline(always)]
    pub(super) unsafe fn leaves<Q: OneHit, C: Count>(
        &self,
        slots: [u32; GROUP],
        others: u32,
        sets: &mut Sets,
    ) -> u32 {
        // SAFETY: the caller's promise.
        unsafe {
            let first = self.flight::<Q, C>(slots[0]);
            let Some(place) = &(*first).place else { return set_of(slots) };
            let tree = if S::TWO_LEVEL { (*first).tree } else { self.tree };
            let Some(block) = tree.block((*first).current.value()) else { return set_of(slots) };
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
                    let Some(place) = &f.place else { return set_of(slots) };
                    (places[i], keep[i], tree) = (place, place.keep, f.tree);
                }
                let Some(block) = tree.block(f.current.value()) else {
                    return set_of(slots);
                };
                (blocks[i], rays[i]) = (block, &f.ray.shear);
                spans[i] = [f.span.t_min, f.span.t_max];
                i += 1;
            }
            let nearest = self.isa.nearest4_of4(blocks, rays, spans, keep);
            let mut plain = 0;
            let mut i = 0;
            while i < GROUP {
                let (f, leaf) = (&*flights[i], Leaf::Block(blocks[i]));
                let is_plain = is_plain::<F>(&nearest[i], places[i], &f.ray, leaf, &f.span);
                plain |= u32::from(is_plain) << i;
                i += 1;
            }
            if plain != ALL {
                if !Q::ORDERED {
                    return set_of(slots);
                }
                let mut left = 0;
                let mut i = 0;
                while i < GROUP {
                    let (f, leaf) = (&mut *flights[i], Leaf::Block(blocks[i]));
                    let mut found = nearest[i];
                    let mut ready = plain >> i & 1 != 0;
                    if !ready && is_met_again(&found, places[i], leaf, &f.span, &f.query) {
                        (found, ready) = (Nearest::NONE, true);
                    }
                    if ready {
                        f.count.beside(others);
                        f.count.leaf(leaf);
                        let value = f.current.value();
                        let ended = take_plain(&found, value, &mut f.span, &mut f.query);
                        self.after_leaf::<Q, C>(slots[i], ended, sets);
                    } else {
                        left |= 1 << slots[i];
                    }
                    i += 1;
                }
                return left;
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
            0
        }
    }
}

/// The greatest key of a distance that is no greater.
#[inline(always)]
fn limit(t_max: f32) -> u32 {
    t_max.to_bits() | SLOT
}
