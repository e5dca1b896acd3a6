//! The 8-wide tree that is traced, and its making from a binary one.
//!
//! Wide nodes after Wald, Benthin, Boulos, "Getting rid of packets", 2008, and Dammertz, Hanika,
//! Keller, "Shallow bounding volume hierarchies", 2008; [`super::collapse`] says which binary nodes
//! become children.
//!
//! The children of a node are in the order in which a ray that looks for any hit should visit them: by the
//! share of leaves in the cost of a child (see [`Plan::share`]). Nearest hits do not depend on the order.
//! A simpler relative of the surface area traversal order of Nah, Manocha, "SATO: surface area traversal
//! order for shadow ray tracing", 2014.
//!
//! Layout, in cache lines of 64 bytes: a node of four lines, right after it the blocks of its leaves
//! (2½ lines each), then the subtrees of its inner children. A [`Reference`] counts half lines.
//! Sizes are counted before anything is written, so subtrees are written in parallel into their
//! final places.

use std::sync::atomic::{AtomicU32, Ordering};

use bytemuck::{Pod, Zeroable};
use rayburst_math::Aabb;
use rayburst_simd::{Boxes8, Scalar, Triangles4, UNIT_WORDS};
use rayon::prelude::*;

use super::{
    arena::{Line, allocate, zeroed_vec},
    bvh2::{Bvh2, Node2},
    collapse::{Children, Collapse},
    view::{BlockRoom, NodeRoom, TreeView},
};
use crate::BuildError;

/// A child: an inner node or a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Reference(u32);

impl Reference {
    /// What unused slots hold; their boxes keep rays away.
    pub(crate) const NONE: Self = Self(u32::MAX);
    /// The root, which is a node even if there is nothing below it.
    pub(crate) const ROOT: Self = Self(0);

    /// The reference as it is stored.
    pub(crate) const fn word(self) -> u32 {
        self.0
    }

    /// The reference that is stored as a word.
    pub(crate) const fn of_word(word: u32) -> Self {
        Self(word)
    }

    pub(crate) const fn node(line: u32) -> Self {
        Self(line << 2)
    }

    /// A node of a compressed tree.
    pub(crate) const fn node_of_unit(unit: u32) -> Self {
        Self(unit << 3)
    }

    pub(crate) const fn leaf(value: u32) -> Self {
        Self(value << 1 | 1)
    }

    /// Whether it is a leaf.
    #[inline(always)]
    pub(crate) const fn is_leaf(self) -> bool {
        self.0 & 1 != 0
    }

    /// What [`Leaves::place`] gave to a leaf; half lines from the start to a node. In a compressed tree
    /// four times the units from the start, to a leaf one less than its triangles more.
    #[inline(always)]
    pub(crate) const fn value(self) -> u32 {
        self.0 >> 1
    }
}

/// A node: 256 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Node8 {
    pub(crate) boxes: Boxes8,
    pub(crate) children: [Reference; 8],
    spare: [u32; 8],
}

pub(crate) const NODE_LINES: usize = size_of::<Node8>() / size_of::<Line>();

impl Node8 {
    /// A node without children.
    pub(crate) const EMPTY: Self =
        Self { boxes: Boxes8::EMPTY, children: [Reference::NONE; 8], spare: [0; 8] };

    /// The children as plain words.
    #[inline(always)]
    pub(crate) fn child_words(&self) -> &[u32; 8] {
        bytemuck::cast_ref(&self.children)
    }
}

/// How leaves are stored.
pub(crate) trait Leaves: Sync {
    /// Half lines that a leaf takes after its node.
    const HALF_LINES: usize;

    /// The value of the reference to a leaf of these primitives stored `half_line` half lines from
    /// the start.
    fn place(&self, primitives: &[u32], half_line: u32) -> u32;

    /// Writes the leaf.
    fn write(&self, primitives: &[u32], words: &mut [u32]);
}

/// The 8-wide tree, in one of two layouts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh8 {
    lines: Vec<Line>,
    /// Whether nodes and leaves are those of [`super::compressed`].
    compressed: bool,
    /// Where the nodes above clusters start, if there are any; see [`super::hlbvh8`].
    above: Option<usize>,
    /// Whether boxes may be larger than what is in them, after a refit of a few triangles.
    pub(crate) loose: bool,
    pub(crate) bounds: Aabb,
    pub(crate) shape: Shape,
}

