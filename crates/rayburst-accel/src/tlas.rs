//! A top-level structure: instances of BLASes in the world.
//!
//! A ray is transformed into an instance's space without normalising, so `t` keeps its meaning. The
//! transform is wrong by rounding: a point `p` of the ray, with `W` the inverse rounded to `f32`,
//! ends up off by at most `5ε(|W|(|o| + |p − o|) + |W·T|)` in object space, which is
//! `5ε·κ·(|o| + |p − o| + |T|)` in the world with `κ = ‖|M||W|‖∞` (1 without rotation, at most 3 for
//! rotations). Traversal widens the instances' boxes by `8ε` times that, so an instance that the
//! transformed ray hits is never skipped.

pub(crate) mod placements;
mod update;

use std::{ops::ControlFlow, sync::Arc, time::Instant};

use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3};
use rayburst_math::{Aabb, Hit, Ray};
use rayburst_simd::{Isa, IsaLevel};

use self::placements::Placements;
use crate::{
    Blas, BuildError, BuildOptions, BuildStats, BvhDefect, CandidateFilter, Instance,
    InstanceFlags, TraceOptions, ValidationReport,
    build::{boxes::BoxLeaves, primitives::is_traceable},
    layout::{
        bvh8::{Bvh8, Leaves},
        view::TreeView,
    },
    procedural::{ProceduralTop, ProceduralTree},
    structure::{Stacks, Structure},
    traverse::{
        closest::Closest,
        count::Count,
        prepare::{PreparedRay, Span},
        query::{Asker, Place, Query, trace_blas},
        walk::{self, Stack, walk},
    },
    validate,
};

/// Instances of BLASes, ready to be traced.
#[derive(Clone, Debug)]
pub struct Tlas {
    tree: Bvh8,
    blases: Vec<Arc<Blas>>,
    instances: Vec<Instance>,
    placed: Vec<Placed>,
    /// The only instance that can be hit, if there is just one: rays go straight there.
    sole: Option<u32>,
    /// The greatest κ of the instances.
    condition: f32,
    /// The greatest coordinate of an instance's translation or of the bounds.
    reach: f32,
    /// The tree over instances with procedural primitives, if there are any.
    procedural: Option<Box<ProceduralTop>>,
    stats: BuildStats,
    isa: IsaLevel,
}

/// What a ray needs to know of an instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    inverse: Affine3A,
    blas: u32,
    mask: u8,
    flags: InstanceFlags,
    /// Whether the instance's space is the world.
    identity: bool,
}

/// Boxes are widened by at most this: a multiple of the farthest origin of a ray.
const MAX_SLACK: f32 = (1u128 << 92) as f32;

impl Placed {
    /// A ray in the instance's space.
    #[inline(always)]
    fn local(&self, ray: &Ray) -> Ray {
        let origin = self.inverse.transform_point3(ray.origin);
        let direction = self.inverse.transform_vector3(ray.direction);
        Ray { origin, direction, ..*ray }
    }
}

/// What the world needs to know of an instance.
pub(crate) struct Placement {
    inverse: Affine3A,
    /// Empty if the instance cannot be hit.
    pub(crate) bounds: Aabb,
    pub(crate) condition: f32,
}

impl Tlas {
    /// Builds over instances; their order gives the instance indices of hits.
    pub fn build(
        blases: Vec<Arc<Blas>>,
        instances: &[Instance],
        options: &BuildOptions<'_>,
    ) -> Result<Self, BuildError> {
        let begin = Instant::now();
        let isa = options.resolve_isa()?;
        placements::check(&blases, instances)?;
        let mut placed = Vec::new();
        let placements = Placements::new(&blases, instances, Blas::triangle_bounds, &mut placed);
        let tree = placements.tree(options)?;
        let primitives = placements.active();
        let procedural = ProceduralTop::build(&blases, instances, options)?;
        let stats = BuildStats {
            primitives,
            inactive: instances.len() - primitives,
            references: primitives,
            nodes: tree.shape.nodes,
            leaves: tree.shape.leaves,
            depth: tree.shape.depth,
            sah_cost: tree.shape.sah_cost,
            bytes: tree.bytes()
                + procedural.as_ref().map_or(0, ProceduralTop::bytes)
                + size_of_val(instances)
                + size_of_val(placed.as_slice()),
            seconds: begin.elapsed().as_secs_f64(),
        };
        Ok(Self {
            sole: placements.sole(),
            condition: placements.condition(),
            reach: placements.reach(&tree.bounds),
            tree,
            blases,
            instances: instances.to_vec(),
            placed,
            procedural: procedural.map(Box::new),
            stats,
            isa,
        })
    }

