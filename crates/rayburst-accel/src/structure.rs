//! The queries of both structures, in one text: one ray and batches, with and without counters.

use std::ops::ControlFlow;

use rayburst_math::{Hit, Ray};
use rayburst_simd::{Isa, IsaLevel, Kernel};

use crate::{
    AllHits, Blas, CandidateFilter, Counters, Tlas, TraceMode, TraceOptions,
    layout::view::TreeView,
    traverse::{
        answers::{Answers, AnyHits, ClosestHits},
        any::Any,
        batch,
        closest::{Closest, FirstFound},
        count::{Count, NoCount},
        gather::{Every, First, Gather, run as lists},
        prepare::PreparedRay,
        query::{Asker, Place, Query},
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
    pub(crate) fn new() -> Self {
        Self { top: Stack::new(), bottom: Stack::new() }
    }
}

/// What a structure must be able to do to answer all queries.
pub(crate) trait Structure {
    /// Whether leaves of the root's tree are instances.
    const TWO_LEVEL: bool;
    /// Whether the root is an instance, not a BLAS by itself.
    const IS_INSTANCE: bool = false;

    fn isa_level(&self) -> IsaLevel;

    /// Offers the query every triangle that a ray meets, until it breaks.
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

    /// A ray prepared for the root, and where that is: among instances if nowhere. `None` if
    /// the ray hits nothing.
    fn enter_root(
        &self,
        ray: &Ray,
        options: &TraceOptions,
    ) -> Option<(PreparedRay, Option<Place<'_>>)>;

    /// The BLAS that is all of the structure, if it is one and can be hit.
    fn place(&self, _: &TraceOptions) -> Option<Place<'_>> {
        None
    }

    /// A ray in the space of that BLAS.
    #[inline(always)]
    fn local(&self, ray: &Ray) -> Ray {
        *ray
    }

    /// The root's tree.
    fn root_view(&self) -> TreeView;

    /// A ray prepared for an instance, and the instance. `None` if the ray hits nothing there, or if
    /// there are no instances.
    #[inline(always)]
    fn enter(
        &self,
        _instance: u32,
        _ray: &Ray,
        _world: &PreparedRay,
        _options: &TraceOptions,
    ) -> Option<(PreparedRay, Place<'_>)> {
        None
    }

    /// References that wait on a stack at most.
    fn stack_entries(&self) -> usize;
}

/// A query of many rays as a kernel.
struct Batch<'a, S, F, C, A> {
    structure: &'a S,
    rays: &'a [Ray],
    options: &'a TraceOptions,
    filter: &'a F,
    counts: &'a mut [C],
    answers: A,
}

/// Traces one ray after another.
pub(crate) struct Tracer<'a, I, S, F, C> {
    pub(crate) isa: I,
    pub(crate) structure: &'a S,
    pub(crate) options: &'a TraceOptions,
    pub(crate) filter: &'a F,
    stacks: Stacks,
    pub(crate) count: C,
}

impl<'a, I: Isa, S: Structure, F: CandidateFilter, C: Count> Tracer<'a, I, S, F, C> {
    #[inline(always)]
    pub(crate) fn new(isa: I, structure: &'a S, options: &'a TraceOptions, filter: &'a F) -> Self {
        Self { isa, structure, options, filter, stacks: Stacks::new(), count: C::default() }
    }

    /// Asks a query of one ray; `count` is that ray's alone.
    #[inline(always)]
    pub(crate) fn trace<Q: Query>(&mut self, index: usize, ray: &Ray, query: &mut Q) {
        self.count = C::default();
        if self.options.skip.triangles {
            return;
        }
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

/// A filter that never ends a search.
#[derive(Clone, Copy)]
struct GoOn<'a, F>(&'a F);

impl<F: CandidateFilter> CandidateFilter for GoOn<'_, F> {
    const ACTIVE: bool = F::ACTIVE;

    #[inline(always)]
    fn accept(&self, ray_index: u32, ray: &Ray, candidate: &Hit) -> bool {
        self.0.accept(ray_index, ray, candidate)
    }
}

/// Fewer rays are traced one by one.
const FEW: usize = 4;

impl<S: Structure, F: CandidateFilter, C: Count, A: Answers> Kernel for Batch<'_, S, F, C, A> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        let mut tracer = Tracer::new(isa, self.structure, self.options, self.filter);
        let mode = self.options.mode;
        if C::ACTIVE {
            self.counts.fill(C::default());
        }
        let skip = self.options.skip;
        if skip.triangles
            || skip.opaque
            || skip.non_opaque
            || mode == TraceMode::Single
            || (mode == TraceMode::Auto && self.rays.len() < FEW)
        {
            for (index, (ray, count)) in self.rays.iter().zip(self.counts).enumerate() {
                let mut query = A::begin(ray);
                tracer.trace(index, ray, &mut query);
                *count = tracer.count;
                self.answers.end(self.structure, index, &query);
            }
        } else {
            batch::trace(&mut tracer, self.rays, self.counts, &mut self.answers);
        }
    }
}

/// A query of one ray as a kernel; gives the query back, answered.
struct One<'a, S, F, Q> {
    structure: &'a S,
    ray: &'a Ray,
    options: &'a TraceOptions,
    filter: &'a F,
    query: Q,
}

