//! Bottom-up build: clusters merge with their nearest neighbours along a space-filling curve.
//!
//! After Meister, Bittner, "Parallel locally-ordered clustering for bounding volume hierarchy
//! construction", 2018: primitives start as clusters in the order of a curve; in each round every
//! cluster looks at [`RADIUS`] clusters on either side for the one with which it has the smallest
//! common box, and two that choose each other become one. Each distance is computed once for both
//! (Benthin, Drabinski, Tessari, Dittebrandt, "PLOC++", 2022).
//!
//! Changed: at equal distance the neighbour whose place differs in the lowest bits wins. This is the
//! same order from both sides, so some pair always merges, and clusters in the same place merge by
//! halves. When the rounds that [`MAX_DEPTH`] allows are just enough for it, all clusters merge by
//! pairs: no input makes a deep tree or many rounds. Subtrees of few primitives become leaves.
//! Rounds work on fixed chunks, so the tree does not depend on the number of threads.

use rayon::prelude::*;

use super::{
    binned_sah::{MAX_DEPTH, Slots, TASK, nodes_below},
    bounds::Bounds4,
    curve_order::in_curve_order,
    monitor::Monitor,
    primitives::PrimitiveRef,
};
use crate::{
    BuildError, Curve,
    layout::{
        arena::zeroed_vec,
        bvh2::{Bvh2, Node2},
    },
};

/// How far a cluster looks.
const RADIUS: usize = 12;
/// Clusters of one task.
const CHUNK: usize = 2048;

/// Options of the builder.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ploc<'a> {
    /// Which curve.
    pub(crate) curve: Curve,
    /// Primitives in a leaf, at most.
    pub(crate) leaf_size: usize,
    /// Whom progress is told.
    pub(crate) monitor: Monitor<'a>,
}

/// What is below a cluster.
#[derive(Clone, Copy, Debug)]
struct Below {
    /// Of a single primitive its place in the order; else the pair that was merged.
    first: u32,
    /// How many primitives.
    count: u32,
}

/// Clusters that are not merged yet.
struct Active {
    bounds: Vec<Bounds4>,
    below: Vec<Below>,
}

/// A pair that was merged, as nodes whose `count` is that of all primitives below.
type Pair = [Node2; 2];

impl Ploc<'_> {
    /// Builds the tree over some primitives.
    pub(crate) fn build(&self, refs: &[PrimitiveRef]) -> Result<Bvh2, BuildError> {
        let count = refs.len();
        if count == 0 {
            return Ok(Bvh2::default());
        }
        let refs = in_curve_order(refs, self.curve);
        self.monitor.check()?;
        let mut pairs: Vec<Pair> = zeroed_vec(count - 1, "the builder's pairs")?;
        let root = self.merge_all(&refs, &mut pairs)?;
        let mut nodes = Node2::allocate(1 + nodes_below(count))?;
        let mut order = vec![0; count];
        if let Some((first, below)) = nodes.split_first_mut() {
            let slots = Slots { nodes: below, base: 1 };
            let layout = Layout { pairs: &pairs, refs: &refs, leaf_size: self.leaf_size };
            *first = layout.tree(&root, 0, &mut order, slots);
        }
        Ok(Bvh2 { nodes, order })
    }

    /// Merges until one cluster is left, which is returned.
    fn merge_all(&self, refs: &[PrimitiveRef], pairs: &mut [Pair]) -> Result<Node2, BuildError> {
        let bounds = refs.par_iter().with_min_len(TASK).map(|reference| {
            let mut bounds = Bounds4::of(reference);
            // No arithmetic may stumble over the index.
            bounds.lower.w = 0.0;
            bounds
        });
        let below = (0..refs.len() as u32).into_par_iter().with_min_len(TASK);
        let mut active = Active {
            bounds: bounds.collect(),
            below: below.map(|first| Below { first, count: 1 }).collect(),
        };
        let mut spare = Active { bounds: active.bounds.clone(), below: active.below.clone() };
        let mut nearest = vec![0; refs.len()];
        let (mut used, mut rounds) = (0, 0);
        while active.bounds.len() > 1 {
            self.monitor.check()?;
            let count = active.bounds.len();
            nearest.truncate(count);
            if rounds + count.next_power_of_two().ilog2() as usize >= MAX_DEPTH {
                for (place, buddy) in nearest.iter_mut().enumerate() {
                    *buddy = if place ^ 1 < count { place as u32 ^ 1 } else { place as u32 };
                }
            } else {
                find_nearest(&active.bounds, &mut nearest);
            }
            let merged = merge(&active, &nearest, &mut spare, used, &mut pairs[used..]);
            self.monitor.advance(merged);
            used += merged;
            rounds += 1;
            std::mem::swap(&mut active, &mut spare);
        }
        Ok(node(&active.bounds[0], active.below[0]))
    }
}

fn node(bounds: &Bounds4, below: Below) -> Node2 {
    Node2 { bounds: bounds.aabb(), first: below.first, count: below.count }
}

