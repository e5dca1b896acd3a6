//! How traversal sees a tree, whichever layout it has.
//!
//! One set of kernels serves both layouts: which one it is never changes in the course of a batch over
//! one BLAS, so the branches here are predicted.

use std::mem::MaybeUninit;

use rayburst_simd::{
    Boxes8, Isa, LEAF_WORDS, Nearest, QuantizedNode8, ShearRay, SlabRay, TriangleHits,
    TriangleRows, Triangles4, UNIT_WORDS, along, corners_along,
};

use super::{
    bvh8::{Node8, Reference},
    triangles::TriangleId,
};
use crate::traverse::prepare::Span;

/// Bytes in which values of references count in a wide tree.
const HALF_LINE: usize = 32;
/// Bytes of a unit of a compressed one.
const UNIT: usize = 4 * UNIT_WORDS;

/// The memory of a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TreeView {
    start: *const u8,
    compressed: bool,
}

/// Where a compressed node is expanded.
pub(crate) struct NodeRoom(MaybeUninit<(Boxes8, [u32; 8])>);

/// Where a compressed leaf is expanded.
pub(crate) struct BlockRoom(MaybeUninit<Triangles4>);

impl NodeRoom {
    #[inline(always)]
    pub(crate) const fn new() -> Self {
        Self(MaybeUninit::uninit())
    }
}

impl BlockRoom {
    #[inline(always)]
    pub(crate) const fn new() -> Self {
        Self(MaybeUninit::uninit())
    }
}

impl TreeView {
    /// The tree whose memory starts there.
    #[inline(always)]
    pub(crate) const fn new(start: *const u8, compressed: bool) -> Self {
        Self { start, compressed }
    }

    #[inline(always)]
    fn of_value(self, value: u32) -> *const u8 {
        let bytes =
            if self.compressed { (value >> 2) as usize * UNIT } else { value as usize * HALF_LINE };
        self.start.wrapping_add(bytes)
    }

    /// Asks for the memory of a node or leaf, which need not exist.
    #[inline(always)]
    pub(crate) fn prefetch<I: Isa>(self, isa: I, reference: Reference) {
        let address = self.of_value(reference.value());
        isa.prefetch(address);
        isa.prefetch(address.wrapping_add(64));
        isa.prefetch(address.wrapping_add(128));
        if !self.compressed {
            isa.prefetch(address.wrapping_add(192));
        }
    }

    /// # Safety
    /// The tree must be wide, and the reference that of an inner node of it.
    #[inline(always)]
    unsafe fn wide<'a>(self, reference: Reference) -> &'a Node8 {
        let address = self.of_value(reference.value()).cast::<Node8>();
        debug_assert!(!self.compressed && address.is_aligned());
        // SAFETY: writers put a node of four lines there; every bit pattern is one.
        unsafe { &*address }
    }

    /// # Safety
    /// The tree must be compressed, and the reference that of an inner node of it.
    #[inline(always)]
    unsafe fn quantized<'a>(self, reference: Reference) -> &'a QuantizedNode8 {
        let address = self.of_value(reference.value()).cast::<QuantizedNode8>();
        debug_assert!(self.compressed && address.is_aligned());
        // SAFETY: writers put a compressed node there; every bit pattern is one.
        unsafe { &*address }
    }

    /// The boxes of a node's children, and their references as words.
    ///
    /// # Safety
    /// The reference must be that of an inner node of the tree, which must live as long as the result.
    #[inline(always)]
    pub(crate) unsafe fn node<I: Isa>(
        self,
        isa: I,
        reference: Reference,
        room: &mut NodeRoom,
    ) -> (&Boxes8, &[u32; 8]) {
        // SAFETY: the caller's promise.
        unsafe {
            if self.compressed {
                let (boxes, children) = room.0.write(isa.expand8(self.quantized(reference)));
                (boxes, children)
            } else {
                let node = self.wide(reference);
                (&node.boxes, node.child_words())
            }
        }
    }

