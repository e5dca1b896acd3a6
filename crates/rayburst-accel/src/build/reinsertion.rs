//! Passes over a finished binary tree: subtrees move to where they cost less.
//!
//! After Meister, Bittner, "Parallel reinsertion for bounding volume hierarchy optimization", 2018:
//! in each pass the nodes with the largest boxes look, in parallel, for the place where taking them out
//! and putting them in again saves most area; the search goes up from the node and down into every
//! subtree on the way that may still be better than the best place found.
//!
//! Changed: no node is locked. The moves found are made one after another, those that save most first,
//! and each only if it still saves area in the tree as the moves before it left it, and makes nothing
//! deeper than [`MAX_DEPTH`]. So no pass makes the tree worse, and the tree does not depend on the number
//! of threads. A node that found no better place is left alone for a while. Passes end when one gains little. Leaves stay as they are.

use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::{binned_sah::MAX_DEPTH, bounds::Bounds4, monitor::Monitor};
use crate::{
    BuildError,
    layout::{
        arena::zeroed_vec,
        bvh2::{Bvh2, Node2},
    },
};

/// Nodes of one task of the search.
const TASK: usize = 64;
/// In how many passes a node that found no better place is not asked again.
const REST: u8 = 2;
/// A move must save this part of the root's area, so that rounding cannot make one look good.
const LEAST_GAIN: f32 = 1e-7;

/// How much is spent on a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Effort {
    /// Passes at most.
    pub(crate) passes: usize,
    /// The part of the nodes that look for another place in a pass.
    pub(crate) part: f32,
    /// A pass that takes less than this part off the area of the inner nodes is the last.
    pub(crate) least: f64,
}

/// A node, and where it should go.
#[derive(Clone, Copy, Debug)]
struct Move {
    node: u32,
    /// The node that becomes its sibling.
    target: u32,
    gain: f32,
}

/// A tree that is being improved.
struct Tree<'a> {
    nodes: &'a mut [Node2],
    /// The node above each; the root's own is itself.
    parents: Vec<u32>,
    /// Inner nodes on the longest path down from each.
    heights: Vec<u8>,
    /// The last move for which a node was marked.
    marks: Vec<u32>,
    /// Moves tried so far.
    tried: u32,
    /// In how many passes a node is not asked.
    settled: Vec<u8>,
    /// How many inner nodes there are.
    inner: usize,
    /// The area of all inner nodes.
    area: f64,
    least_gain: f32,
}

/// Improves a tree.
pub(crate) fn reinsert(
    tree: &mut Bvh2,
    effort: &Effort,
    monitor: Monitor<'_>,
) -> Result<(), BuildError> {
    if tree.nodes.is_empty() || tree.nodes[0].is_leaf() || effort.passes == 0 {
        return Ok(());
    }
    let mut tree = Tree::new(&mut tree.nodes)?;
    let wanted = (2.0 * tree.inner as f32 * effort.part).ceil() as usize;
    for _ in 0..effort.passes {
        monitor.check()?;
        let moves = tree.moves(wanted);
        let gained: f64 = moves.iter().filter_map(|planned| tree.make(planned)).sum();
        if gained < effort.least * tree.area {
            break;
        }
        tree.area -= gained;
    }
    Ok(())
}

impl<'a> Tree<'a> {
    /// Starts with a tree whose root is not a leaf, and whose parents come before their children. Makes
    /// the boxes of inner nodes exactly those around their children, which they need not be after
    /// spatial splits.
    fn new(nodes: &'a mut [Node2]) -> Result<Self, BuildError> {
        let count = nodes.len();
        let mut tree = Self {
            parents: zeroed_vec(count, "the parents of nodes")?,
            heights: zeroed_vec(count, "the heights of nodes")?,
            marks: zeroed_vec(count, "the marks of nodes")?,
            tried: 0,
            settled: zeroed_vec(count, "the marks of nodes")?,
            inner: 0,
            area: 0.0,
            least_gain: 0.0,
            nodes,
        };
        for index in (0..count as u32).rev() {
            let node = &tree.nodes[index as usize];
            // What is not used has no first child.
            if node.is_leaf() || node.first == 0 {
                continue;
            }
            debug_assert!(node.first > index);
            tree.put(index, *node);
            let (bounds, height) = tree.of_children(index);
            tree.nodes[index as usize].bounds = bounds.aabb();
            tree.heights[index as usize] = height;
            tree.area += f64::from(bounds.half_area());
            tree.inner += 1;
        }
        tree.least_gain = LEAST_GAIN * tree.bounds(0).half_area();
        Ok(tree)
    }

