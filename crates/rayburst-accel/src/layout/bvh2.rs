//! The binary tree that every builder makes and every traced layout is made from.

use bytemuck::{Pod, Zeroable};
use rayburst_math::Aabb;

use super::arena::zeroed_vec;
use crate::BuildError;

/// A node: 32 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Node2 {
    /// The box around everything below.
    pub(crate) bounds: Aabb,
    /// Of an inner node, the first of its two children, which are neighbours; of a leaf, its first
    /// primitive in [`Bvh2::order`].
    pub(crate) first: u32,
    /// How many primitives a leaf holds; zero marks an inner node.
    pub(crate) count: u32,
}

impl Node2 {
    /// Room for nodes: zeros, whose memory is not touched yet.
    pub(crate) fn allocate(count: usize) -> Result<Vec<Self>, BuildError> {
        zeroed_vec(count, "the builder's nodes")
    }

    /// A leaf.
    #[inline(always)]
    pub(crate) fn leaf(bounds: Aabb, first: u32, count: usize) -> Self {
        Self { bounds, first, count: count as u32 }
    }

    /// An inner node.
    #[inline(always)]
    pub(crate) fn inner(bounds: Aabb, first: u32) -> Self {
        Self { bounds, first, count: 0 }
    }

    /// Whether it has no children.
    #[inline(always)]
    pub(crate) fn is_leaf(&self) -> bool {
        self.count != 0
    }
}

/// A binary tree; the first node is the root, and there is none if there are no primitives. Not all
/// nodes need be used.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh2 {
    pub(crate) nodes: Vec<Node2>,
    /// The primitives' indices, those of a leaf next to each other.
    pub(crate) order: Vec<u32>,
}
