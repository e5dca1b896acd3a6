//! All boxes of a tree anew.
//!
//! The memory of a subtree is contiguous, so subtrees are refitted in parallel; sums are added in the
//! order of the tree, whatever the threads. One task first walks its nodes in the order of the
//! memory, then writes its leaves ([`super::leaves`]), then its nodes in reverse order, children before
//! parents. Of trees whose nodes above clusters are apart, first the clusters are refitted, then the
//! nodes above in reverse order.

use glam::{BVec4A, Mat4, Vec4};
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use super::{
    leaves::{Job, Source},
    node_mut,
};
use crate::layout::{
    arena::Line,
    bvh8::{Bvh8, NODE_LINES, Node8, Reference},
    curve_leaves::Bounds,
};

/// Subtrees of fewer lines are refitted by one task.
const TASK_LINES: usize = 1 << 11;
/// How many lines ahead of a task's walk memory is asked for.
const AHEAD: usize = 128;
/// Clusters that are refitted by one task.
const CLUSTERS: usize = 256;

/// What a refit adds up.
#[derive(Default)]
pub(super) struct Done {
    /// Of all nodes and leaves.
    pub(super) area: f64,
    pub(super) changed: usize,
    /// Lanes whose triangle cannot be hit.
    pub(super) hidden: usize,
}

impl Done {
    fn add(&mut self, other: &Self) {
        self.area += other.area;
        self.changed += other.changed;
        self.hidden += other.hidden;
    }
}

/// A node to be written.
struct NodeJob {
    line: u32,
    /// Which box is its.
    slot: u32,
}

/// A refit of all.
#[derive(Clone, Copy)]
pub(super) struct Whole<'a> {
    pub(super) source: Source<'a>,
    pub(super) isa: IsaLevel,
}

