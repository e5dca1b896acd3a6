//! Counting what a traversal visits, at no cost when nobody asks.

use crate::Counters;

/// Something that hears of every visit.
pub(crate) trait Count: Copy + Default {
    fn node(&mut self);
    fn leaf(&mut self, triangles: u32);
    fn instance(&mut self);
}

/// Hears nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NoCount;

impl Count for NoCount {
    #[inline(always)]
    fn node(&mut self) {}
    #[inline(always)]
    fn leaf(&mut self, _: u32) {}
    #[inline(always)]
    fn instance(&mut self) {}
}

impl Count for Counters {
    #[inline(always)]
    fn node(&mut self) {
        self.nodes += 1;
    }
    #[inline(always)]
    fn leaf(&mut self, triangles: u32) {
        self.leaves += 1;
        self.triangles += triangles;
    }
    #[inline(always)]
    fn instance(&mut self) {
        self.instances += 1;
    }
}