/// What a tree consists of.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shape {
    pub(crate) nodes: usize,
    pub(crate) leaves: usize,
    pub(crate) depth: usize,
    /// Areas of all nodes and leaves in units of the root's.
    pub(crate) sah_cost: f32,
}

/// How many levels from the root are worked on by several tasks.
const PARALLEL_LEVELS: usize = 3;

impl Bvh8 {
    /// Makes the wide tree from a binary one.
    pub(crate) fn collapse<L: Leaves>(tree: &Bvh2, leaves: &L) -> Result<Self, BuildError> {
        if tree.nodes.is_empty() {
            let mut lines = allocate(NODE_LINES)?;
            let node =
                Node8 { boxes: Boxes8::EMPTY, children: [Reference::NONE; 8], spare: [0; 8] };
            lines.copy_from_slice(bytemuck::cast_slice(&[node]));
            let shape = Shape { nodes: 1, depth: 1, ..Shape::default() };
            return Ok(Self::of_lines(lines, Aabb::EMPTY, shape));
        }
        let sizes = zeroed_vec(tree.nodes.len(), "the sizes of wide nodes")?;
        let shares = zeroed_vec(tree.nodes.len(), "the order of children")?;
        let writer = Writer { tree, collapse: Collapse::new(tree)?, leaves, sizes, shares };
        let bounds = tree.nodes[0].bounds;
        let plan = writer.plan(0, 0);
        let mut lines = allocate(plan.lines)?;
        writer.write(0, 0, &mut lines, 0);
        let sah_cost = plan.area / f64::from(bounds.half_area()).max(f64::MIN_POSITIVE);
        let shape = Shape { sah_cost: sah_cost as f32, ..plan.shape };
        Ok(Self::of_lines(lines, bounds, shape))
    }

    /// A tree that was written elsewhere; its root is at the start.
    pub(crate) fn of_lines(lines: Vec<Line>, bounds: Aabb, shape: Shape) -> Self {
        Self { lines, compressed: false, above: None, loose: false, bounds, shape }
    }

    /// A compressed tree.
    pub(crate) fn of_units(lines: Vec<Line>, bounds: Aabb, shape: Shape) -> Self {
        Self { lines, compressed: true, above: None, loose: false, bounds, shape }
    }

    /// The same with nodes above clusters from some line on.
    pub(crate) fn with_nodes_above(self, line: usize) -> Self {
        Self { above: Some(line), ..self }
    }

    /// Its memory, for refitting, and where the nodes above clusters start.
    pub(crate) fn lines_mut(&mut self) -> (&mut [Line], Option<usize>) {
        (&mut self.lines, self.above)
    }

    /// Bytes taken.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.lines.as_slice())
    }

    /// Every word of it.
    #[cfg(test)]
    pub(crate) fn words(&self) -> &[u32] {
        bytemuck::cast_slice(&self.lines)
    }

    /// References that wait at most while one below is visited: all siblings on every level.
    #[inline(always)]
    pub(crate) fn stack_entries(&self) -> usize {
        7 * self.shape.depth
    }

    /// Whether nodes and leaves are those of [`super::compressed`].
    pub(crate) fn is_compressed(&self) -> bool {
        self.compressed
    }

    /// Half lines in all; units if it is compressed.
    pub(crate) fn extent(&self) -> usize {
        if self.compressed { self.bytes() / (4 * UNIT_WORDS) } else { self.lines.len() * 2 }
    }

    /// What traversal sees.
    #[inline(always)]
    pub(crate) fn view(&self) -> TreeView {
        TreeView::new(self.lines.as_ptr().cast(), self.compressed)
    }

    /// An inner node as one of four lines.
    pub(crate) fn node(&self, reference: Reference) -> Node8 {
        debug_assert!(!reference.is_leaf());
        let mut room = NodeRoom::new();
        // SAFETY: references to inner nodes come only from writers of trees.
        let (boxes, words) = unsafe { self.view().node(Scalar, reference, &mut room) };
        let mut node = Node8 { boxes: *boxes, children: bytemuck::cast(*words), spare: [0; 8] };
        for slot in 0..8 {
            // An empty slot of a compressed node is empty along one axis only.
            if node.boxes.planes[0][slot] > node.boxes.planes[1][slot] {
                for (row, empty) in node.boxes.planes.iter_mut().zip(Boxes8::EMPTY.planes) {
                    row[slot] = empty[slot];
                }
                if self.compressed {
                    node.children[slot] = Reference::NONE;
                }
            }
        }
        node
    }

    /// The triangles of a leaf of a BLAS.
    pub(crate) fn block(&self, value: u32) -> Triangles4 {
        let mut room = BlockRoom::new();
        // SAFETY: callers take values from the leaves of the tree.
        *unsafe { self.view().leaf(value) }.block(Scalar, &mut room)
    }
}

