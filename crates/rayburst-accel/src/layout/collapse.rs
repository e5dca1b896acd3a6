//! Which binary nodes become the children of a wide node.
//!
//! After Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs through compressed wide
//! BVHs", HPG 2017, section 3.1: the wide tree of least surface area cost that a binary tree can give
//! is found bottom-up. `C(n, j)` is the least cost of the subtree `n` as a forest of at most `j` wide
//! nodes and leaves: either one node, or the best division of the `j` places between the two
//! children.
//!
//! Changed: leaves are those of the binary tree, whose cost is the same in every wide tree and left
//! out; a node costs a little beyond its area, so that no node is spent on next to nothing. Time and
//! memory are linear; four bytes a binary node stay.

use std::sync::atomic::{AtomicU32, Ordering};

use super::{arena::zeroed_vec, bvh2::Bvh2};
use crate::BuildError;

/// Children of a wide node.
const WIDTH: usize = 8;
/// What a wide node costs beyond its area, for the memory it takes, in parts of the root's area a
/// primitive.
const NODE_OVERHEAD: f32 = 0.3;
/// Subtrees below this level are solved by one task each.
const PARALLEL_LEVELS: usize = 12;

/// Least costs of a subtree in at most 1, 2, … 7 places.
type Costs = [f32; WIDTH - 1];

/// The best division of places at every node of a binary tree.
pub(crate) struct Collapse<'a> {
    tree: &'a Bvh2,
    /// For each node, three bits for each number of places from two: how many go to the first child;
    /// zero if the node takes one place.
    choices: Vec<AtomicU32>,
    /// What a node costs beyond its area.
    overhead: f32,
}

/// Up to eight binary nodes that become the children of a wide one.
#[derive(Default)]
pub(crate) struct Children {
    nodes: [u32; WIDTH],
    count: usize,
}

impl Children {
    pub(crate) fn as_mut_slice(&mut self) -> &mut [u32] {
        &mut self.nodes[..self.count]
    }

    pub(crate) fn as_slice(&self) -> &[u32] {
        &self.nodes[..self.count]
    }
}

impl<'a> Collapse<'a> {
    /// Solves a tree that is not empty.
    pub(crate) fn new(tree: &'a Bvh2) -> Result<Self, BuildError> {
        let choices = zeroed_vec(tree.nodes.len(), "the choice of wide nodes")?;
        let overhead = NODE_OVERHEAD * tree.nodes[0].bounds.half_area() / tree.order.len() as f32;
        let collapse = Self { tree, choices, overhead };
        collapse.solve(0, 0);
        Ok(collapse)
    }

    /// The children of the wide node that stands for a binary one.
    pub(crate) fn children(&self, root: u32) -> Children {
        let mut children = Children::default();
        self.expand(root, WIDTH, &mut children);
        children
    }

    fn expand(&self, index: u32, places: usize, children: &mut Children) {
        let node = &self.tree.nodes[index as usize];
        let first_places = if places < 2 {
            0
        } else {
            self.choices[index as usize].load(Ordering::Relaxed) >> (3 * (places - 2)) & 7
        };
        if node.is_leaf() || first_places == 0 {
            children.nodes[children.count] = index;
            children.count += 1;
        } else {
            let first_places = first_places as usize;
            self.expand(node.first, first_places, children);
            self.expand(node.first + 1, places - first_places, children);
        }
    }

    fn solve(&self, index: u32, level: usize) -> Costs {
        let node = &self.tree.nodes[index as usize];
        if node.is_leaf() {
            return [0.0; WIDTH - 1];
        }
        let (first, second) = if level < PARALLEL_LEVELS {
            rayon::join(
                || self.solve(node.first, level + 1),
                || self.solve(node.first + 1, level + 1),
            )
        } else {
            (self.solve(node.first, level + 1), self.solve(node.first + 1, level + 1))
        };
        let divide = |places: usize| {
            let mut best = (f32::INFINITY, 1);
            for first_places in 1..places {
                let cost = first[first_places - 1] + second[places - first_places - 1];
                if cost < best.0 {
                    best = (cost, first_places as u32);
                }
            }
            best
        };
        // A wide node of its own, which divides all its places.
        let (below, choice) = divide(WIDTH);
        let whole = node.bounds.half_area() + below + self.overhead;
        let mut choices = choice << (3 * (WIDTH - 2));
        let mut costs = [whole; WIDTH - 1];
        for places in 2..WIDTH {
            let (cost, choice) = divide(places);
            if cost < whole {
                costs[places - 1] = cost;
                choices |= choice << (3 * (places - 2));
            }
        }
        self.choices[index as usize].store(choices, Ordering::Relaxed);
        costs
    }
}