/// For each cluster the one nearby with which it has the smallest common box.
fn find_nearest(bounds: &[Bounds4], nearest: &mut [u32]) {
    nearest.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, nearest)| {
        let first = chunk * CHUNK;
        let end = first + nearest.len();
        // With the neighbours on both sides.
        let from = first.saturating_sub(RADIUS);
        let to = (end + RADIUS).min(bounds.len());
        let mut best = [u64::MAX; CHUNK + 2 * RADIUS];
        for i in from..end {
            let own = &bounds[i];
            let mut least = best[i - from];
            let others = &bounds[i + 1..(i + 1 + RADIUS).min(to)];
            for (j, (other, best)) in (i + 1..).zip(others.iter().zip(&mut best[i + 1 - from..])) {
                // The bits of numbers that are not negative are in their order.
                let distance = own.union(other).half_area().to_bits();
                let key = u64::from(distance) << 32 | (i ^ j) as u64;
                least = least.min(key);
                *best = key.min(*best);
            }
            best[i - from] = least;
        }
        for ((place, nearest), best) in (first..).zip(nearest).zip(&best[first - from..]) {
            *nearest = place as u32 ^ *best as u32;
        }
    });
}

/// Merges clusters that are each other's nearest; those that are left go to `next`. Returns how many
/// pairs were made.
fn merge(
    active: &Active,
    nearest: &[u32],
    next: &mut Active,
    used: usize,
    pairs: &mut [Pair],
) -> usize {
    let partner = |place: usize| {
        let other = nearest[place] as usize;
        (other != place && nearest[other] as usize == place).then_some(other)
    };
    let count = nearest.len();
    let merged: Vec<[usize; 2]> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let (mut kept, mut merged) = (0, 0);
            for place in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                let partner = partner(place);
                kept += usize::from(partner.is_none_or(|other| place < other));
                merged += usize::from(partner.is_some_and(|other| place < other));
            }
            [kept, merged]
        })
        .collect();
    let total: usize = merged.iter().map(|[_, merged]| merged).sum();
    next.bounds.truncate(count - total);
    next.below.truncate(count - total);
    let mut tasks = Vec::with_capacity(merged.len());
    let (mut bounds, mut below) = (next.bounds.as_mut_slice(), next.below.as_mut_slice());
    let (mut pairs, mut pair) = (pairs, used);
    for (chunk, [kept, merged]) in merged.into_iter().enumerate() {
        let (own_bounds, other_bounds) = bounds.split_at_mut(kept);
        let (own_below, other_below) = below.split_at_mut(kept);
        let (own_pairs, other_pairs) = pairs.split_at_mut(merged);
        tasks.push((chunk, pair, own_bounds, own_below, own_pairs));
        (bounds, below, pairs) = (other_bounds, other_below, other_pairs);
        pair += merged;
    }
    tasks.into_par_iter().for_each(|(chunk, first_pair, bounds, below, pairs)| {
        let (mut kept, mut merged) = (0, 0);
        for place in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
            let (own, own_below) = (&active.bounds[place], active.below[place]);
            (bounds[kept], below[kept]) = match partner(place) {
                None => (*own, own_below),
                Some(other) if place < other => {
                    let (with, with_below) = (&active.bounds[other], active.below[other]);
                    pairs[merged] = [node(own, own_below), node(with, with_below)];
                    let first = (first_pair + merged) as u32;
                    merged += 1;
                    (own.union(with), Below { first, count: own_below.count + with_below.count })
                }
                Some(_) => continue,
            };
            kept += 1;
        }
    });
    total
}

/// Puts merged pairs into depth-first order.
struct Layout<'a> {
    pairs: &'a [Pair],
    refs: &'a [PrimitiveRef],
    leaf_size: usize,
}

impl Layout<'_> {
    /// Writes what is below a cluster with several tasks; returns its node.
    fn tree(&self, cluster: &Node2, first: u32, order: &mut [u32], slots: Slots<'_>) -> Node2 {
        if order.len() < TASK {
            let mut used = 0;
            return self.grow(cluster, first, order, slots.nodes, slots.base, &mut used);
        }
        let [a, b] = &self.pairs[cluster.first as usize];
        let (pair, [left, right]) = slots.divide(nodes_below(a.count as usize));
        let child = left.base - 2;
        let (left_order, right_order) = order.split_at_mut(a.count as usize);
        (pair[0], pair[1]) = rayon::join(
            || self.tree(a, first, left_order, left),
            || self.tree(b, first + a.count, right_order, right),
        );
        Node2::inner(cluster.bounds, child)
    }

    fn grow(
        &self,
        cluster: &Node2,
        first: u32,
        order: &mut [u32],
        nodes: &mut [Node2],
        base: u32,
        used: &mut usize,
    ) -> Node2 {
        if order.len() <= self.leaf_size {
            self.gather(cluster, order);
            return Node2::leaf(cluster.bounds, first, order.len());
        }
        let [a, b] = &self.pairs[cluster.first as usize];
        let (left_order, right_order) = order.split_at_mut(a.count as usize);
        let pair = *used;
        *used += 2;
        nodes[pair] = self.grow(a, first, left_order, nodes, base, used);
        nodes[pair + 1] = self.grow(b, first + a.count, right_order, nodes, base, used);
        Node2::inner(cluster.bounds, base + pair as u32)
    }

    /// The primitives below a cluster.
    fn gather(&self, cluster: &Node2, order: &mut [u32]) {
        if let [only] = order {
            *only = self.refs[cluster.first as usize].index();
            return;
        }
        let [a, b] = &self.pairs[cluster.first as usize];
        let (left, right) = order.split_at_mut(a.count as usize);
        self.gather(a, left);
        self.gather(b, right);
    }
}