impl Bvh8 {
    /// Calls a function with the value of every leaf.
    pub(crate) fn for_each_leaf(&self, mut leaf: impl FnMut(u32)) {
        let mut stack = vec![Reference::ROOT];
        while let Some(reference) = stack.pop() {
            for child in self.node(reference).children {
                if child.is_leaf() && child != Reference::NONE {
                    leaf(child.value());
                } else if child != Reference::NONE {
                    stack.push(child);
                }
            }
        }
    }
}

/// What a subtree needs and consists of.
struct Plan {
    lines: usize,
    /// Of all nodes and leaves.
    area: f64,
    /// Of all leaves.
    leaf_area: f64,
    shape: Shape,
}

impl Plan {
    /// The leaves that a random ray visits, in parts of all that it visits: what finds hits in parts of
    /// what it costs.
    fn share(&self) -> f32 {
        let share = (self.leaf_area / self.area) as f32;
        if share.is_nan() { LEAF_SHARE } else { share }
    }
}

/// The share of a leaf.
const LEAF_SHARE: f32 = 1.0;

struct Writer<'a, L> {
    tree: &'a Bvh2,
    collapse: Collapse<'a>,
    leaves: &'a L,
    /// Lines of the subtree of each binary node that becomes the root of a wide one.
    sizes: Vec<AtomicU32>,
    /// The share of each of these, as the bits of a number.
    shares: Vec<AtomicU32>,
}

