//! The k nearest hits, each once, in the order in which hits win: an ordered search whose interval ends
//! at the k-th hit as soon as there are so many.
//!
//! The list is sorted at all times: a search that meets near things first appends nearly always, and a
//! triangle that spatial splits put into several leaves is found where it already stands, so that it
//! takes nobody's place.

use std::ops::ControlFlow;

use rayburst_math::{Hit, Ray};

use super::query::{Candidate, Place, Query};

/// The best hits so far, at the end of a list.
pub(crate) struct Nearest<'a> {
    /// The end of the interval while there are fewer than `limit`.
    t_max: f32,
    limit: usize,
    hits: &'a mut Vec<Hit>,
    start: usize,
}

impl<'a> Nearest<'a> {
    pub(crate) fn new(ray: &Ray, limit: usize, hits: &'a mut Vec<Hit>) -> Self {
        let start = hits.len();
        let t_max = if limit == 0 { f32::NEG_INFINITY } else { ray.t_max };
        Self { t_max, limit, hits, start }
    }

    /// The last hit of a list that is full.
    #[inline(always)]
    fn last(&self) -> Option<&Hit> {
        if self.hits.len() - self.start < self.limit { None } else { self.hits.last() }
    }

    /// Where a hit belongs: after all that precede it.
    #[inline(always)]
    fn position(&self, hit: &Hit) -> usize {
        let (mut low, mut high) = (self.start, self.hits.len());
        // Most belong near the end.
        let mut step = 1;
        while low < high {
            let at = if step < high - low { high - step } else { low + (high - low) / 2 };
            if self.hits[at].precedes(hit) {
                low = at + 1;
            } else {
                high = at;
            }
            step *= 2;
        }
        low
    }
}

impl Query for Nearest<'_> {
    const ORDERED: bool = true;
    const ENDS_AT_TAKEN: bool = false;

    #[inline(always)]
    fn t_max(&self) -> f32 {
        // There is no last one if none is wanted.
        match self.last() {
            Some(hit) if self.limit > 0 => hit.t,
            _ => self.t_max,
        }
    }

    #[inline(always)]
    fn wants(&self, candidate: &Candidate, place: &Place<'_>) -> bool {
        if self.limit == 0 {
            return false;
        }
        let hit = place.hit(candidate);
        if self.last().is_some_and(|last| !hit.precedes(last)) {
            return false;
        }
        let position = self.position(&hit);
        position == self.hits.len() || hit.precedes(&self.hits[position])
    }

    #[inline(always)]
    fn take(&mut self, candidate: &Candidate, place: &Place<'_>) -> ControlFlow<()> {
        let hit = place.hit(candidate);
        if self.last().is_some() {
            self.hits.pop();
        }
        let position = self.position(&hit);
        self.hits.insert(position, hit);
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use crate::{
        AcceptAll, Blas, BuildOptions, BuildQuality, Counters, TraceOptions, TriangleMesh,
        traverse::gather::{Every, First, Gather, run},
    };
    use rayburst_math::Ray;

    /// Nodes and leaves that a ray through everything visits.
    fn visits(blas: &Blas, gather: impl Gather) -> u32 {
        let ray = Ray::new(Vec3::new(0.1, 0.2, -1.0), Vec3::new(0.001, 0.002, 1.0));
        let mut counts = [Counters::default()];
        let (options, rays) = (TraceOptions::default(), [ray]);
        run(blas, &rays, &options, &AcceptAll, gather, &mut counts, &mut vec![], &mut vec![]);
        counts[0].nodes + counts[0].leaves
    }

    #[test]
    fn fewer_hits_take_fewer_visits() {
        let (mut positions, mut indices) = (vec![], vec![]);
        for z in 0..4000 {
            let z = z as f32;
            indices.push([0, 1, 2].map(|corner| corner + positions.len() as u32));
            positions.extend([[-9.0, -9.0, z], [50.0, -9.0, z], [-9.0, 50.0, z]].map(Vec3::from));
        }
        for quality in BuildQuality::ALL {
            let options = BuildOptions { quality, ..BuildOptions::default() };
            let blas = Blas::build(&[TriangleMesh::new(&positions, &indices)], &options).unwrap();
            let all = visits(&blas, Every);
            let of = [0, 1, 10, 100, 1000, 5000].map(|k| visits(&blas, First(k)));
            assert!(of.is_sorted(), "{of:?}");
            assert!(of[0] <= 1 && of[1] < 30 && of[2] < 40 && of[3] < all / 20, "{of:?} of {all}");
            assert_eq!(of[5], all);
        }
    }
}