    fn bounds(&self, node: u32) -> Bounds4 {
        Bounds4::of_aabb(&self.nodes[node as usize].bounds)
    }

    fn parent(&self, node: u32) -> u32 {
        self.parents[node as usize]
    }

    fn height(&self, node: u32) -> u8 {
        self.heights[node as usize]
    }

    /// The other child of the parent.
    fn sibling(&self, node: u32) -> u32 {
        let first = self.nodes[self.parent(node) as usize].first;
        if node == first { first + 1 } else { first }
    }

    /// The box around the children of an inner node, and its height.
    fn of_children(&self, node: u32) -> (Bounds4, u8) {
        let first = self.nodes[node as usize].first;
        let bounds = self.bounds(first).union(&self.bounds(first + 1));
        (bounds, 1 + self.height(first).max(self.height(first + 1)))
    }

    /// The moves that save most, best first.
    fn moves(&mut self, wanted: usize) -> Vec<Move> {
        let candidates = self.candidates(wanted);
        let search = |nodes: &[u32]| -> Vec<Option<Move>> {
            let mut stack = Vec::with_capacity(64);
            nodes.iter().map(|&node| self.find(node, &mut stack)).collect()
        };
        let found: Vec<_> = candidates.par_chunks(TASK).flat_map_iter(search).collect();
        for (&node, found) in candidates.iter().zip(&found) {
            self.settled[node as usize] = if found.is_none() { REST } else { 0 };
        }
        let mut moves: Vec<Move> = found.into_iter().flatten().collect();
        moves.par_sort_unstable_by(|a, b| {
            b.gain.total_cmp(&a.gain).then_with(|| a.node.cmp(&b.node))
        });
        moves
    }

    /// The nodes with the largest boxes, but for the root, its children and those that are left alone.
    fn candidates(&mut self, wanted: usize) -> Vec<u32> {
        let mut candidates = Vec::with_capacity(wanted);
        // No box is larger than its parent's, and areas, not negative, sort as their bits.
        let mut largest = BinaryHeap::from([(u32::MAX, 0)]);
        while let Some((_, node)) = largest.pop() {
            if self.settled[node as usize] != 0 {
                self.settled[node as usize] -= 1;
            } else if self.parent(node) != 0 {
                candidates.push(node);
                if candidates.len() == wanted {
                    break;
                }
            }
            let node = &self.nodes[node as usize];
            if !node.is_leaf() {
                for child in [node.first, node.first + 1] {
                    let area = self.nodes[child as usize].bounds.half_area();
                    largest.push((area.to_bits(), child));
                }
            }
        }
        candidates
    }

    /// The best place for a node, if one is better than where it is.
    fn find(&self, node: u32, stack: &mut Vec<(f32, u32)>) -> Option<Move> {
        let own = self.bounds(node);
        let own_area = own.half_area();
        let parent = self.parent(node);
        let mut best = Move { node, target: parent, gain: self.least_gain };
        // What is saved so far by taking the node out of the boxes on the way up, and on the way down
        // lost again.
        let mut saved = self.bounds(parent).half_area();
        // The box of what is left of the subtree on the way up.
        let mut left = Bounds4::EMPTY;
        let mut from = node;
        loop {
            let above = self.parent(from);
            stack.push((saved, self.sibling(from)));
            while let Some((saved, target)) = stack.pop() {
                // No place below saves more: its own box must hold the node.
                if saved - own_area <= best.gain {
                    continue;
                }
                let old = self.bounds(target);
                let merged = old.union(&own).half_area();
                let gain = saved - merged;
                if gain > best.gain {
                    best = Move { node, target, gain };
                }
                let target = &self.nodes[target as usize];
                if !target.is_leaf() {
                    let saved = gain + old.half_area();
                    stack.extend([(saved, target.first), (saved, target.first + 1)]);
                }
            }
            left.merge(&self.bounds(self.sibling(from)));
            if above != parent {
                let left = left.half_area();
                // As the sibling of all that is left of a node above.
                if saved - left > best.gain {
                    best = Move { node, target: above, gain: saved - left };
                }
                saved += self.bounds(above).half_area() - left;
            }
            if above == 0 {
                break;
            }
            from = above;
        }
        (best.target != parent).then_some(best)
    }

    /// Makes a move, if it is possible and saves area; returns how much.
    fn make(&mut self, planned: &Move) -> Option<f64> {
        let Move { node, target, .. } = *planned;
        let parent = self.parent(node);
        if parent == 0 || target == parent || target == self.sibling(node) {
            return None;
        }
        let (meeting, depth) = self.meeting(node, target)?;
        let height = usize::from(self.height(node).max(self.height(target)));
        let gain = self.gain(node, target, meeting);
        if gain < f64::from(self.least_gain) || depth + 1 + height > MAX_DEPTH {
            return None;
        }
        self.relink(node, target);
        Some(gain)
    }

