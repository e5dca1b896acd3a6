//! The compressed 8-wide tree: made from a finished one, with the same children in the same slots.
//!
//! After Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs through compressed wide
//! BVHs", HPG 2017; [`QuantizedNode8`] says what differs. The root is at the start; what follows each
//! node is the region of its children, then the regions of its inner children, depth first.
//!
//! Boxes only grow: a lower plane is rounded to the last step that is not above it, an upper plane to
//! the first that is not below, both as the expansion computes them.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;
use rayburst_math::Aabb;
use rayburst_simd::{Boxes8, Isa, LEAF_WORDS, QuantizedNode8, Scalar, Triangles4, UNIT_WORDS};
use rayon::prelude::*;

use super::{
    arena::{allocate, zeroed_vec},
    bvh8::{Bvh8, Node8, Reference},
    triangles::{BLOCK, TriangleId},
};
use crate::BuildError;

/// Units of a node.
pub(crate) const NODE_UNITS: usize = 2;
const NODE_WORDS: usize = NODE_UNITS * UNIT_WORDS;
/// References count units in 29 bits.
const MAX_UNITS: usize = 1 << 29;
const LINE_WORDS: usize = 16;
/// How many levels from the root are worked on by several tasks.
const PARALLEL_LEVELS: usize = 3;

/// The tree in compressed form.
pub(crate) fn compress(tree: Bvh8) -> Result<Bvh8, BuildError> {
    let sizes = zeroed_vec(tree.extent() / 2, "the sizes of compressed nodes")?;
    let writer = Writer { tree: &tree, sizes };
    let units = NODE_UNITS + writer.plan(Reference::ROOT, 0);
    if units > MAX_UNITS {
        return Err(BuildError::TooMany {
            what: "units of 40 bytes",
            count: units,
            limit: MAX_UNITS,
        });
    }
    // The last leaf may be read as if it were the longest.
    let mut lines = allocate((units * UNIT_WORDS + LEAF_WORDS).div_ceil(LINE_WORDS))?;
    let words: &mut [u32] = bytemuck::cast_slice_mut(&mut lines);
    let (root, below) = words.split_at_mut(NODE_WORDS);
    let root_area = f64::from(tree.bounds.half_area()).max(f64::MIN_POSITIVE);
    let area = writer.write(Reference::ROOT, root, NODE_UNITS, below, 0);
    let mut shape = tree.shape;
    if !tree.bounds.is_empty() {
        shape.sah_cost = (1.0 + area / root_area) as f32;
    }
    Ok(Bvh8::of_units(lines, tree.bounds, shape))
}

/// A leaf reference's value: where it starts, and how many triangles are in it.
pub(crate) const fn leaf_value(unit: u32, count: u32) -> u32 {
    unit << 2 | (count - 1)
}

struct Writer<'a> {
    tree: &'a Bvh8,
    /// Units below each node, by its first line.
    sizes: Vec<AtomicU32>,
}