impl Whole<'_> {
    /// Refits a tree; returns the box around all.
    pub(super) fn refit(&self, tree: &mut Bvh8) -> (Bounds, Done) {
        let (bounds, mut done) = match tree.lines_mut() {
            (lines, None) => self.subtree(lines, 0),
            (lines, Some(above)) => self.clusters(lines, above),
        };
        done.area += half_area(&bounds);
        (bounds, done)
    }

    /// Refits the subtree of a node that starts `at` lines from the start of the structure, given its
    /// lines.
    fn subtree(&self, lines: &mut [Line], at: usize) -> (Bounds, Done) {
        if lines.len() <= TASK_LINES {
            let (boxes, done) = self.task(&[Reference::node(at as u32)], at, lines);
            return (boxes[0], done);
        }
        let node: Node8 = bytemuck::cast_slice(&lines[..NODE_LINES])[0];
        let mut inner: Vec<(usize, usize)> = (0..8)
            .filter(|&slot| {
                node.children[slot] != Reference::NONE && !node.children[slot].is_leaf()
            })
            .map(|slot| (line_of(node.children[slot]), slot))
            .collect();
        inner.sort_unstable();
        let mut rest = lines;
        let mut subtrees = Vec::with_capacity(inner.len());
        for &(start, slot) in inner.iter().rev() {
            let (before, own) = rest.split_at_mut(start - at);
            subtrees.push((slot, start, own));
            rest = before;
        }
        let results: Vec<(usize, (Bounds, Done))> = subtrees
            .into_par_iter()
            .rev()
            .map(|(slot, start, lines)| (slot, self.subtree(lines, start)))
            .collect();
        let own = rest;
        let slots: Vec<usize> = (0..8)
            .filter(|&slot| node.children[slot] != Reference::NONE && node.children[slot].is_leaf())
            .collect();
        let leaves: Vec<Reference> = slots.iter().map(|&slot| node.children[slot]).collect();
        let (leaf_boxes, mut done) = self.task(&leaves, at, own);
        let mut boxes = [Bounds::EMPTY; 8];
        for (slot, bounds) in slots.into_iter().zip(leaf_boxes) {
            boxes[slot] = bounds;
        }
        for (slot, (bounds, below)) in results {
            done.add(&below);
            boxes[slot] = bounds;
        }
        let bounds = set_boxes(node_mut(own, 0), &boxes, &mut done);
        (bounds, done)
    }

    /// Refits all clusters, then all nodes above, which start at some line, parents first.
    fn clusters(&self, lines: &mut [Line], above: usize) -> (Bounds, Done) {
        let (others, own) = lines.split_at_mut(above);
        let (root, clusters) = others.split_at_mut(NODE_LINES);
        let nodes: &mut [Node8] = bytemuck::cast_slice_mut(own);
        let root: &mut Node8 = node_mut(root, 0);
        let is_item = |child: Reference| child != Reference::NONE && line_of(child) < above;
        // Clusters in the order of the memory; the root counts as the last node.
        let mut items: Vec<(Reference, u32)> = Vec::new();
        for (number, node) in nodes.iter().chain(std::iter::once(&*root)).enumerate() {
            let children = node.children.into_iter().zip(8 * number as u32..);
            items.extend(children.filter(|&(child, _)| is_item(child)));
        }
        items.par_sort_unstable_by_key(|&(child, _)| child.value());
        let mut tasks = Vec::with_capacity(items.len() / CLUSTERS + 1);
        let mut rest = clusters;
        for items in items.chunks(CLUSTERS).rev() {
            let first = line_of(items[0].0);
            let (before, own) = rest.split_at_mut(first - NODE_LINES);
            tasks.push((items, first, own));
            rest = before;
        }
        let results: Vec<(Vec<Bounds>, Done)> = tasks
            .into_par_iter()
            .map(|(items, first, lines)| {
                let roots: Vec<Reference> = items.iter().map(|&(child, _)| child).collect();
                self.task(&roots, first, lines)
            })
            .collect();
        let count = nodes.len();
        let mut done = Done::default();
        let mut boxes = vec![[Bounds::EMPTY; 8]; count + 1];
        for (items, (bounds, result)) in items.chunks(CLUSTERS).rev().zip(results) {
            done.add(&result);
            for (&(_, slot), bounds) in items.iter().zip(bounds) {
                boxes[slot as usize / 8][slot as usize % 8] = bounds;
            }
        }
        let mut of_nodes = vec![Bounds::EMPTY; count];
        let mut all = Bounds::EMPTY;
        for (number, node) in
            nodes.iter_mut().enumerate().rev().chain(std::iter::once((count, root)))
        {
            for (slot, child) in node.children.into_iter().enumerate() {
                if child != Reference::NONE && !is_item(child) {
                    boxes[number][slot] = of_nodes[(line_of(child) - above) / NODE_LINES];
                }
            }
            all = set_boxes(node, &boxes[number], &mut done);
            if let Some(own) = of_nodes.get_mut(number) {
                *own = all;
            }
        }
        (all, done)
    }

    /// Refits all below some children, given the lines from some line on; their boxes come first in
    /// what is returned, in their order. Their areas are not added.
    fn task(&self, roots: &[Reference], first: usize, lines: &mut [Line]) -> (Vec<Bounds>, Done) {
        self.isa.dispatch(Task { source: self.source, roots, first, lines })
    }
}

/// The refit of all below some children as a kernel.
struct Task<'a> {
    source: Source<'a>,
    roots: &'a [Reference],
    /// Where the lines start.
    first: usize,
    lines: &'a mut [Line],
}

impl Kernel for Task<'_> {
    type Output = (Vec<Bounds>, Done);

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let Self { source, roots, first, lines } = self;
        let (nodes, leaves, slots) = walk(isa, roots, first, lines);
        // A box for each root, then eight a node.
        let mut boxes = vec![Bounds::EMPTY; slots];
        let hidden = source.write(isa, &leaves, first, lines, &mut boxes);
        let mut done = Done { hidden, ..Done::default() };
        for (number, job) in nodes.iter().enumerate().rev() {
            let node = node_mut(lines, job.line as usize - first);
            if let Some(below) = boxes[roots.len() + 8 * number..].first_chunk() {
                boxes[job.slot as usize] = set_boxes(node, below, &mut done);
            }
        }
        (boxes, done)
    }
}