    /// What the build made, of the trees over triangles and over procedural primitives together.
    pub fn stats(&self) -> BuildStats {
        match &self.procedural {
            Some(procedural) => procedural.add_to(self.stats),
            None => self.stats,
        }
    }

    /// The box around all instances that can be hit, in the world; empty if there are none.
    pub fn bounds(&self) -> Aabb {
        let procedural = self.procedural.as_ref();
        self.tree.bounds.union(procedural.map_or(Aabb::EMPTY, |procedural| procedural.bounds()))
    }

    /// The instruction set of its kernels.
    pub fn isa(&self) -> IsaLevel {
        self.isa
    }

    /// The instances as given.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The BLASes as given.
    pub fn blases(&self) -> &[Arc<Blas>] {
        &self.blases
    }

    /// From an instance's space to the world.
    pub fn object_to_world(&self, instance: u32) -> Affine3A {
        self.instances[instance as usize].transform
    }

    /// From the world to an instance's space: the inverse by which rays are transformed. Zero if the
    /// instance's transform has no inverse.
    pub fn world_to_object(&self, instance: u32) -> Affine3A {
        self.placed[instance as usize].inverse
    }

    /// The only instance that can be hit, if there is just one.
    #[inline(always)]
    pub(crate) fn sole(&self) -> Option<Sole<'_>> {
        self.sole.map(|index| Sole { tlas: self, index })
    }

    /// A ray prepared for an instance, and the instance; `world` is the ray as prepared for all of
    /// them. `None` if the ray does not hit it.
    #[inline(always)]
    fn enter_instance(
        &self,
        index: u32,
        ray: &Ray,
        world: Option<&PreparedRay>,
        options: &TraceOptions,
    ) -> Option<(PreparedRay, Place<'_>)> {
        let placed = &self.placed[index as usize];
        let place = self.place(index, options)?;
        match world {
            // Prepared for a larger box: as conservative as need be.
            Some(world) if placed.identity => Some((*world, place)),
            _ => {
                let bounds = place.blas.triangle_bounds();
                Some((PreparedRay::new(&placed.local(ray), &bounds, 0.0)?, place))
            }
        }
    }

    /// An instance's BLAS, if its mask allows.
    #[inline(always)]
    fn place(&self, index: u32, options: &TraceOptions) -> Option<Place<'_>> {
        let placed = &self.placed[index as usize];
        let blas = &*self.blases[placed.blas as usize];
        (placed.mask & options.mask != 0).then(|| Place::new(blas, index, placed.flags, options))
    }

    /// A valid ray prepared for the boxes of instances.
    #[inline(always)]
    fn prepare(&self, ray: &Ray) -> Option<PreparedRay> {
        PreparedRay::new(ray, &self.tree.bounds, slack(ray, self.condition, self.reach))
    }

    /// The tree over instances with procedural primitives.
    pub(crate) fn procedural(&self) -> Option<&ProceduralTop> {
        self.procedural.as_deref()
    }

    /// The procedural primitives of an instance, its flags, and a ray in its space, if its mask allows.
    #[inline(always)]
    pub(crate) fn enter_procedural(
        &self,
        index: u32,
        ray: &Ray,
        options: &TraceOptions,
    ) -> Option<(&ProceduralTree, InstanceFlags, Ray)> {
        let placed = &self.placed[index as usize];
        if placed.mask & options.mask == 0 {
            return None;
        }
        let tree = self.blases[placed.blas as usize].procedural()?;
        Some((tree, placed.flags, placed.local(ray)))
    }

    /// Proves the structure, not its BLASes.
    pub fn validate(&self) -> Result<ValidationReport, BvhDefect> {
        let report = validate::tree(
            &self.tree,
            self.instances.len() as u32,
            self.stats.primitives,
            BoxLeaves::HALF_LINES,
            |value| {
                let instance = &self.instances[value as usize];
                let bounds = placed_bounds(instance, &self.blases, Blas::triangle_bounds);
                // Empty after an update to where it cannot be hit.
                if bounds.is_empty() { vec![] } else { vec![(value, bounds)] }
            },
        )?;
        match &self.procedural {
            Some(procedural) => procedural.validate(&self.blases, &self.instances, report),
            None => Ok(report),
        }
    }
}

