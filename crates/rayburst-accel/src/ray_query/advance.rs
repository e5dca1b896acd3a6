//! The search between two candidates.

use std::ops::ControlFlow;

use rayburst_math::{Hit, HitKind};
use rayburst_simd::{Isa, Kernel, TriangleHits};

use super::{Candidate, RayQuery, Root};
use crate::{
    procedural::ProceduralTree,
    structure::Structure,
    traverse::{
        prepare::PreparedRay,
        query::{self, Place, without_sign_of_zero},
    },
};

/// How far a search is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Not begun.
    Begin,
    /// Among triangles.
    Triangles,
    /// Among procedural primitives.
    Boxes,
    /// Over.
    Ended,
}

/// The tree that a ray is in, and the ray in its space.
#[derive(Clone, Copy)]
pub(super) enum Inside<'a> {
    /// None, but among instances.
    Nothing,
    /// That of a BLAS' triangles.
    Triangles { place: Place<'a>, ray: PreparedRay },
    /// That of a BLAS' procedural primitives.
    Boxes { tree: &'a ProceduralTree, instance: u32, force_opaque: Option<bool>, ray: PreparedRay },
}

/// Lanes of a leaf.
const ALL_LANES: u32 = 0xF;

/// The search for the next candidate as a kernel; returns whether there is one.
pub(super) struct Advance<'a, 'b>(pub(super) &'b mut RayQuery<'a>);

impl Kernel for Advance<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> bool {
        let query = self.0;
        loop {
            let flow = match query.stage {
                Stage::Begin => ControlFlow::Continue(()),
                Stage::Triangles => query.search_triangles(isa),
                Stage::Boxes => query.search_boxes(isa),
                Stage::Ended => return false,
            };
            if flow.is_break() {
                return query.candidate.is_some();
            }
            query.next_stage();
        }
    }
}

// Searches continue if there is nothing left, and break at a candidate or when the search is over.
impl<'a> RayQuery<'a> {
    /// Leaves all trees.
    pub(super) fn leave(&mut self) {
        (self.world, self.inside, self.lanes) = (None, Inside::Nothing, 0);
        self.top.end();
        self.bottom.end();
    }

    #[inline(always)]
    fn next_stage(&mut self) {
        self.leave();
        match self.stage {
            Stage::Begin => {
                self.stage = Stage::Triangles;
                if !self.options.skip.triangles {
                    self.enter_triangles();
                }
            }
            Stage::Triangles => {
                self.stage = Stage::Boxes;
                if !self.options.skip.procedural {
                    self.enter_boxes();
                }
            }
            Stage::Boxes | Stage::Ended => self.stage = Stage::Ended,
        }
    }

    #[inline(always)]
    fn enter_triangles(&mut self) {
        let entered = match self.root {
            Root::Blas(blas) => blas.enter_root(&self.ray, &self.options),
            Root::Tlas(tlas) => tlas.enter_root(&self.ray, &self.options),
        };
        match entered {
            Some((ray, Some(place))) => self.go_inside(Inside::Triangles { place, ray }),
            Some((ray, None)) => self.go_among_instances(ray),
            None => (),
        }
    }

    #[inline(always)]
    fn enter_boxes(&mut self) {
        match self.root {
            Root::Blas(blas) => {
                if let Some(tree) = blas.procedural()
                    && let Some(ray) = PreparedRay::new(&self.ray, &tree.bounds(), 0.0)
                {
                    let force_opaque = self.options.force_opaque;
                    self.go_inside(Inside::Boxes { tree, instance: 0, force_opaque, ray });
                }
            }
            Root::Tlas(tlas) => {
                if let Some(ray) = tlas.procedural().and_then(|level| level.prepare(&self.ray)) {
                    self.go_among_instances(ray);
                }
            }
        }
    }

    #[inline(always)]
    fn go_inside(&mut self, inside: Inside<'a>) {
        self.inside = inside;
        self.bottom.begin();
    }

    #[inline(always)]
    fn go_among_instances(&mut self, ray: PreparedRay) {
        self.world = Some(ray);
        self.top.begin();
    }

    #[inline(always)]
    fn search_triangles<I: Isa>(&mut self, isa: I) -> ControlFlow<()> {
        loop {
            if let Inside::Triangles { place, ray } = self.inside {
                self.search_leaves(isa, &place, &ray)?;
                self.inside = Inside::Nothing;
            }
            let (Root::Tlas(tlas), Some(world)) = (self.root, self.world) else {
                return ControlFlow::Continue(());
            };
            let span = world.span(self.ray.t_min, self.t_max());
            // SAFETY: the tree is borrowed, and the only one at the top in this stage.
            let next = unsafe { self.top.next(isa, tlas.root_view(), &world.slab, &span) };
            let Some(instance) = next else { return ControlFlow::Continue(()) };
            if let Some((ray, place)) = tlas.enter(instance, &self.ray, &world, &self.options) {
                self.go_inside(Inside::Triangles { place, ray });
            }
        }
    }

