//! The queries of both structures, in one text: one ray and batches, with and without counters.

use std::ops::ControlFlow;

use rayburst_math::{Hit, Ray};
use rayburst_simd::{Isa, IsaLevel, Kernel};

use crate::{
    AllHits, Blas, CandidateFilter, Counters, Tlas, TraceOptions,
    traverse::{
        all::All,
        any::Any,
        closest::Closest,
        count::{Count, NoCount},
        query::{Asker, Query},
        walk::Stack,
    },
};

/// The stacks of a traversal, set up once a batch.
pub(crate) struct Stacks {
    pub(crate) top: Stack,
    pub(crate) bottom: Stack,
}

impl Stacks {
    #[inline(always)]
    fn new() -> Self {
        Self { top: Stack::new(), bottom: Stack::new() }
    }
}

/// What a structure must be able to do to answer all queries.
pub(crate) trait Structure {
    fn isa_level(&self) -> IsaLevel;

    /// Offers the query every triangle that a valid ray meets, until it breaks.
    fn trace<I: Isa, Q: Query, F: CandidateFilter, C: Count>(
        &self,
        isa: I,
        asker: &Asker<'_, F>,
        options: &TraceOptions,
        stacks: &mut Stacks,
        query: &mut Q,
        count: &mut C,
    ) -> ControlFlow<()>;

    /// The hit of a finished query.
    fn finish(&self, closest: &Closest) -> Hit;
}

/// A query of many rays as a kernel; `answer` makes and finishes the query of each.
struct Batch<'a, S, F, C, A> {
    structure: &'a S,
    rays: &'a [Ray],
    options: &'a TraceOptions,
    filter: &'a F,
    counts: &'a mut [C],
    answers: A,
}

/// What becomes of the rays of a batch.
trait Answers {
    fn answer<I: Isa, S: Structure, F: CandidateFilter, C: Count>(
        &mut self,
        tracer: &mut Tracer<'_, I, S, F, C>,
        index: usize,
        ray: &Ray,
    );
}

/// Traces one ray after another.
struct Tracer<'a, I, S, F, C> {
    isa: I,
    structure: &'a S,
    options: &'a TraceOptions,
    filter: &'a F,
    stacks: Stacks,
    count: C,
}

impl<I: Isa, S: Structure, F: CandidateFilter, C: Count> Tracer<'_, I, S, F, C> {
    #[inline(always)]
    fn trace<Q: Query>(&mut self, index: usize, ray: &Ray, query: &mut Q) {
        if ray.is_valid() {
            let asker = Asker { filter: self.filter, ray, index: index as u32 };
            // Whether the search ended early is in the query.
            let _ = self.structure.trace(
                self.isa,
                &asker,
                self.options,
                &mut self.stacks,
                query,
                &mut self.count,
            );
        }
    }
}

impl<S: Structure, F: CandidateFilter, C: Count, A: Answers> Kernel for Batch<'_, S, F, C, A> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        let mut tracer = Tracer {
            isa,
            structure: self.structure,
            options: self.options,
            filter: self.filter,
            stacks: Stacks::new(),
            count: C::default(),
        };
        for (index, (ray, count)) in self.rays.iter().zip(self.counts).enumerate() {
            tracer.count = C::default();
            self.answers.answer(&mut tracer, index, ray);
            *count = tracer.count;
        }
    }
}

struct ClosestHits<'a>(&'a mut [Hit]);

impl Answers for ClosestHits<'_> {
    #[inline(always)]
    fn answer<I: Isa, S: Structure, F: CandidateFilter, C: Count>(
        &mut self,
        tracer: &mut Tracer<'_, I, S, F, C>,
        index: usize,
        ray: &Ray,
    ) {
        let mut query = Closest::new(ray);
        tracer.trace(index, ray, &mut query);
        self.0[index] = tracer.structure.finish(&query);
    }
}

struct AnyHits<'a>(&'a mut [bool]);

impl Answers for AnyHits<'_> {
    #[inline(always)]
    fn answer<I: Isa, S: Structure, F: CandidateFilter, C: Count>(
        &mut self,
        tracer: &mut Tracer<'_, I, S, F, C>,
        index: usize,
        ray: &Ray,
    ) {
        let mut query = Any::new(ray);
        tracer.trace(index, ray, &mut query);
        self.0[index] = query.found;
    }
}

struct EveryHit<'a> {
    offsets: &'a mut Vec<usize>,
    hits: &'a mut Vec<Hit>,
}

impl Answers for EveryHit<'_> {
    #[inline(always)]
    fn answer<I: Isa, S: Structure, F: CandidateFilter, C: Count>(
        &mut self,
        tracer: &mut Tracer<'_, I, S, F, C>,
        index: usize,
        ray: &Ray,
    ) {
        let mut query = All::new(ray, self.hits);
        tracer.trace(index, ray, &mut query);
        query.finish();
        self.offsets.push(self.hits.len());
    }
}

