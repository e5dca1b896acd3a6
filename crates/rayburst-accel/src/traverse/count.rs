//! Counting what a traversal visits, at no cost when nobody asks.

use crate::{Counters, layout::view::Leaf};

/// Something that hears of every visit.
pub(crate) trait Count: Copy + Default {
    /// Whether it hears anything.
    const ACTIVE: bool;

    fn node(&mut self);
    fn leaf(&mut self, leaf: Leaf<'_>);
    fn instance(&mut self);
}

/// Hears nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NoCount;

impl Count for NoCount {
    const ACTIVE: bool = false;

    #[inline(always)]
    fn node(&mut self) {}
    #[inline(always)]
    fn leaf(&mut self, _: Leaf<'_>) {}
    #[inline(always)]
    fn instance(&mut self) {}
}

impl Count for Counters {
    const ACTIVE: bool = true;

    #[inline(always)]
    fn node(&mut self) {
        self.nodes += 1;
    }
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf<'_>) {
        self.leaves += 1;
        self.triangles += leaf.used_lanes();
    }
    #[inline(always)]
    fn instance(&mut self) {
        self.instances += 1;
    }
}