impl<L: Leaves> Writer<'_, L> {
    fn node(&self, index: u32) -> &Node2 {
        &self.tree.nodes[index as usize]
    }

    fn primitives(&self, node: &Node2) -> &[u32] {
        &self.tree.order[node.first as usize..][..node.count as usize]
    }

    fn children(&self, root: u32) -> Children {
        self.collapse.children(root)
    }

    /// The share of a child, once it is planned.
    fn share(&self, child: u32) -> f32 {
        if self.node(child).is_leaf() {
            return LEAF_SHARE;
        }
        f32::from_bits(self.shares[child as usize].load(Ordering::Relaxed))
    }

    fn leaf_lines(leaves: usize) -> usize {
        (leaves * L::HALF_LINES).div_ceil(2)
    }

    /// Counts what the subtree of a wide node needs, and notes its lines.
    fn plan(&self, root: u32, level: usize) -> Plan {
        let children = self.children(root);
        let inner: Vec<u32> =
            children.as_slice().iter().copied().filter(|&c| !self.node(c).is_leaf()).collect();
        let leaves = children.as_slice().len() - inner.len();
        let plans: Vec<Plan> = if level < PARALLEL_LEVELS {
            inner.par_iter().map(|&child| self.plan(child, level + 1)).collect()
        } else {
            inner.iter().map(|&child| self.plan(child, level + 1)).collect()
        };
        let leaf_area = |&child: &u32| {
            let node = self.node(child);
            if node.is_leaf() { f64::from(node.bounds.half_area()) } else { 0.0 }
        };
        let leaf_area = children.as_slice().iter().map(leaf_area).sum::<f64>();
        let area = f64::from(self.node(root).bounds.half_area()) + leaf_area;
        let shape = Shape { nodes: 1, leaves, depth: 1, sah_cost: 0.0 };
        let lines = NODE_LINES + Self::leaf_lines(leaves);
        let own = Plan { lines, area, leaf_area, shape };
        let plan = plans.iter().fold(own, |sum, plan| Plan {
            lines: sum.lines + plan.lines,
            area: sum.area + plan.area,
            leaf_area: sum.leaf_area + plan.leaf_area,
            shape: Shape {
                nodes: sum.shape.nodes + plan.shape.nodes,
                leaves: sum.shape.leaves + plan.shape.leaves,
                depth: sum.shape.depth.max(plan.shape.depth + 1),
                sah_cost: 0.0,
            },
        });
        // More than fits is refused before anything is written.
        let lines = u32::try_from(plan.lines).unwrap_or(u32::MAX);
        self.sizes[root as usize].store(lines, Ordering::Relaxed);
        self.shares[root as usize].store(plan.share().to_bits(), Ordering::Relaxed);
        plan
    }

    /// Writes the subtree of a wide node, whose lines start `at` lines from the start.
    fn write(&self, root: u32, at: usize, lines: &mut [Line], level: usize) {
        let mut children = self.children(root);
        children.as_mut_slice().sort_by(|&a, &b| self.share(b).total_cmp(&self.share(a)));
        let leaves = children.as_slice().iter().filter(|&&c| self.node(c).is_leaf()).count();
        let (node_lines, rest) = lines.split_at_mut(NODE_LINES);
        let (leaf_lines, mut rest) = rest.split_at_mut(Self::leaf_lines(leaves));
        let leaf_words: &mut [u32] = bytemuck::cast_slice_mut(leaf_lines);

        let mut node =
            Node8 { boxes: Boxes8::EMPTY, children: [Reference::NONE; 8], spare: [0; 8] };
        let mut half_line = 2 * (at + NODE_LINES);
        let mut child_at = at + NODE_LINES + Self::leaf_lines(leaves);
        let mut words = leaf_words;
        let mut subtrees = Vec::with_capacity(8);
        for (slot, &child) in children.as_slice().iter().enumerate() {
            let source = self.node(child);
            for axis in 0..3 {
                node.boxes.planes[2 * axis][slot] = source.bounds.lower[axis];
                node.boxes.planes[2 * axis + 1][slot] = source.bounds.upper[axis];
            }
            if source.is_leaf() {
                let primitives = self.primitives(source);
                let value = self.leaves.place(primitives, half_line as u32);
                node.children[slot] = Reference::leaf(value);
                let (own, others) = words.split_at_mut(8 * L::HALF_LINES);
                self.leaves.write(primitives, own);
                words = others;
                half_line += L::HALF_LINES;
            } else {
                let size = self.sizes[child as usize].load(Ordering::Relaxed) as usize;
                let (own, others) = rest.split_at_mut(size);
                node.children[slot] = Reference::node(child_at as u32);
                subtrees.push((child, child_at, own));
                rest = others;
                child_at += size;
            }
        }
        node_lines.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&node)));
        if level < PARALLEL_LEVELS {
            subtrees
                .into_par_iter()
                .for_each(|(child, at, lines)| self.write(child, at, lines, level + 1));
        } else {
            for (child, at, lines) in subtrees {
                self.write(child, at, lines, level + 1);
            }
        }
    }
}

/// A way to break a tree.
#[cfg(test)]
type Defect = fn(&mut Bvh8);

/// Ways to break a tree of several levels, for the tests of validation.
#[cfg(test)]
pub(crate) fn defects() -> Vec<(&'static str, Defect)> {
    fn root(tree: &mut Bvh8) -> &mut Node8 {
        &mut bytemuck::cast_slice_mut(&mut tree.lines[..NODE_LINES])[0]
    }
    fn last_words(tree: &mut Bvh8) -> &mut [u32] {
        // The last line but one holds the end of a leaf's block, or its padding's neighbour.
        let lines = tree.lines.len();
        bytemuck::cast_slice_mut(&mut tree.lines[lines - 5..])
    }
    vec![
        ("a box too small", |tree| root(tree).boxes.planes[1][0] -= 0.5),
        ("a lower bound too large", |tree| root(tree).boxes.planes[4][1] += 0.5),
        ("a NaN plane", |tree| root(tree).boxes.planes[0][0] = f32::NAN),
        ("a child twice", |tree| root(tree).children[0] = root(tree).children[1]),
        ("a loop", |tree| root(tree).children[0] = Reference::ROOT),
        ("a child outside", |tree| root(tree).children[2] = Reference(1 << 30)),
        ("a leaf outside", |tree| root(tree).children[2] = Reference(1 << 30 | 1)),
        ("a lost child", |tree| root(tree).children[3] = Reference::NONE),
        ("other triangles", |tree| last_words(tree).fill(0)),
        ("bounds too small", |tree| tree.bounds.upper.x -= 0.5),
    ]
}