/// The nodes and leaves below some children, parents first, and how many boxes they have.
#[inline(always)]
fn walk<I: Isa>(
    isa: I,
    roots: &[Reference],
    first: usize,
    lines: &[Line],
) -> (Vec<NodeJob>, Vec<Job>, usize) {
    let mut slots = roots.len() as u32;
    let mut nodes = Vec::with_capacity(lines.len() / 8);
    let mut leaves = Vec::with_capacity(lines.len() / 2);
    let mut stack: Vec<(Reference, u32)> = Vec::with_capacity(64);
    let mut asked = 0;
    for (root, slot) in roots.iter().zip(0..) {
        stack.push((*root, slot));
        while let Some((child, slot)) = stack.pop() {
            let line = line_of(child) - first;
            while asked < (line + AHEAD).min(lines.len()) {
                isa.prefetch(&raw const lines[asked]);
                asked += 1;
            }
            if child.is_leaf() {
                leaves.push(Job { half_line: child.value(), slot });
                continue;
            }
            nodes.push(NodeJob { line: line_of(child) as u32, slot });
            let node: &Node8 = &bytemuck::cast_slice(&lines[line..line + NODE_LINES])[0];
            for slot in 0..8 {
                let child = node.children[slot];
                if child != Reference::NONE && child.is_leaf() {
                    leaves.push(Job { half_line: child.value(), slot: slots + slot as u32 });
                }
            }
            for slot in (0..8).rev() {
                if !node.children[slot].is_leaf() {
                    stack.push((node.children[slot], slots + slot as u32));
                }
            }
            slots += 8;
        }
    }
    (nodes, leaves, slots as usize)
}

/// The line where a child starts.
fn line_of(child: Reference) -> usize {
    (child.value() / 2) as usize
}

/// Half the area of a box; zero if it is empty.
fn half_area(bounds: &Bounds) -> f64 {
    if bounds.is_empty() { 0.0 } else { f64::from(bounds.half_area()) }
}

/// Sets the boxes of all children, adds their areas and returns the box around them.
#[inline(always)]
fn set_boxes(node: &mut Node8, boxes: &[Bounds; 8], done: &mut Done) -> Bounds {
    let mut all = Bounds::EMPTY;
    let [first @ .., _, _, _, _] = *boxes;
    let [_, _, _, _, last @ ..] = *boxes;
    for half in 0..2 {
        let [a, b, c, d] = if half == 0 { first } else { last };
        for child in [a, b, c, d] {
            all.grow(child.lower, child.upper);
        }
        let lower = Mat4::from_cols(a.lower, b.lower, c.lower, d.lower).transpose();
        let upper = Mat4::from_cols(a.upper, b.upper, c.upper, d.upper).transpose();
        let lower = [lower.x_axis, lower.y_axis, lower.z_axis];
        let upper = [upper.x_axis, upper.y_axis, upper.z_axis];
        let mut changed = BVec4A::FALSE;
        for axis in 0..3 {
            for (row, new) in [(2 * axis, lower[axis]), (2 * axis + 1, upper[axis])] {
                let old = &mut node.boxes.planes[row][4 * half..4 * half + 4];
                changed |= new.cmpne(Vec4::from_slice(old));
                new.write_to_slice(old);
            }
        }
        done.changed += changed.bitmask().count_ones() as usize;
        // Empty boxes have negative edges.
        let x = (upper[0] - lower[0]).max(Vec4::ZERO);
        let y = (upper[1] - lower[1]).max(Vec4::ZERO);
        let z = (upper[2] - lower[2]).max(Vec4::ZERO);
        let areas = (x * y + y * z + z * x).as_dvec4();
        done.area += (areas.x + areas.y) + (areas.z + areas.w);
    }
    all
}
