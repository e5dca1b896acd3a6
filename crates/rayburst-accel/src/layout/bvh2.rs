//! The binary tree that every builder makes and every traced layout is made from.

use rayburst_math::Aabb;

/// A node: 32 bytes.
#[derive(Clone, Copy, Debug)]
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
    /// Whether it has no children.
    #[inline(always)]
    pub(crate) fn is_leaf(&self) -> bool {
        self.count != 0
    }
}

/// A binary tree; the first node is the root, and there is none if there are no primitives.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh2 {
    pub(crate) nodes: Vec<Node2>,
    /// The primitives' indices, those of a leaf next to each other.
    pub(crate) order: Vec<u32>,
}