impl<S: Structure, F: CandidateFilter, Q: Query> Kernel for One<'_, S, F, Q> {
    type Output = Q;

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) -> Q {
        let asker = Asker { filter: self.filter, ray: self.ray, index: 0 };
        let (mut stacks, mut count) = (Stacks::new(), NoCount);
        let (options, query) = (self.options, &mut self.query);
        if !options.skip.triangles {
            // Whether the search ended early is in the query.
            let _ = self.structure.trace(isa, &asker, options, &mut stacks, query, &mut count);
        }
        self.query
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

fn closest_of_one<S: Structure, F: CandidateFilter>(
    structure: &S,
    ray: &Ray,
    options: &TraceOptions,
    filter: &F,
) -> Hit {
    let query = Closest::new(ray);
    let one = One { structure, ray, options, filter, query };
    structure.finish(&structure.isa_level().dispatch(one))
}

fn first_of_one<S: Structure, F: CandidateFilter>(
    structure: &S,
    ray: &Ray,
    options: &TraceOptions,
    filter: &F,
) -> Hit {
    let query = FirstFound(Closest::new(ray));
    let one = One { structure, ray, options, filter, query };
    structure.finish(&structure.isa_level().dispatch(one).0)
}

fn any_of_one<S: Structure, F: CandidateFilter>(
    structure: &S,
    ray: &Ray,
    options: &TraceOptions,
    filter: &F,
) -> bool {
    let query = Any::new(ray);
    structure.isa_level().dispatch(One { structure, ray, options, filter, query }).found
}

/// As many counters as rays that count nothing and take no memory.
fn uncounted(rays: &[Ray]) -> Vec<NoCount> {
    vec![NoCount; rays.len()]
}

/// An emptied list with the memory of another, which is left without.
fn reuse(hits: &mut Vec<Hit>) -> Vec<Hit> {
    hits.clear();
    std::mem::take(hits)
}

/// Calls a function with a structure.
macro_rules! whole {
    ($structure:ident, $call:ident, $($arguments:expr),*) => {
        $call($structure, $($arguments),*)
    };
}

/// Calls a function with a TLAS, or with its only instance.
macro_rules! whole_or_sole {
    ($tlas:ident, $call:ident, $($arguments:expr),*) => {
        match $tlas.sole() {
            Some(sole) => $call(&sole, $($arguments),*),
            None => $call($tlas, $($arguments),*),
        }
    };
}

macro_rules! queries {
    ($structure:ty, $with:ident) => {
        impl $structure {
            /// The hits of each ray that are asked for.
            fn lists(
                &self,
                rays: &[Ray],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
                gather: impl Gather,
                mut hits: Vec<Hit>,
            ) -> AllHits {
                let mut offsets = Vec::with_capacity(rays.len() + 1);
                offsets.push(0);
                let (counts, filter) = (&mut uncounted(rays), &GoOn(filter));
                $with!(self, lists, rays, options, filter, gather, counts, &mut offsets, &mut hits);
                AllHits { offsets, hits }
            }

            /// The nearest hit of a ray, or [`Hit::MISS`].
            pub fn closest_hit(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> Hit {
                $with!(self, closest_of_one, ray, options, filter)
            }

            /// Some hit of a ray, the first one found, or [`Hit::MISS`]: less work than the nearest.
            pub fn first_hit(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> Hit {
                $with!(self, first_of_one, ray, options, filter)
            }

            /// Whether a ray hits anything.
            pub fn any_hit(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> bool {
                $with!(self, any_of_one, ray, options, filter)
            }

            /// Every hit of a ray, nearest first; replaces what `hits` held.
            pub fn all_hits(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
                hits: &mut Vec<Hit>,
            ) {
                let rays = std::slice::from_ref(ray);
                *hits = self.lists(rays, options, filter, Every, reuse(hits)).hits;
            }

            /// The first `k` of [all hits](Self::all_hits) of a ray, nearest first; replaces what
            /// `hits` held. The fewer are asked for, the less is visited.
            ///
            /// This is a k-buffer: where layers are blended from front to back, ask for a few, blend
            /// them, and go on with `t_min` at the last one's `t` and a filter that rejects what was
            /// blended, until nothing shines through.
            pub fn nearest_hits(
                &self,
                ray: &Ray,
                k: usize,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
                hits: &mut Vec<Hit>,
            ) {
                let rays = std::slice::from_ref(ray);
                *hits = self.lists(rays, options, filter, First(k), reuse(hits)).hits;
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
                let (counts, filter) = (&mut uncounted(rays), &GoOn(filter));
                $with!(self, run, rays, options, filter, counts, ClosestHits(hits));
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
                let filter = &GoOn(filter);
                $with!(self, run, rays, options, filter, counts, ClosestHits(hits));
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
                let (counts, filter) = (&mut uncounted(rays), &GoOn(filter));
                $with!(self, run, rays, options, filter, counts, AnyHits(occluded));
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
                let filter = &GoOn(filter);
                $with!(self, run, rays, options, filter, counts, AnyHits(occluded));
            }

            /// Every hit of each ray.
            pub fn all_hits_batch(
                &self,
                rays: &[Ray],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> AllHits {
                self.lists(rays, options, filter, Every, vec![])
            }

            /// The first `k` of all hits of each ray.
            pub fn nearest_hits_batch(
                &self,
                rays: &[Ray],
                k: usize,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> AllHits {
                self.lists(rays, options, filter, First(k), vec![])
            }
        }
    };
}

queries!(Blas, whole);
queries!(Tlas, whole_or_sole);

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