    /// The lowest node above a node that is above the target or is the target, and the depth of the
    /// target; `None` if the target is below the node.
    fn meeting(&mut self, node: u32, target: u32) -> Option<(u32, usize)> {
        self.tried += 1;
        let mut above = node;
        while above != 0 {
            above = self.parent(above);
            self.marks[above as usize] = self.tried;
        }
        let (mut at, mut depth, mut meeting) = (target, 0, None);
        loop {
            if meeting.is_none() {
                if at == node {
                    return None;
                }
                meeting = (self.marks[at as usize] == self.tried).then_some(at);
            }
            if at == 0 {
                return Some((meeting?, depth));
            }
            at = self.parent(at);
            depth += 1;
        }
    }

    /// The area that a move saves.
    fn gain(&self, node: u32, target: u32, meeting: u32) -> f64 {
        let area = |bounds: &Bounds4| f64::from(bounds.half_area());
        let own = self.bounds(node);
        let (mut at, mut left) = (self.parent(node), self.bounds(self.sibling(node)));
        let mut gain = area(&self.bounds(at));
        // Boxes on the way up shrink. Above where the ways meet all stays inside; a target on the way
        // shrinks itself.
        while at != meeting {
            let above = self.parent(at);
            if above == meeting && meeting != target {
                break;
            }
            left.merge(&self.bounds(self.sibling(at)));
            gain += area(&self.bounds(above)) - area(&left);
            at = above;
        }
        let old = self.bounds(target);
        gain -= area(&old.union(&own));
        at = target;
        while at != meeting {
            at = self.parent(at);
            if at != meeting {
                let old = self.bounds(at);
                gain += area(&old) - area(&old.union(&own));
            }
        }
        gain
    }

    /// Takes a node out, so that its sibling takes its parent's place, and makes it the sibling of the
    /// target.
    fn relink(&mut self, node: u32, target: u32) {
        let (parent, sibling) = (self.parent(node), self.sibling(node));
        let first = self.nodes[parent as usize].first;
        self.put(parent, self.nodes[sibling as usize]);
        self.heights[parent as usize] = self.height(sibling);
        let old = self.nodes[target as usize];
        self.put(sibling, old);
        self.heights[sibling as usize] = self.height(target);
        let own = self.bounds(node);
        let both = Bounds4::of_aabb(&old.bounds).union(&own);
        self.nodes[target as usize] = Node2::inner(both.aabb(), first);
        self.parents[sibling as usize] = target;
        self.parents[node as usize] = target;
        self.heights[target as usize] = 1 + self.height(node).max(self.height(sibling));
        self.tighten_above(target);
        self.tighten_above(parent);
    }

    /// Makes the boxes and heights above a node those of their children.
    fn tighten_above(&mut self, mut at: u32) {
        while at != 0 {
            at = self.parent(at);
            let (bounds, height) = self.of_children(at);
            let bounds = bounds.aabb();
            if bounds == self.nodes[at as usize].bounds && height == self.height(at) {
                break;
            }
            self.nodes[at as usize].bounds = bounds;
            self.heights[at as usize] = height;
        }
    }