    /// The child in a slot of a node, less than eight.
    ///
    /// # Safety
    /// The reference must be that of an inner node of the tree.
    #[inline(always)]
    pub(crate) unsafe fn child(self, node: Reference, slot: u32) -> Reference {
        let slot = slot as usize % 8;
        // SAFETY: the caller's promise.
        unsafe {
            if self.compressed {
                let node = self.quantized(node);
                Reference::of_word(node.base.wrapping_add(u32::from(node.children[slot])))
            } else {
                self.wide(node).children[slot]
            }
        }
    }

    /// [`Isa::slab8`] of a node.
    ///
    /// # Safety
    /// The reference must be that of an inner node of the tree.
    #[inline(always)]
    pub(crate) unsafe fn slab8<I: Isa>(
        self,
        isa: I,
        node: Reference,
        ray: &SlabRay,
        span: &Span,
        distances: &mut [f32; 8],
    ) -> u32 {
        let (t_min, t_max) = (span.t_min, span.t_max);
        // SAFETY: the caller's promise.
        unsafe {
            if self.compressed {
                isa.quantized_slab8(self.quantized(node), ray, t_min, t_max, distances)
            } else {
                isa.slab8(&self.wide(node).boxes, ray, t_min, t_max, distances)
            }
        }
    }

    /// Whether trees have the same layout.
    #[inline(always)]
    pub(crate) fn is_like(self, other: Self) -> bool {
        self.compressed == other.compressed
    }

    /// [`Isa::sorted8`] of nodes of trees of one layout; spans are of `t_min` and `t_max`.
    ///
    /// # Safety
    /// The references must be those of inner nodes of the trees.
    #[inline(always)]
    pub(crate) unsafe fn sorted8<I: Isa, const N: usize>(
        isa: I,
        trees: [Self; N],
        nodes: [Reference; N],
        rays: [&SlabRay; N],
        spans: [[f32; 2]; N],
        keys: [&mut [u32; 8]; N],
        found: [&mut [u32; 8]; N],
    ) -> [usize; N] {
        // SAFETY: the caller's promise.
        unsafe {
            if trees[0].compressed {
                let mut all = [trees[0].quantized(nodes[0]); N];
                let mut i = 1;
                while i < N {
                    all[i] = trees[i].quantized(nodes[i]);
                    i += 1;
                }
                isa.quantized_sorted8(all, rays, spans, keys, found)
            } else {
                let first = trees[0].wide(nodes[0]);
                let mut all = [(&first.boxes, first.child_words()); N];
                let mut i = 1;
                while i < N {
                    let node = trees[i].wide(nodes[i]);
                    all[i] = (&node.boxes, node.child_words());
                    i += 1;
                }
                isa.sorted8(all, rays, spans, keys, found)
            }
        }
    }

    /// [`Isa::met8`] of a node.
    ///
    /// # Safety
    /// The reference must be that of an inner node of the tree.
    #[inline(always)]
    pub(crate) unsafe fn met8<I: Isa>(
        self,
        isa: I,
        node: Reference,
        ray: &SlabRay,
        span: &Span,
        others: &mut [u32; 8],
    ) -> (usize, u32) {
        let (t_min, t_max) = (span.t_min, span.t_max);
        // SAFETY: the caller's promise.
        unsafe {
            if self.compressed {
                isa.quantized_met8(self.quantized(node), ray, t_min, t_max, others)
            } else {
                let node = self.wide(node);
                isa.met8((&node.boxes, node.child_words()), ray, t_min, t_max, others)
            }
        }
    }

    /// The block of a leaf of a BLAS, if the tree is a wide one.
    ///
    /// # Safety
    /// As for [`TreeView::leaf`].
    #[inline(always)]
    pub(crate) unsafe fn block<'a>(self, value: u32) -> Option<&'a Triangles4> {
        // SAFETY: the caller's promise.
        match unsafe { self.leaf(value) } {
            Leaf::Block(block) => Some(block),
            Leaf::Rows(_) => None,
        }
    }

