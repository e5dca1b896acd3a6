//! A top-level structure: instances of BLASes in the world.
//!
//! A ray is transformed into an instance's space without normalising, so `t` keeps its meaning. The
//! transform is wrong by rounding: a point `p` of the ray, with `W` the inverse rounded to `f32`,
//! ends up off by at most `5ε(|W|(|o| + |p − o|) + |W·T|)` in object space, which is
//! `5ε·κ·(|o| + |p − o| + |T|)` in the world with `κ = ‖|M||W|‖∞` (1 without rotation, at most 3 for
//! rotations). Traversal widens the instances' boxes by `8ε` times that, so an instance that the
//! transformed ray hits is never skipped.

use std::{ops::ControlFlow, sync::Arc, time::Instant};

use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3};
use rayburst_math::{Aabb, Hit, Ray};
use rayburst_simd::{Isa, IsaLevel};
use rayon::prelude::*;

use crate::{
    Blas, BuildError, BuildOptions, BuildStats, BvhDefect, CandidateFilter, Instance,
    InstanceFlags, TraceOptions, ValidationReport,
    build::{
        binned_sah::BinnedSah,
        monitor::Monitor,
        primitives::{MAX_PRIMITIVES, PrimitiveRef, is_traceable},
    },
    layout::bvh8::{Bvh8, Leaves},
    structure::{Stacks, Structure},
    traverse::{
        closest::Closest,
        count::Count,
        prepare::PreparedRay,
        query::{Asker, Place, Query, trace_blas},
        walk::{Stack, walk},
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
    stats: BuildStats,
    isa: IsaLevel,
}

/// What a ray needs to know of an instance.
#[derive(Clone, Copy, Debug)]
struct Placed {
    inverse: Affine3A,
    blas: u32,
    mask: u8,
    flags: InstanceFlags,
    /// Whether the instance's space is the world.
    identity: bool,
}

/// What the world needs to know of an instance.
struct Placement {
    inverse: Affine3A,
    /// Empty if the instance cannot be hit.
    bounds: Aabb,
    condition: f32,
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
        if instances.len() > MAX_PRIMITIVES {
            let (count, limit) = (instances.len(), MAX_PRIMITIVES);
            return Err(BuildError::TooMany { what: "instances", count, limit });
        }
        let unknown = |instance: &Instance| instance.blas as usize >= blases.len();
        if let Some(index) = instances.iter().position(unknown) {
            return Err(BuildError::NoSuchBlas {
                instance: index as u32,
                blas: instances[index].blas,
                blases: blases.len(),
            });
        }
        let placements: Vec<Placement> = instances
            .par_iter()
            .with_min_len(256)
            .map(|instance| place(instance, &blases[instance.blas as usize]))
            .collect();
        let placed = || placements.iter().enumerate().filter(|(_, p)| !p.bounds.is_empty());
        let refs: Vec<PrimitiveRef> =
            placed().map(|(i, p)| PrimitiveRef::new(&p.bounds, i as u32)).collect();
        let condition = placed().map(|(_, p)| p.condition).fold(1.0, f32::max);
        let translation = placed()
            .map(|(i, _)| Vec3::from(instances[i].transform.translation).abs().max_element())
            .fold(0.0, f32::max);

        let primitives = refs.len();
        let sole = refs.first().filter(|_| primitives == 1).map(PrimitiveRef::index);
        let binary =
            BinnedSah { bins: 16, leaf_size: 1, monitor: Monitor::default() }.build(refs)?;
        let tree = Bvh8::collapse(&binary, &InstanceLeaves)?;
        let bounds = tree.bounds;
        let corner = if bounds.is_empty() {
            0.0
        } else {
            bounds.lower.abs().max(bounds.upper.abs()).max_element()
        };
        let placed: Vec<_> = placements
            .iter()
            .zip(instances)
            .map(|(placement, instance)| Placed {
                inverse: placement.inverse,
                blas: instance.blas,
                mask: instance.mask,
                flags: instance.flags,
                identity: instance.transform == Affine3A::IDENTITY,
            })
            .collect();
        let stats = BuildStats {
            primitives,
            inactive: instances.len() - primitives,
            references: primitives,
            nodes: tree.shape.nodes,
            leaves: tree.shape.leaves,
            depth: tree.shape.depth,
            sah_cost: tree.shape.sah_cost,
            bytes: tree.bytes() + size_of_val(instances) + size_of_val(placed.as_slice()),
            seconds: begin.elapsed().as_secs_f64(),
        };
        Ok(Self {
            tree,
            blases,
            instances: instances.to_vec(),
            placed,
            sole,
            condition,
            reach: corner.max(translation),
            stats,
            isa,
        })
    }

    /// What the build made.
    pub fn stats(&self) -> BuildStats {
        self.stats
    }

    /// The box around all instances that can be hit, in the world; empty if there are none.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds
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

    /// Asks a query of one instance; `world` is the ray as prepared for all of them.
    #[inline(always)]
    fn enter<I: Isa, Q: Query, F: CandidateFilter, C: Count>(
        &self,
        isa: I,
        index: u32,
        world: Option<&PreparedRay>,
        asker: &Asker<'_, F>,
        options: &TraceOptions,
        stack: &mut Stack,
        query: &mut Q,
        count: &mut C,
    ) -> ControlFlow<()> {
        let placed = &self.placed[index as usize];
        if placed.mask & options.mask == 0 {
            return ControlFlow::Continue(());
        }
        count.instance();
        let blas = &*self.blases[placed.blas as usize];
        let place = Place::new(blas, index, placed.flags, options);
        let local;
        let prepared = match world {
            // Prepared for a larger box: as conservative as need be.
            Some(world) if placed.identity => world,
            _ => {
                let origin = placed.inverse.transform_point3(asker.ray.origin);
                let direction = placed.inverse.transform_vector3(asker.ray.direction);
                let ray = Ray { origin, direction, ..*asker.ray };
                let bounds = blas.bounds();
                match PreparedRay::new(origin, direction, &bounds, 0.0) {
                    Some(prepared) if ray.is_valid() => local = prepared,
                    _ => return ControlFlow::Continue(()),
                }
                &local
            }
        };
        trace_blas(isa, &place, prepared, asker, stack, query, count)
    }

    /// Proves the structure, not its BLASes.
    pub fn validate(&self) -> Result<ValidationReport, BvhDefect> {
        validate::tree(
            &self.tree,
            self.instances.len() as u32,
            self.stats.primitives,
            InstanceLeaves::HALF_LINES,
            |value| {
                let instance = &self.instances[value as usize];
                vec![(value, place(instance, &self.blases[instance.blas as usize]).bounds)]
            },
        )
    }
}