/// By how much the boxes of instances are widened for a ray, given the greatest κ and coordinate.
#[inline(always)]
pub(crate) fn slack(ray: &Ray, condition: f32, reach: f32) -> f32 {
    let slack =
        4.0 * f32::EPSILON * condition * (2.0 * ray.origin.abs().max_element() + 2.0 * reach);
    // Transforms may be as bad as `f32` goes, but offsets of planes must be finite: an infinite
    // one would meet the empty slots of nodes. This much holds every origin and every box.
    slack.min(MAX_SLACK)
}

/// The box in the world of what an instance holds, given what that is in its BLAS; empty if it cannot be
/// hit.
pub(crate) fn placed_bounds(
    instance: &Instance,
    blases: &[Arc<Blas>],
    bounds_of: fn(&Blas) -> Aabb,
) -> Aabb {
    blases
        .get(instance.blas as usize)
        .map_or(Aabb::EMPTY, |blas| place(instance, &bounds_of(blas)).bounds)
}

/// The inverse of an instance's transform, the box in the world of what is in this one, and its κ.
pub(crate) fn place(instance: &Instance, object_bounds: &Aabb) -> Placement {
    let never = Placement { inverse: Affine3A::ZERO, bounds: Aabb::EMPTY, condition: 1.0 };
    let to_world = DAffine3::from_cols(
        Vec3::from(instance.transform.matrix3.x_axis).as_dvec3(),
        Vec3::from(instance.transform.matrix3.y_axis).as_dvec3(),
        Vec3::from(instance.transform.matrix3.z_axis).as_dvec3(),
        Vec3::from(instance.transform.translation).as_dvec3(),
    );
    let to_object = to_world.inverse();
    let inverse = Affine3A::from_cols(
        to_object.matrix3.x_axis.as_vec3().into(),
        to_object.matrix3.y_axis.as_vec3().into(),
        to_object.matrix3.z_axis.as_vec3().into(),
        to_object.translation.as_vec3().into(),
    );
    if !to_world.is_finite() || !inverse.is_finite() {
        return never;
    }
    // Without triangles there may still be procedural primitives, whose rays need the inverse.
    if object_bounds.is_empty() {
        return Placement { inverse, ..never };
    }
    let bounds = world_bounds(object_bounds, &to_world);
    if !is_traceable(&bounds) {
        return Placement { inverse, ..never };
    }
    let product = abs(&to_world.matrix3) * abs(&to_object.matrix3);
    let rows = product * DVec3::ONE;
    Placement { inverse, bounds, condition: rows.max_element() as f32 }
}

fn abs(matrix: &DMat3) -> DMat3 {
    DMat3::from_cols(matrix.x_axis.abs(), matrix.y_axis.abs(), matrix.z_axis.abs())
}

/// The box around a transformed box, rounded outwards.
fn world_bounds(bounds: &Aabb, to_world: &DAffine3) -> Aabb {
    let (lower, upper) = (bounds.lower.as_dvec3(), bounds.upper.as_dvec3());
    let centre = to_world.transform_point3(0.5 * (lower + upper));
    let half = abs(&to_world.matrix3) * (0.5 * (upper - lower));
    let (least, greatest) = (centre - half, centre + half);
    Aabb { lower: least.as_vec3().map(f32::next_down), upper: greatest.as_vec3().map(f32::next_up) }
}

impl Structure for Tlas {
    const TWO_LEVEL: bool = true;

    fn isa_level(&self) -> IsaLevel {
        self.isa
    }

    #[inline(always)]
    fn trace<I: Isa, Q: Query, F: CandidateFilter, C: Count>(
        &self,
        isa: I,
        asker: &Asker<'_, F>,
        options: &TraceOptions,
        stacks: &mut Stacks,
        query: &mut Q,
        count: &mut C,
    ) -> ControlFlow<()> {
        let ray: &Ray = asker.ray;
        let Stacks { top, bottom } = stacks;
        let Some(world) = self.prepare(ray) else {
            return ControlFlow::Continue(());
        };
        let mut span = world.span(ray.t_min, query.t_max());
        let mut leaves = Entered { isa, tlas: self, world: &world, options, asker, bottom, query };
        let tree = self.tree.view();
        // SAFETY: the tree is borrowed.
        unsafe {
            if Q::ORDERED {
                walk::<I, C, true>(isa, tree, &world.slab, &mut span, top, count, &mut leaves)
            } else {
                walk::<I, C, false>(isa, tree, &world.slab, &mut span, top, count, &mut leaves)
            }
        }
    }

