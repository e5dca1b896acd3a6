//! Queries that give lists of hits: one ray after another, since all hits go into one list.

use rayburst_math::{Hit, Ray};
use rayburst_simd::{Isa, Kernel};

use super::{all::All, count::Count, nearest::Nearest, query::Query};
use crate::{
    CandidateFilter, TraceOptions,
    structure::{Structure, Tracer},
};

/// Which hits are listed.
pub(crate) trait Gather {
    type Query<'a>: Query;

    /// A query that appends to a list.
    fn begin<'a>(&self, ray: &Ray, hits: &'a mut Vec<Hit>) -> Self::Query<'a>;

    fn end(query: Self::Query<'_>);
}

/// All of them.
pub(crate) struct Every;

impl Gather for Every {
    type Query<'a> = All<'a>;

    #[inline(always)]
    fn begin<'a>(&self, ray: &Ray, hits: &'a mut Vec<Hit>) -> All<'a> {
        All::new(ray, hits)
    }

    #[inline(always)]
    fn end(query: All<'_>) {
        query.finish();
    }
}

/// So many of the first.
pub(crate) struct First(pub(crate) usize);

impl Gather for First {
    type Query<'a> = Nearest<'a>;

    #[inline(always)]
    fn begin<'a>(&self, ray: &Ray, hits: &'a mut Vec<Hit>) -> Nearest<'a> {
        Nearest::new(ray, self.0, hits)
    }

    #[inline(always)]
    fn end(_: Nearest<'_>) {}
}

/// The lists of many rays as a kernel.
struct Lists<'a, S, F, C, G> {
    structure: &'a S,
    rays: &'a [Ray],
    options: &'a TraceOptions,
    filter: &'a F,
    gather: G,
    counts: &'a mut [C],
    offsets: &'a mut Vec<usize>,
    hits: &'a mut Vec<Hit>,
}

impl<S: Structure, F: CandidateFilter, C: Count, G: Gather> Kernel for Lists<'_, S, F, C, G> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let mut tracer = Tracer::<_, _, _, C>::new(isa, self.structure, self.options, self.filter);
        for (index, (ray, count)) in self.rays.iter().zip(self.counts).enumerate() {
            let mut query = self.gather.begin(ray, self.hits);
            tracer.trace(index, ray, &mut query);
            *count = tracer.count;
            G::end(query);
            self.offsets.push(self.hits.len());
        }
    }
}

/// Appends the hits of each ray to `hits`, and where they end to `offsets`.
pub(crate) fn run<S: Structure, F: CandidateFilter, C: Count>(
    structure: &S,
    rays: &[Ray],
    options: &TraceOptions,
    filter: &F,
    gather: impl Gather,
    counts: &mut [C],
    offsets: &mut Vec<usize>,
    hits: &mut Vec<Hit>,
) {
    let lists = Lists { structure, rays, options, filter, gather, counts, offsets, hits };
    structure.isa_level().dispatch(lists);
}