/// The inverse of an instance's transform, its box in the world, and its κ.
fn place(instance: &Instance, blas: &Blas) -> Placement {
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
    if blas.bounds().is_empty() || !to_world.is_finite() || !inverse.is_finite() {
        return never;
    }
    let bounds = world_bounds(&blas.bounds(), &to_world);
    if !is_traceable(&bounds) {
        return never;
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

/// Leaves that are instances: the reference says which, and nothing is stored.
struct InstanceLeaves;

impl Leaves for InstanceLeaves {
    const HALF_LINES: usize = 0;

    fn place(&self, primitives: &[u32], _: u32) -> u32 {
        primitives[0]
    }

    fn write(&self, _: &[u32], _: &mut [u32]) {}
}

impl Structure for Tlas {
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
        if let Some(index) = self.sole {
            return self.enter(isa, index, None, asker, options, bottom, query, count);
        }
        let slack = 4.0
            * f32::EPSILON
            * self.condition
            * (2.0 * ray.origin.abs().max_element() + 2.0 * self.reach);
        let bounds = &self.tree.bounds;
        let Some(world) = PreparedRay::new(ray.origin, ray.direction, bounds, slack) else {
            return ControlFlow::Continue(());
        };
        let mut span = world.span(ray.t_min, query.t_max());
        let leaf = |index: u32, span: &mut _, count: &mut C| {
            self.enter(isa, index, Some(&world), asker, options, bottom, query, count)?;
            if Q::ORDERED {
                *span = world.span(ray.t_min, query.t_max());
            }
            ControlFlow::Continue(())
        };
        if Q::ORDERED {
            walk::<I, C, true>(isa, &self.tree, &world.slab, &mut span, top, count, leaf)
        } else {
            walk::<I, C, false>(isa, &self.tree, &world.slab, &mut span, top, count, leaf)
        }
    }

    #[inline(always)]
    fn finish(&self, closest: &Closest) -> Hit {
        closest.finish(|instance, triangle| {
            let instance = &self.instances[instance as usize];
            self.blases[instance.blas as usize].locate(triangle)
        })
    }
}