    /// Puts a node and what is below it into a place.
    fn put(&mut self, at: u32, node: Node2) {
        self.nodes[at as usize] = node;
        if !node.is_leaf() {
            self.parents[node.first as usize] = at;
            self.parents[node.first as usize + 1] = at;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::{
        binned_sah::{BinnedSah, levels},
        primitives::PrimitiveRef,
    };
    use glam::Vec3;
    use rayburst_math::{Aabb, hash::Rng};

    /// All nodes that are used.
    fn used(tree: &Tree<'_>) -> Vec<u32> {
        let mut used = vec![0];
        let mut next = 0;
        while let Some(&index) = used.get(next) {
            let node = &tree.nodes[index as usize];
            if !node.is_leaf() {
                used.extend([node.first, node.first + 1]);
            }
            next += 1;
        }
        used
    }

    fn random_refs(count: u32, seed: u64) -> Vec<PrimitiveRef> {
        let mut rng = Rng::new(seed);
        let mut point = |scale: f32| Vec3::from_array(std::array::from_fn(|_| rng.f32() * scale));
        (0..count)
            .map(|index| {
                // Small and large ones, dense and sparse.
                let (lower, size) = (point(2.0).powf(3.0), point(1.5).powf(6.0));
                PrimitiveRef::new(&Aabb { lower, upper: lower + size }, index)
            })
            .collect()
    }

    fn random_tree(count: u32, seed: u64) -> Bvh2 {
        let refs = random_refs(count, seed);
        // Medians, which leave much to be improved.
        let (monitor, max_depth) = (Monitor::default(), levels(refs.len(), 4));
        BinnedSah { bins: 8, leaf_size: 4, max_depth, monitor }.build(refs).unwrap()
    }

    /// The area of all inner nodes; panics unless boxes are those around their children.
    fn inner_area(nodes: &[Node2]) -> f64 {
        let mut stack = vec![0];
        let mut sum = 0.0;
        while let Some(index) = stack.pop() {
            let node = &nodes[index as usize];
            if !node.is_leaf() {
                let [a, b] = [0, 1].map(|i| nodes[(node.first + i) as usize].bounds);
                assert_eq!(node.bounds, a.union(b));
                sum += f64::from(node.bounds.half_area());
                stack.extend([node.first, node.first + 1]);
            }
        }
        sum
    }

    /// All leaves as they are in the order.
    fn leaves(tree: &Bvh2) -> Vec<(u32, u32)> {
        let mut stack = vec![0];
        let mut leaves = vec![];
        while let Some(index) = stack.pop() {
            let node = &tree.nodes[index as usize];
            if node.is_leaf() {
                leaves.push((node.first, node.count));
            } else {
                stack.extend([node.first, node.first + 1]);
            }
        }
        leaves.sort_unstable();
        leaves
    }

    #[test]
    fn no_pass_makes_a_tree_worse_and_leaves_stay() {
        for (count, seed) in [(2, 1), (9, 2), (13, 3), (40, 4), (5000, 5)] {
            let mut tree = random_tree(count, seed);
            let (before, order) = (leaves(&tree), tree.order.clone());
            let first = inner_area(&tree.nodes);
            let mut area = first;
            if tree.nodes[0].is_leaf() {
                continue;
            }
            let mut work = Tree::new(&mut tree.nodes).unwrap();
            for _ in 0..20 {
                let moves = work.moves(300);
                let gained: f64 = moves.iter().filter_map(|planned| work.make(planned)).sum();
                let new = inner_area(work.nodes);
                assert!((area - new - gained).abs() < 1e-5 * area, "{area} {new} {gained}");
                assert!(gained >= 0.0);
                area = new;
            }
            assert!(work.height(0) as usize <= MAX_DEPTH);
            assert_eq!(leaves(&tree), before);
            assert_eq!(tree.order, order);
            if count == 5000 {
                assert!(area < 0.96 * first, "{area} of {first}");
            }
        }
    }

    #[test]
    fn what_a_move_saves_is_what_was_said() {
        let mut rng = Rng::new(7);
        let mut tree = random_tree(300, 8);
        let mut said = 0.0;
        let before = inner_area(&tree.nodes);
        let mut work = Tree::new(&mut tree.nodes).unwrap();
        let used = used(&work);
        let mut made = 0;
        for _ in 0..2000 {
            let mut pick = || used[rng.below(used.len() as u32) as usize];
            let (node, target) = (pick(), pick());
            let (parent, sibling) = (work.parent(node), work.sibling(node));
            if parent == 0 || target == parent || target == sibling || target == node {
                continue;
            }
            if let Some((meeting, _)) = work.meeting(node, target) {
                said += work.gain(node, target, meeting);
                work.relink(node, target);
                made += 1;
            }
        }
        assert!(made > 1000, "{made}");
        let after = inner_area(&tree.nodes);
        assert!((before - after - said).abs() < 1e-4 * before, "{before} {after} {said}");
    }

    #[test]
    fn the_best_place_of_a_node_is_found() {
        let mut tree = random_tree(60, 9);
        let mut improved = 0;
        let mut work = Tree::new(&mut tree.nodes).unwrap();
        work.least_gain = 1e-3;
        let used = used(&work);
        for &node in &used {
            let (parent, sibling) = (work.parent(node), work.sibling(node));
            if parent == 0 {
                continue;
            }
            let mut best = f64::from(work.least_gain);
            for &target in &used {
                if [parent, sibling, node].contains(&target) {
                    continue;
                }
                if let Some((meeting, _)) = work.meeting(node, target) {
                    best = best.max(work.gain(node, target, meeting));
                }
            }
            let found = work.find(node, &mut vec![]).map_or(work.least_gain, |m| m.gain);
            assert!((f64::from(found) - best).abs() < 1e-3, "{found} {best}");
            improved += u32::from(found > work.least_gain);
        }
        assert!(improved > 5, "{improved}");
    }
}
