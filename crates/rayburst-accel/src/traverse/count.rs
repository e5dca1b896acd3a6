//! Counting what a traversal visits, at no cost when nobody asks.

use crate::{Counters, layout::view::Leaf};

/// Something that hears of every visit.
pub(crate) trait Count: Copy + Default {
    /// Whether it hears anything.
    const ACTIVE: bool;

    fn node(&mut self);
    fn leaf(&mut self, leaf: Leaf<'_>);
    fn instance(&mut self);
    /// So many other rays were on their way at the last visit.
    fn beside(&mut self, others: u32);
    /// The last node was visited with a bundle.
    fn bundled(&mut self);
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
    #[inline(always)]
    fn beside(&mut self, _: u32) {}
    #[inline(always)]
    fn bundled(&mut self) {}
}

impl Count for Counters {
    const ACTIVE: bool = true;

    #[inline(always)]
    fn node(&mut self) {
        self.nodes += 1;
        self.in_flight += 1;
    }
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf<'_>) {
        self.leaves += 1;
        self.in_flight += 1;
        self.triangles += leaf.used_lanes();
    }
    #[inline(always)]
    fn instance(&mut self) {
        self.instances += 1;
    }
    #[inline(always)]
    fn beside(&mut self, others: u32) {
        self.in_flight = self.in_flight.saturating_add(others);
    }
    #[inline(always)]
    fn bundled(&mut self) {
        self.packet_nodes += 1;
    }
}
