//! Which boxes a ray meets.

use std::ops::ControlFlow;

use rayburst_math::Ray;
use rayburst_simd::{Isa, Kernel};

use super::{ProceduralTop, ProceduralTree};
use crate::{
    Blas, Tlas, TraceOptions,
    structure::{Stacks, Structure},
    traverse::{
        count::{Count, NoCount},
        prepare::{PreparedRay, Span},
        walk::{Leaves, Stack, walk},
    },
};

/// A procedural primitive whose box a ray meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProceduralCandidate {
    /// Index of the instance; 0 if there is no TLAS.
    pub instance: u32,
    /// Index of the geometry in its BLAS.
    pub geometry: u32,
    /// Index of the primitive in its geometry.
    pub primitive: u32,
    /// Whether hits are final, with all that overrides it.
    pub opaque: bool,
}

/// Told of a candidate and where the interval ends now; says where it ends after it, or that it is enough.
type Visit<'a> = dyn FnMut(&ProceduralCandidate, f32) -> ControlFlow<(), f32> + 'a;

/// A ray and what it looks for.
struct Search<'a> {
    ray: &'a Ray,
    options: &'a TraceOptions,
    t_max: f32,
    visit: &'a mut Visit<'a>,
}

/// Boxes of one BLAS for a ray in its space.
struct Boxes<'a, 'b> {
    tree: &'a ProceduralTree,
    instance: u32,
    force_opaque: Option<bool>,
    prepared: &'a PreparedRay,
    search: &'a mut Search<'b>,
}

impl<C: Count> Leaves<C> for Boxes<'_, '_> {
    #[inline(always)]
    fn visit(&mut self, number: u32, span: &mut Span, _: &mut C) -> ControlFlow<()> {
        let candidate = self.tree.candidate(number, self.instance, self.force_opaque);
        if self.search.options.skip.skips(candidate.opaque) {
            return ControlFlow::Continue(());
        }
        let t_max = (self.search.visit)(&candidate, self.search.t_max);
        self.search.t_max = match t_max {
            // What lies beyond was left out already. NaN is no minimum.
            ControlFlow::Continue(t_max) => self.search.t_max.min(t_max),
            ControlFlow::Break(()) => return ControlFlow::Break(()),
        };
        *span = self.prepared.span(self.search.ray.t_min, self.search.t_max);
        ControlFlow::Continue(())
    }
}

/// Visits the boxes of a BLAS that a ray meets in its space.
#[inline(always)]
fn visit_boxes<I: Isa>(
    isa: I,
    tree: &ProceduralTree,
    local: &Ray,
    instance: u32,
    force_opaque: Option<bool>,
    stack: &mut Stack,
    search: &mut Search<'_>,
) -> ControlFlow<()> {
    let Some(prepared) = PreparedRay::new(local, &tree.bounds(), 0.0) else {
        return ControlFlow::Continue(());
    };
    let mut span = prepared.span(local.t_min, search.t_max);
    let view = tree.view();
    let mut boxes = Boxes { tree, instance, force_opaque, prepared: &prepared, search };
    let count = &mut NoCount;
    // SAFETY: the tree is borrowed.
    unsafe { walk::<I, _, true>(isa, view, &prepared.slab, &mut span, stack, count, &mut boxes) }
}

/// Instances for a ray in the world.
struct Instances<'a, 'b, I> {
    isa: I,
    tlas: &'a Tlas,
    world: &'a PreparedRay,
    bottom: &'a mut Stack,
    search: &'a mut Search<'b>,
}

impl<I: Isa, C: Count> Leaves<C> for Instances<'_, '_, I> {
    #[inline(always)]
    fn visit(&mut self, index: u32, span: &mut Span, _: &mut C) -> ControlFlow<()> {
        let (ray, options) = (self.search.ray, self.search.options);
        let Some((tree, flags, local)) = self.tlas.enter_procedural(index, ray, options) else {
            return ControlFlow::Continue(());
        };
        let force_opaque = options.force_opaque.or(flags.force_opaque);
        let (bottom, search) = (&mut *self.bottom, &mut *self.search);
        visit_boxes(self.isa, tree, &local, index, force_opaque, bottom, search)?;
        *span = self.world.span(ray.t_min, self.search.t_max);
        ControlFlow::Continue(())
    }
}

/// Where a search begins.
enum Root<'a> {
    Blas(&'a ProceduralTree),
    Tlas(&'a Tlas, &'a ProceduralTop),
}

/// A search as a kernel.
struct Visitor<'a> {
    root: Root<'a>,
    search: Search<'a>,
}

impl Kernel for Visitor<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        let Stacks { mut top, mut bottom } = Stacks::new();
        let search = &mut self.search;
        // Whether the search ended early is the visitor's to know.
        let _ = match self.root {
            Root::Blas(tree) => {
                let force_opaque = search.options.force_opaque;
                visit_boxes(isa, tree, search.ray, 0, force_opaque, &mut bottom, search)
            }
            Root::Tlas(tlas, level) => {
                let Some(world) = level.prepare(search.ray) else { return };
                let mut span = world.span(search.ray.t_min, search.t_max);
                let view = level.view();
                let bottom = &mut bottom;
                let mut instances = Instances { isa, tlas, world: &world, bottom, search };
                let (slab, count) = (&world.slab, &mut NoCount);
                // SAFETY: the tree is borrowed.
                unsafe {
                    walk::<I, _, true>(isa, view, slab, &mut span, &mut top, count, &mut instances)
                }
            }
        };
    }
}

impl Blas {
    /// Tells `visit` of every procedural primitive whose box a ray meets in its interval, each once, the
    /// nearer boxes about first, with the end of the interval; it says where that ends from then on, or
    /// breaks. Greater ends than the one it was told, and NaN, change nothing. What is in a box is the
    /// visitor's to intersect; a box that is barely missed may be among them.
    pub fn procedural_candidates<'a>(
        &'a self,
        ray: &'a Ray,
        options: &'a TraceOptions,
        visit: &'a mut Visit<'a>,
    ) {
        if let (Some(tree), false) = (self.procedural(), options.skip.procedural) {
            let search = Search { ray, options, t_max: ray.t_max, visit };
            self.isa_level().dispatch(Visitor { root: Root::Blas(tree), search });
        }
    }
}

impl Tlas {
    /// Tells `visit` of every procedural primitive whose box a ray meets, as for a BLAS.
    pub fn procedural_candidates<'a>(
        &'a self,
        ray: &'a Ray,
        options: &'a TraceOptions,
        visit: &'a mut Visit<'a>,
    ) {
        if let (Some(level), false) = (self.procedural(), options.skip.procedural) {
            let search = Search { ray, options, t_max: ray.t_max, visit };
            self.isa_level().dispatch(Visitor { root: Root::Tlas(self, level), search });
        }
    }
}
