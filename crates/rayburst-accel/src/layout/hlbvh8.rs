//! The 8-wide tree from clusters along a curve: the fast build.
//!
//! After Pantaleoni, Luebke, "HLBVH: hierarchical LBVH construction for real-time ray tracing of
//! dynamic geometry", 2010, and Garanzha, Pantaleoni, McAllister, "Simpler and faster HLBVH with work
//! queues", 2011: primitives whose codes share their high bits form clusters
//! ([`crate::build::clusters`]), which are the primitives of a binned build above them
//! ([`crate::build::binned_sah`]).
//!
//! Changed: a cluster is one wide node whose leaves are up to four consecutive triangles, divided where
//! codes differ in high bits, written in one pass over the triangles; only the clusters' boxes go through a binary tree. Clusters of at most
//! two leaves have no node, their leaves are children of the nodes above.
//!
//! Layout: the root, then clusters in the order of the curve (a node with its leaves, or a leaf, each
//! in whole lines), then the nodes above clusters, parents first. So clusters are in their places before
//! the nodes above them are known, which need not be near.

use rayon::prelude::*;

use super::{
    arena::{Line, allocate_parts},
    bvh2::Bvh2,
    bvh8::{Bvh8, NODE_LINES, Node8, Reference, Shape},
    collapse::{Children, Collapse},
    curve_leaves::{Bounds, CurveLeaves, LEAF_WORDS, leaf_lines},
    morton8::NODE_TRIANGLES,
    triangles::{BLOCK, TriangleLeaves},
};
use crate::{
    BuildError,
    build::{
        binned_sah::{BinnedSah, MAX_DEPTH},
        clusters::clusters,
        monitor::Monitor,
        morton::Keys,
        primitives::PrimitiveRef,
    },
};

/// Clusters that are written by one task.
const TASK: usize = 256;
/// Clusters of more leaves than this are nodes.
const BARE_LEAVES: usize = 2;
/// How many bits higher codes must differ for a leaf to hold one triangle less.
const FULL_LEAF: u32 = 1;

/// A child of the nodes above: a cluster's node or leaf.
pub(super) struct Item {
    pub(super) bounds: Bounds,
    pub(super) reference: Reference,
}

/// What the clusters of a task became.
#[derive(Default)]
struct Written {
    items: Vec<Item>,
    nodes: usize,
    leaves: usize,
    area: f64,
}

/// The nodes above clusters, parents first.
pub(super) struct Above<'a> {
    tree: &'a Bvh2,
    items: &'a [&'a Item],
    /// The children of each node in the binary tree, and the number of the first that is no item.
    nodes: Vec<(Children, u32)>,
    /// The line of the second node.
    start: usize,
}

impl Bvh8 {
    /// Builds over the triangles of sorted keys.
    pub(crate) fn from_clusters(
        keys: &Keys,
        triangles: &TriangleLeaves<'_>,
        bins: usize,
        monitor: Monitor<'_>,
    ) -> Result<Self, BuildError> {
        if keys.len() <= NODE_TRIANGLES {
            return Self::from_keys(keys, triangles);
        }
        let starts = clusters(keys, NODE_TRIANGLES);
        monitor.check()?;
        let tasks: Vec<&[u32]> = (0..starts.len() - 1)
            .step_by(TASK)
            .map(|first| &starts[first..(first + TASK + 1).min(starts.len())])
            .collect();
        let mut sizes = vec![NODE_LINES];
        let lines_of = |part: &[u32]| leaf_ends(keys, part).lines();
        let size = |task: &&[u32]| task.windows(2).map(lines_of).sum::<usize>();
        sizes.par_extend(tasks.par_iter().map(size));
        let mut begins = Vec::with_capacity(sizes.len());
        let mut start = 0;
        for size in &sizes {
            begins.push(start);
            start += size;
        }
        // A node has at least two children.
        let most_above = 2 * starts.len() * NODE_LINES;
        let (mut lines, parts) = allocate_parts(&sizes, most_above, |number, lines| {
            let Some(task) = number.checked_sub(1).map(|task| tasks[task]) else {
                return Written::default();
            };
            if monitor.is_cancelled() {
                return Written::default();
            }
            monitor.advance((task[task.len() - 1] - task[0]) as usize);
            write_clusters(keys, task, begins[number], lines, CurveLeaves::new(keys, triangles))
        })?;
        monitor.check()?;
        let items: Vec<&Item> = parts.iter().flat_map(|part| &part.items).collect();
        let reference = |i: usize| PrimitiveRef::new(&items[i].bounds.aabb(), i as u32);
        let refs = (0..items.len()).into_par_iter().with_min_len(1024).map(reference).collect();
        // Leaves room for a cluster's own node.
        let max_depth = MAX_DEPTH - 1;
        let monitor = monitor.silent();
        let tree = BinnedSah { bins, leaf_size: 1, max_depth, monitor }.build(refs)?;
        monitor.check()?;
        let (above, depth) = Above::new(&tree, &items, start)?;
        lines.resize(above.end(), bytemuck::Zeroable::zeroed());
        above.write_all(&mut lines);
        let bounds = tree.nodes[0].bounds;
        let area = above.area() + parts.iter().map(|part| part.area).sum::<f64>();
        let root = f64::from(bounds.half_area()).max(f64::MIN_POSITIVE);
        let shape = Shape {
            nodes: above.nodes() + parts.iter().map(|part| part.nodes).sum::<usize>(),
            leaves: parts.iter().map(|part| part.leaves).sum(),
            depth,
            sah_cost: (area / root) as f32,
        };
        Ok(Self::of_lines(lines, bounds, shape).with_nodes_above(start))
    }
}

