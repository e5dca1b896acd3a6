//! What becomes of the rays of a batch: a query begins for each and ends as an answer.

use rayburst_math::{Hit, Ray};

use super::{any::Any, closest::Closest, query::OneHit};
use crate::structure::Structure;

/// The answers of a batch, in any order of rays.
pub(crate) trait Answers {
    type Query: OneHit;

    fn begin(ray: &Ray) -> Self::Query;

    /// Whether nothing could change the answer any more.
    fn is_final(query: &Self::Query) -> bool;

    fn end<S: Structure>(&mut self, structure: &S, index: usize, query: &Self::Query);
}

/// The nearest hits.
pub(crate) struct ClosestHits<'a>(pub(crate) &'a mut [Hit]);

impl Answers for ClosestHits<'_> {
    type Query = Closest;

    #[inline(always)]
    fn begin(ray: &Ray) -> Closest {
        Closest::new(ray)
    }

    #[inline(always)]
    fn is_final(_: &Closest) -> bool {
        false
    }

    #[inline(always)]
    fn end<S: Structure>(&mut self, structure: &S, index: usize, query: &Closest) {
        self.0[index] = structure.finish(query);
    }
}

/// Whether there are hits.
pub(crate) struct AnyHits<'a>(pub(crate) &'a mut [bool]);

impl Answers for AnyHits<'_> {
    type Query = Any;

    #[inline(always)]
    fn begin(ray: &Ray) -> Any {
        Any::new(ray)
    }

    #[inline(always)]
    fn is_final(query: &Any) -> bool {
        query.found
    }

    #[inline(always)]
    fn end<S: Structure>(&mut self, _: &S, index: usize, query: &Any) {
        self.0[index] = query.found;
    }
}
