//! Every hit, each once, in the order in which hits win.

use std::{cmp::Ordering, ops::ControlFlow};

use rayburst_math::{Hit, Ray};

use super::query::{Candidate, Place, Query};

/// The hits so far, appended to a list.
pub(crate) struct All<'a> {
    t_max: f32,
    hits: &'a mut Vec<Hit>,
    start: usize,
}

impl<'a> All<'a> {
    pub(crate) fn new(ray: &Ray, hits: &'a mut Vec<Hit>) -> Self {
        let start = hits.len();
        Self { t_max: ray.t_max, hits, start }
    }

    /// Sorts what was appended; a triangle that spatial splits put into several leaves counts once.
    pub(crate) fn finish(self) {
        self.hits[self.start..].sort_unstable_by(|a, b| {
            if a.precedes(b) {
                Ordering::Less
            } else if b.precedes(a) {
                Ordering::Greater
            } else {
                Ordering::Equal
            }
        });
        let mut kept = self.start;
        for i in self.start..self.hits.len() {
            if kept == self.start || self.hits[kept - 1] != self.hits[i] {
                self.hits[kept] = self.hits[i];
                kept += 1;
            }
        }
        self.hits.truncate(kept);
    }
}

impl Query for All<'_> {
    const ORDERED: bool = false;

    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.t_max
    }

    #[inline(always)]
    fn wants(&self, _: &Candidate, _: &Place<'_>) -> bool {
        true
    }

    #[inline(always)]
    fn take(&mut self, candidate: &Candidate, place: &Place<'_>) -> ControlFlow<()> {
        self.hits.push(place.hit(candidate));
        ControlFlow::Continue(())
    }
}