fn run<S: Structure, F: CandidateFilter, C: Count>(
    structure: &S,
    rays: &[Ray],
    options: &TraceOptions,
    filter: &F,
    counts: &mut [C],
    answers: impl Answers,
) {
    structure.isa_level().dispatch(Batch { structure, rays, options, filter, counts, answers });
}

/// As many counters as rays that count nothing and take no memory.
fn uncounted(rays: &[Ray]) -> Vec<NoCount> {
    vec![NoCount; rays.len()]
}

macro_rules! queries {
    ($structure:ty) => {
        impl $structure {
            /// The nearest hit of a ray, or [`Hit::MISS`].
            pub fn closest_hit(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> Hit {
                let mut hit = Hit::MISS;
                let (rays, hits) = (std::slice::from_ref(ray), std::slice::from_mut(&mut hit));
                self.closest_hits(rays, hits, options, filter);
                hit
            }

            /// Whether a ray hits anything.
            pub fn any_hit(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> bool {
                let mut hit = false;
                let (rays, hits) = (std::slice::from_ref(ray), std::slice::from_mut(&mut hit));
                self.any_hits(rays, hits, options, filter);
                hit
            }

            /// Every hit of a ray, nearest first; replaces what `hits` held.
            pub fn all_hits(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
                hits: &mut Vec<Hit>,
            ) {
                hits.clear();
                let rays = std::slice::from_ref(ray);
                let answers = EveryHit { offsets: &mut vec![], hits };
                run(self, rays, options, filter, &mut uncounted(rays), answers);
            }

            /// The nearest hit of each ray.
            ///
            /// # Panics
            /// If the slices differ in length.
            pub fn closest_hits(
                &self,
                rays: &[Ray],
                hits: &mut [Hit],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) {
                assert_eq!(rays.len(), hits.len(), "as many hits as rays");
                run(self, rays, options, filter, &mut uncounted(rays), ClosestHits(hits));
            }

            /// The nearest hit of each ray, and what each visited.
            ///
            /// # Panics
            /// If the slices differ in length.
            pub fn closest_hits_counted(
                &self,
                rays: &[Ray],
                hits: &mut [Hit],
                counts: &mut [Counters],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) {
                assert_eq!(rays.len(), hits.len(), "as many hits as rays");
                assert_eq!(rays.len(), counts.len(), "as many counts as rays");
                run(self, rays, options, filter, counts, ClosestHits(hits));
            }

            /// Whether each ray hits anything.
            ///
            /// # Panics
            /// If the slices differ in length.
            pub fn any_hits(
                &self,
                rays: &[Ray],
                occluded: &mut [bool],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) {
                assert_eq!(rays.len(), occluded.len(), "as many answers as rays");
                run(self, rays, options, filter, &mut uncounted(rays), AnyHits(occluded));
            }

            /// Whether each ray hits anything, and what each visited.
            ///
            /// # Panics
            /// If the slices differ in length.
            pub fn any_hits_counted(
                &self,
                rays: &[Ray],
                occluded: &mut [bool],
                counts: &mut [Counters],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) {
                assert_eq!(rays.len(), occluded.len(), "as many answers as rays");
                assert_eq!(rays.len(), counts.len(), "as many counts as rays");
                run(self, rays, options, filter, counts, AnyHits(occluded));
            }

            /// Every hit of each ray.
            pub fn all_hits_batch(
                &self,
                rays: &[Ray],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> AllHits {
                let (mut offsets, mut hits) = (Vec::with_capacity(rays.len() + 1), vec![]);
                offsets.push(0);
                let answers = EveryHit { offsets: &mut offsets, hits: &mut hits };
                run(self, rays, options, filter, &mut uncounted(rays), answers);
                AllHits { offsets, hits }
            }
        }
    };
}

queries!(Blas);
queries!(Tlas);
#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Affine3A, Vec3};

    use super::*;
    use crate::{AcceptAll, BuildOptions, Instance, TriangleMesh};

    #[test]
    fn one_triangle_is_hit_through_an_instance() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]]);
        let blas = Blas::build(&[mesh], &BuildOptions::default()).unwrap();
        let instance = Instance::new(0, Affine3A::from_translation(Vec3::Z));
        let tlas =
            Tlas::build(vec![Arc::new(blas)], &[instance], &BuildOptions::default()).unwrap();
        let ray = Ray::new(Vec3::new(0.25, 0.25, 3.0), -Vec3::Z);
        let hit = tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        assert_eq!((hit.t, hit.u, hit.v), (2.0, 0.25, 0.25));
        assert_eq!(hit.kind, rayburst_math::HitKind::TRIANGLE_FRONT);
    }
}