    /// The triangles of a leaf of a BLAS.
    ///
    /// # Safety
    /// The value must be that of a leaf of the tree, which must live as long as the result.
    #[inline(always)]
    pub(crate) unsafe fn leaf<'a>(self, value: u32) -> Leaf<'a> {
        let address = self.of_value(value);
        if self.compressed {
            debug_assert!(address.cast::<u32>().is_aligned());
            // SAFETY: writers put the leaf there, and left room for the longest one behind the last.
            let words = unsafe { &*address.cast::<[u32; LEAF_WORDS]>() };
            Leaf::Rows(TriangleRows::new(words, (value & 3) as usize + 1))
        } else {
            debug_assert!(address.cast::<Triangles4>().is_aligned());
            // SAFETY: writers put a block there; every bit pattern is one.
            Leaf::Block(unsafe { &*address.cast::<Triangles4>() })
        }
    }
}

/// The triangles of a leaf, in either layout.
#[derive(Clone, Copy)]
pub(crate) enum Leaf<'a> {
    /// Of the wide one.
    Block(&'a Triangles4),
    /// Of the compressed one.
    Rows(TriangleRows<'a>),
}

impl<'a> Leaf<'a> {
    /// [`Isa::triangles4`].
    #[inline(always)]
    pub(crate) fn triangles4<I: Isa>(
        self,
        isa: I,
        ray: &ShearRay,
        span: &Span,
        hits: &mut TriangleHits,
    ) -> u32 {
        match self {
            Self::Block(block) => isa.triangles4(block, ray, span.t_min, span.t_max, hits),
            Self::Rows(rows) => isa.rows_triangles4(rows, ray, span.t_min, span.t_max, hits),
        }
    }

    /// [`Isa::nearest4`].
    #[inline(always)]
    pub(crate) fn nearest4<I: Isa>(
        self,
        isa: I,
        ray: &ShearRay,
        span: &Span,
        keep: [u32; 2],
    ) -> Nearest {
        match self {
            Self::Block(block) => isa.nearest4(block, ray, span.t_min, span.t_max, keep),
            Self::Rows(rows) => isa.rows_nearest4(rows, ray, span.t_min, span.t_max, keep),
        }
    }

    /// What is in a lane; of a compressed leaf only in one with a triangle.
    #[inline(always)]
    pub(crate) fn id(self, lane: usize) -> TriangleId {
        match self {
            Self::Block(block) => TriangleId::of_lane(block, lane),
            Self::Rows(rows) => TriangleId::of_word(rows.id(lane)),
        }
    }

    /// The corners of the triangle in a lane, their coordinates in the order of the ray's axes.
    #[inline(always)]
    pub(crate) fn corners_along(self, lane: usize, ray: &ShearRay) -> [[f32; 3]; 3] {
        match self {
            Self::Block(block) => corners_along(block, lane, ray),
            Self::Rows(rows) => along(&rows.corners(lane), ray),
        }
    }

    /// Lanes whose triangles are not opaque, as bits.
    #[inline(always)]
    pub(crate) fn translucent_lanes(self) -> u32 {
        match self {
            Self::Block(block) => TriangleId::translucent_lanes(block),
            Self::Rows(rows) => (0..rows.count()).fold(0, |lanes, lane| {
                lanes | u32::from(!TriangleId::of_word(rows.id(lane)).is_opaque()) << lane
            }),
        }
    }

    /// How many lanes hold triangles: the first ones.
    #[inline(always)]
    pub(crate) fn used_lanes(self) -> u32 {
        match self {
            Self::Block(block) => TriangleId::used_lanes(block),
            Self::Rows(rows) => rows.count() as u32,
        }
    }

    /// The triangles as a block.
    #[inline(always)]
    pub(crate) fn block<'b, I: Isa>(self, isa: I, room: &'b mut BlockRoom) -> &'b Triangles4
    where
        'a: 'b,
    {
        match self {
            Self::Block(block) => block,
            Self::Rows(rows) => room.0.write(isa.expand4(rows, TriangleId::NONE.word())),
        }
    }
}