    #[inline(always)]
    fn finish(&self, closest: &Closest) -> Hit {
        closest.finish(|instance, triangle| {
            let instance = &self.instances[instance as usize];
            self.blases[instance.blas as usize].locate(triangle)
        })
    }

    #[inline(always)]
    fn enter_root(&self, ray: &Ray, _: &TraceOptions) -> Option<(PreparedRay, Option<Place<'_>>)> {
        Some((self.prepare(ray)?, None))
    }

    #[inline(always)]
    fn root_view(&self) -> TreeView {
        self.tree.view()
    }

    #[inline(always)]
    fn enter(
        &self,
        instance: u32,
        ray: &Ray,
        world: &PreparedRay,
        options: &TraceOptions,
    ) -> Option<(PreparedRay, Place<'_>)> {
        self.enter_instance(instance, ray, Some(world), options)
    }

    fn stack_entries(&self) -> usize {
        let deepest = self.blases.iter().map(|blas| blas.tree.stack_entries()).max();
        // And the marker between them.
        self.tree.stack_entries() + 1 + deepest.unwrap_or(0)
    }
}

/// The leaves of a TLAS: its instances.
struct Entered<'a, 'b, I, F, Q> {
    isa: I,
    tlas: &'a Tlas,
    world: &'a PreparedRay,
    options: &'a TraceOptions,
    asker: &'a Asker<'b, F>,
    bottom: &'a mut Stack,
    query: &'a mut Q,
}

impl<I: Isa, F: CandidateFilter, Q: Query, C: Count> walk::Leaves<C> for Entered<'_, '_, I, F, Q> {
    #[inline(always)]
    fn visit(&mut self, index: u32, span: &mut Span, count: &mut C) -> ControlFlow<()> {
        let ray = self.asker.ray;
        let entered = self.tlas.enter_instance(index, ray, Some(self.world), self.options);
        if let Some((local, place)) = entered {
            count.instance();
            trace_blas(self.isa, &place, &local, self.asker, self.bottom, self.query, count)?;
        }
        if Q::ORDERED {
            *span = self.world.span(ray.t_min, self.query.t_max());
        }
        ControlFlow::Continue(())
    }
}

/// A TLAS of which only one instance can be hit: rays go straight there.
pub(crate) struct Sole<'a> {
    tlas: &'a Tlas,
    index: u32,
}

impl Sole<'_> {
    fn blas(&self) -> &Blas {
        &self.tlas.blases[self.tlas.instances[self.index as usize].blas as usize]
    }
}

impl Structure for Sole<'_> {
    const TWO_LEVEL: bool = false;
    const IS_INSTANCE: bool = true;

    fn isa_level(&self) -> IsaLevel {
        self.tlas.isa
    }

    #[inline(always)]
    fn trace<I: Isa, Q: Query, F: CandidateFilter, C: Count>(
        &self,
        isa: I,
        asker: &Asker<'_, F>,
        options: &TraceOptions,
        stacks: &mut Stacks,
        query: &mut Q,
        count: &mut C,
    ) -> ControlFlow<()> {
        let Some((prepared, Some(place))) = self.enter_root(asker.ray, options) else {
            return ControlFlow::Continue(());
        };
        count.instance();
        trace_blas(isa, &place, &prepared, asker, &mut stacks.bottom, query, count)
    }

    #[inline(always)]
    fn finish(&self, closest: &Closest) -> Hit {
        closest.finish(|_, triangle| self.blas().locate(triangle))
    }

    #[inline(always)]
    fn enter_root(
        &self,
        ray: &Ray,
        options: &TraceOptions,
    ) -> Option<(PreparedRay, Option<Place<'_>>)> {
        let (prepared, place) = self.tlas.enter_instance(self.index, ray, None, options)?;
        Some((prepared, Some(place)))
    }

    #[inline(always)]
    fn place(&self, options: &TraceOptions) -> Option<Place<'_>> {
        self.tlas.place(self.index, options)
    }

    #[inline(always)]
    fn local(&self, ray: &Ray) -> Ray {
        self.tlas.placed[self.index as usize].local(ray)
    }

    #[inline(always)]
    fn root_view(&self) -> TreeView {
        self.blas().tree.view()
    }

    fn stack_entries(&self) -> usize {
        self.blas().tree.stack_entries()
    }
}