impl Writer<'_> {
    fn node(&self, reference: Reference) -> Node8 {
        self.tree.node(reference)
    }

    fn leaf(&self, leaf: Reference) -> Triangles4 {
        self.tree.block(leaf.value())
    }

    fn size(&self, node: Reference) -> &AtomicU32 {
        &self.sizes[node.value() as usize / 2]
    }

    /// Units of a child in its region.
    fn own_units(&self, child: Reference) -> usize {
        if child.is_leaf() {
            TriangleId::used_lanes(&self.leaf(child)) as usize
        } else {
            NODE_UNITS
        }
    }

    fn children(node: &Node8) -> impl Iterator<Item = (usize, Reference)> + use<> {
        node.children.into_iter().enumerate().filter(|&(_, child)| child != Reference::NONE)
    }

    /// Counts the units below a node, and notes them.
    fn plan(&self, reference: Reference, level: usize) -> usize {
        let node = self.node(reference);
        let inner = Self::children(&node).map(|(_, child)| child).filter(|c| !c.is_leaf());
        let below: usize = if level < PARALLEL_LEVELS {
            let inner: Vec<Reference> = inner.collect();
            inner.into_par_iter().map(|child| self.plan(child, level + 1)).sum()
        } else {
            inner.map(|child| self.plan(child, level + 1)).sum()
        };
        let region: usize = Self::children(&node).map(|(_, child)| self.own_units(child)).sum();
        let units = region + below;
        // More than fits is refused before anything is written.
        self.size(reference).store(u32::try_from(units).unwrap_or(u32::MAX), Ordering::Relaxed);
        units
    }

    /// Writes a node, and what is below it from unit `at` on; returns the area of all boxes written.
    fn write(
        &self,
        reference: Reference,
        own: &mut [u32],
        at: usize,
        below: &mut [u32],
        level: usize,
    ) -> f64 {
        let source = self.node(reference);
        let mut node = quantize(&source.boxes, &source.children);
        node.base = Reference::node_of_unit(at as u32).word();
        let region: usize = Self::children(&source).map(|(_, child)| self.own_units(child)).sum();
        let (mut region_words, mut rest) = below.split_at_mut(region * UNIT_WORDS);
        let (mut offset, mut next) = (0, at + region);
        let mut subtrees = Vec::with_capacity(8);
        for (slot, child) in Self::children(&source) {
            let units = self.own_units(child);
            let (words, others) = region_words.split_at_mut(units * UNIT_WORDS);
            region_words = others;
            node.children[slot] = if child.is_leaf() {
                write_leaf(&self.leaf(child), units, words);
                Reference::leaf(leaf_value(offset, units as u32)).word() as u8
            } else {
                let size = self.size(child).load(Ordering::Relaxed) as usize;
                let (below, others) = rest.split_at_mut(size * UNIT_WORDS);
                subtrees.push((child, words, next, below));
                rest = others;
                next += size;
                Reference::node_of_unit(offset).word() as u8
            };
            offset += units as u32;
        }
        own.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&node)));
        let (boxes, _) = Scalar.expand8(&node);
        let area: f64 = Self::children(&source).map(|(slot, _)| half_area(&boxes, slot)).sum();
        let below = |(child, own, at, below)| self.write(child, own, at, below, level + 1);
        if level < PARALLEL_LEVELS {
            // Added in this order whatever the threads.
            let areas: Vec<f64> = subtrees.into_par_iter().map(below).collect();
            area + areas.into_iter().sum::<f64>()
        } else {
            area + subtrees.into_iter().map(below).sum::<f64>()
        }
    }
}

fn half_area(boxes: &Boxes8, slot: usize) -> f64 {
    let planes = boxes.planes.map(|row| row[slot]);
    let bounds = Aabb {
        lower: Vec3::new(planes[0], planes[2], planes[4]),
        upper: Vec3::new(planes[1], planes[3], planes[5]),
    };
    f64::from(bounds.half_area())
}

/// The first triangles of a block as rows without gaps.
fn write_leaf(block: &Triangles4, count: usize, words: &mut [u32]) {
    let rows: &[[u32; BLOCK]; UNIT_WORDS] = bytemuck::cast_ref(block);
    for (row, words) in rows.iter().zip(words.chunks_exact_mut(count)) {
        words.copy_from_slice(&row[..count]);
    }
}