/// The leaves of a cluster.
struct LeafEnds {
    /// Leaf `i` holds the keys from `ends[i]` to `ends[i + 1]`.
    ends: [u32; 9],
    count: usize,
}

impl LeafEnds {
    fn lines(&self) -> usize {
        if self.count > BARE_LEAVES {
            NODE_LINES + leaf_lines(self.count)
        } else {
            self.count * leaf_lines(1)
        }
    }
}

/// Divides a cluster into leaves: where codes differ in high bits, but not into too many.
fn leaf_ends(keys: &Keys, part: &[u32]) -> LeafEnds {
    let (mut first, end) = (part[0] as usize, part[1] as usize);
    let mut leaves = LeafEnds { ends: [first as u32; 9], count: 0 };
    while first < end {
        let left = end - first;
        let least = left.saturating_sub(BLOCK * (7 - leaves.count)).max(1);
        let mut size = left.min(BLOCK);
        if left > BLOCK {
            let mut most = 0;
            for own in least..=BLOCK {
                let differing = keys.code(first + own - 1) ^ keys.code(first + own);
                let score = differing.checked_ilog2().unwrap_or(0) + FULL_LEAF * own as u32;
                if score >= most {
                    (most, size) = (score, own);
                }
            }
        }
        first += size;
        leaves.count += 1;
        leaves.ends[leaves.count] = first as u32;
    }
    leaves
}

/// Writes clusters that start `at` lines from the start, given the lines from there.
fn write_clusters(
    keys: &Keys,
    task: &[u32],
    at: usize,
    mut lines: &mut [Line],
    mut leaves: CurveLeaves<'_>,
) -> Written {
    let mut written = Written { items: Vec::with_capacity(task.len()), ..Written::default() };
    let mut at = at;
    for part in task.windows(2) {
        let LeafEnds { ends, count } = leaf_ends(keys, part);
        let (own, others) = lines.split_at_mut(LeafEnds { ends, count }.lines());
        let size = own.len();
        written.leaves += count;
        let key_range = |leaf: usize| (ends[leaf] as usize, ends[leaf + 1] as usize);
        if count > BARE_LEAVES {
            let (node_lines, rest) = own.split_at_mut(NODE_LINES);
            let words: &mut [u32] = bytemuck::cast_slice_mut(rest);
            let mut node = Node8::EMPTY;
            let mut all = Bounds::EMPTY;
            let mut half_line = 2 * (at + NODE_LINES);
            for (leaf, words) in words.chunks_exact_mut(LEAF_WORDS).take(count).enumerate() {
                let (first, end) = key_range(leaf);
                let bounds = leaves.write(first, end, words);
                node.set(leaf, &bounds, Reference::leaf(half_line as u32));
                half_line += LEAF_WORDS / 8;
                all.grow(bounds.lower, bounds.upper);
                written.area += f64::from(bounds.half_area());
            }
            node_lines.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&node)));
            written.area += f64::from(all.half_area());
            written.nodes += 1;
            written.items.push(Item { bounds: all, reference: Reference::node(at as u32) });
        } else {
            for (leaf, lines) in own.chunks_exact_mut(leaf_lines(1)).enumerate() {
                let (first, end) = key_range(leaf);
                let words: &mut [u32] = bytemuck::cast_slice_mut(lines);
                let bounds = leaves.write(first, end, &mut words[..LEAF_WORDS]);
                written.area += f64::from(bounds.half_area());
                let half_line = 2 * (at + leaf * leaf_lines(1));
                written.items.push(Item { bounds, reference: Reference::leaf(half_line as u32) });
            }
        }
        at += size;
        lines = others;
    }
    written
}