    /// Searches a BLAS for triangles.
    #[inline(always)]
    fn search_leaves<I: Isa>(
        &mut self,
        isa: I,
        place: &Place<'_>,
        ray: &PreparedRay,
    ) -> ControlFlow<()> {
        let tree = place.blas.tree.view();
        let mut span = ray.span(self.ray.t_min, self.t_max());
        loop {
            if self.lanes == 0 {
                // SAFETY: the place borrows the tree, and there is no other inside of it.
                let next = unsafe { self.bottom.next(isa, tree, &ray.slab, &span) };
                let Some(leaf) = next else { return ControlFlow::Continue(()) };
                (self.leaf, self.lanes) = (leaf, ALL_LANES);
            }
            // SAFETY: values of a BLAS' leaves come from writers of its tree.
            let leaf = unsafe { tree.leaf(self.leaf) };
            let mut hits = TriangleHits::NONE;
            let mut left = leaf.triangles4(isa, &ray.shear, &span, &mut hits) & self.lanes;
            left &= (hits.front & place.keep[0]) | (!hits.front & place.keep[1]);
            self.lanes = 0;
            let front = place.front(hits.front);
            while left != 0 {
                let lane = left.trailing_zeros() as usize % 4;
                left &= left - 1;
                let id = leaf.id(lane);
                let (t, opaque) =
                    (ray.external(without_sign_of_zero(hits.t[lane])), place.is_opaque(id));
                let is_inside = self.ray.t_min < t && t < self.ray.t_max && t <= self.t_max();
                if !is_inside || self.options.skip.skips(opaque) {
                    continue;
                }
                let hit = place.hit(&query::Candidate {
                    t,
                    u: hits.u[lane],
                    v: hits.v[lane],
                    triangle: id.triangle(),
                    front: front >> lane & 1 != 0,
                });
                if !self.is_better(&hit) {
                    continue;
                }
                if !opaque {
                    self.candidate = Some(Candidate { hit, opaque });
                    self.lanes = left;
                    return ControlFlow::Break(());
                }
                self.commit(&hit);
                if self.stage == Stage::Ended {
                    return ControlFlow::Break(());
                }
                span = ray.span(self.ray.t_min, self.t_max());
            }
        }
    }

    #[inline(always)]
    fn search_boxes<I: Isa>(&mut self, isa: I) -> ControlFlow<()> {
        loop {
            if let Inside::Boxes { tree, instance, force_opaque, ray } = self.inside {
                let span = ray.span(self.ray.t_min, self.t_max());
                loop {
                    // SAFETY: the tree is borrowed, and there is no other inside of it.
                    let next = unsafe { self.bottom.next(isa, tree.view(), &ray.slab, &span) };
                    let Some(number) = next else { break };
                    let found = tree.candidate(number, instance, force_opaque);
                    if !self.options.skip.skips(found.opaque) {
                        let (geometry, primitive) = (found.geometry, found.primitive);
                        let kind = HitKind::procedural(0);
                        let hit = Hit { primitive, geometry, instance, kind, ..Hit::MISS };
                        self.candidate = Some(Candidate { hit, opaque: found.opaque });
                        return ControlFlow::Break(());
                    }
                }
                self.inside = Inside::Nothing;
            }
            let (Root::Tlas(tlas), Some(world)) = (self.root, self.world) else {
                return ControlFlow::Continue(());
            };
            let Some(level) = tlas.procedural() else { return ControlFlow::Continue(()) };
            let span = world.span(self.ray.t_min, self.t_max());
            // SAFETY: the tree is borrowed, and the only one at the top in this stage.
            let next = unsafe { self.top.next(isa, level.view(), &world.slab, &span) };
            let Some(instance) = next else { return ControlFlow::Continue(()) };
            if let Some((tree, flags, local)) =
                tlas.enter_procedural(instance, &self.ray, &self.options)
                && let Some(ray) = PreparedRay::new(&local, &tree.bounds(), 0.0)
            {
                let force_opaque = self.options.force_opaque.or(flags.force_opaque);
                self.go_inside(Inside::Boxes { tree, instance, force_opaque, ray });
            }
        }
    }
}