/// The boxes of a node in steps; where the children are remains to be filled in.
fn quantize(boxes: &Boxes8, children: &[Reference; 8]) -> QuantizedNode8 {
    let mut node = QuantizedNode8::EMPTY;
    let used = |slot: &usize| children[*slot] != Reference::NONE;
    for axis in 0..3 {
        let (lower, upper) = (&boxes.planes[2 * axis], &boxes.planes[2 * axis + 1]);
        let low = (0..8).filter(used).map(|slot| lower[slot]).fold(f32::INFINITY, f32::min);
        let high = (0..8).filter(used).map(|slot| upper[slot]).fold(f32::NEG_INFINITY, f32::max);
        if low > high {
            continue;
        }
        node.origin[axis] = low;
        node.exponents[axis] = exponent(low, high);
        let step = node.step(axis);
        // As expanded, and exactly, for kernels that never round the plane.
        let plane = |steps: u8| f32::from(steps) * step + low;
        let exact = |steps: u8| f64::from(steps) * f64::from(step) + f64::from(low);
        let below = |steps: u8, x: f32| plane(steps) <= x && exact(steps) <= f64::from(x);
        let above = |steps: u8, x: f32| plane(steps) >= x && exact(steps) >= f64::from(x);
        for slot in (0..8).filter(used) {
            let guess = |x: f32| if step > 0.0 { ((x - low) / step) as u8 } else { 0 };
            let mut first = guess(lower[slot]);
            while first > 0 && !below(first, lower[slot]) {
                first -= 1;
            }
            while first < u8::MAX && step > 0.0 && below(first + 1, lower[slot]) {
                first += 1;
            }
            let mut last = guess(upper[slot]);
            while last > 0 && step > 0.0 && above(last - 1, upper[slot]) {
                last -= 1;
            }
            while last < u8::MAX && step > 0.0 && !above(last, upper[slot]) {
                last += 1;
            }
            node.planes[2 * axis][slot] = first;
            node.planes[2 * axis + 1][slot] = last;
        }
    }
    node
}

/// The least exponent of a step at which 255 of them lead from `low` to `high` or beyond.
fn exponent(low: f32, high: f32) -> u8 {
    if low == high {
        return 0;
    }
    let reaches = |exponent: u8| {
        let step = f32::from_bits(u32::from(exponent) << 23);
        let exact = 255.0 * f64::from(step) + f64::from(low);
        255.0 * step + low >= high && exact >= f64::from(high)
    };
    let mut exponent = (((high - low) / 255.0).to_bits() >> 23).clamp(1, 253) as u8;
    while exponent > 1 && reaches(exponent - 1) {
        exponent -= 1;
    }
    while exponent < 254 && !reaches(exponent) {
        exponent += 1;
    }
    exponent
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_grow_by_less_than_a_step() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        for round in 0..4000 {
            let (offset, scale) = match round % 5 {
                0 => (0.0, 1.0),
                1 => (1e6, 1.0),
                2 => (-3e4, 1e-3),
                3 => (0.0, f32::MIN_POSITIVE),
                _ => (1e20, 1e25),
            };
            let (mut boxes, mut children) = (Boxes8::EMPTY, [Reference::NONE; 8]);
            for slot in (0..8).filter(|slot| *slot == 0 || round >> slot & 1 != 0) {
                children[slot] = Reference::ROOT;
                for axis in 0..3 {
                    let flat = round % 7 == axis;
                    let a = if flat { offset } else { offset + random() * scale };
                    let b = if flat { offset } else { offset + random() * scale };
                    boxes.planes[2 * axis][slot] = a.min(b);
                    boxes.planes[2 * axis + 1][slot] = a.max(b);
                }
            }
            let mut node = quantize(&boxes, &children);
            for slot in (0..8).filter(|&slot| children[slot] != Reference::NONE) {
                node.children[slot] = 0;
            }
            let (expanded, _) = Scalar.expand8(&node);
            for slot in (0..8).filter(|&slot| children[slot] != Reference::NONE) {
                for axis in 0..3 {
                    let of = |boxes: &Boxes8, side: usize| boxes.planes[2 * axis + side][slot];
                    let (low, high) = (of(&boxes, 0), of(&boxes, 1));
                    let step = node.step(axis) + f32::EPSILON * low.abs().max(high.abs());
                    assert!(of(&expanded, 0) <= low && low - of(&expanded, 0) <= step);
                    assert!(of(&expanded, 1) >= high && of(&expanded, 1) - high <= step);
                }
            }
        }
    }
}