impl<'a> Above<'a> {
    /// The nodes of a tree over items, which start at some line but for the root, and the depth with
    /// that of the clusters.
    pub(super) fn new(
        tree: &'a Bvh2,
        items: &'a [&'a Item],
        start: usize,
    ) -> Result<(Self, usize), BuildError> {
        let mut above = Self { tree, items, nodes: vec![], start };
        let depth = above.number(&Collapse::new(tree)?);
        Ok((above, depth))
    }

    /// How many they are, with the root.
    pub(super) fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// The line behind the last of them.
    pub(super) fn end(&self) -> usize {
        self.start + (self.nodes.len() - 1) * NODE_LINES
    }

    /// Writes all of them, given the lines of the whole tree.
    pub(super) fn write_all(&self, lines: &mut [Line]) {
        let (others, own) = lines.split_at_mut(self.start);
        self.write(0, &mut others[..NODE_LINES]);
        let own = own.par_chunks_exact_mut(NODE_LINES).with_min_len(256).enumerate();
        own.for_each(|(number, lines)| self.write(number + 1, lines));
    }

    /// Numbers all nodes level by level; returns the depth with that of the clusters.
    fn number(&mut self, collapse: &Collapse<'_>) -> usize {
        let mut level = vec![0];
        let (mut depth, mut next) = (0, 1);
        while !level.is_empty() {
            depth += 1;
            let mut below = vec![];
            let mut has_cluster = false;
            for root in level {
                let children = collapse.children(root);
                let inner = |&&child: &&u32| !self.tree.nodes[child as usize].is_leaf();
                let before = below.len();
                below.extend(children.as_slice().iter().filter(inner));
                has_cluster |= children
                    .as_slice()
                    .iter()
                    .any(|&child| self.item(child).is_some_and(|item| !item.reference.is_leaf()));
                self.nodes.push((children, next));
                next += (below.len() - before) as u32;
            }
            if below.is_empty() && has_cluster {
                depth += 1;
            }
            level = below;
        }
        depth
    }

    /// The item that a binary node stands for.
    fn item(&self, node: u32) -> Option<&Item> {
        let node = &self.tree.nodes[node as usize];
        node.is_leaf().then(|| self.items[self.tree.order[node.first as usize] as usize])
    }

    /// Writes a node.
    fn write(&self, number: usize, lines: &mut [Line]) {
        let &(ref children, mut next) = &self.nodes[number];
        let mut node = Node8::EMPTY;
        for (slot, &child) in children.as_slice().iter().enumerate() {
            if let Some(item) = self.item(child) {
                node.set(slot, &item.bounds, item.reference);
            } else {
                let bounds = &self.tree.nodes[child as usize].bounds;
                let bounds =
                    Bounds { lower: bounds.lower.extend(0.0), upper: bounds.upper.extend(0.0) };
                let line = self.start + (next as usize - 1) * NODE_LINES;
                node.set(slot, &bounds, Reference::node(line as u32));
                next += 1;
            }
        }
        lines.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&node)));
    }

    /// The areas of all nodes.
    pub(super) fn area(&self) -> f64 {
        let area = |node: usize| f64::from(self.tree.nodes[node].bounds.half_area());
        let inner = self.nodes.iter().flat_map(|(children, _)| children.as_slice());
        let inner = inner.map(|&child| child as usize).filter(|&c| !self.tree.nodes[c].is_leaf());
        area(0) + inner.map(area).sum::<f64>()
    }
}
