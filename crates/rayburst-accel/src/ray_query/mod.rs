//! Inline ray tracing: a query that stops at what it cannot decide, and goes on when it is told to.
//!
//! After the `RayQuery` of Microsoft's DirectX Raytracing (DXR) functional specification, version 1.1,
//! on the same trees as all other queries: first that of triangles, then that of procedural primitives.

mod advance;
mod candidate;
mod committed;

pub use candidate::CandidateType;
pub use committed::CommittedStatus;

use glam::{Affine3A, Vec3};
use rayburst_math::{Hit, Ray};

use self::{
    advance::{Inside, Stage},
    candidate::Candidate,
};
use crate::{
    Blas, RayFlags, Tlas, TraceOptions,
    structure::Structure,
    traverse::{prepare::PreparedRay, walk::Cursor},
};

/// One ray on its way through a structure (DXR's `RayQuery`), in the hands of the caller.
///
/// [`RayQuery::proceed`] searches until something needs a decision: a triangle that is not opaque, or
/// the box of a procedural primitive. That is the *candidate*; the caller looks at it, commits a hit or
/// does not, and goes on. Opaque triangles are committed on the way. Once `proceed` returns `false`, what
/// is committed is the answer.
///
/// What holds beside the rules of the crate:
/// - Triangles are met at `t_min < t < t_max`, as in DXR and other than in all other queries; hits of
///   procedural primitives may be at either end.
/// - A hit is committed if it precedes the one that is ([`Hit::precedes`]): at equal `t` the smallest
///   `(instance, geometry, primitive)` wins, whatever the order of candidates, which is unspecified.
/// - With [`RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH`] the first hit that is committed is the answer.
/// - After spatial splits ([`Blas::may_ask_twice`]) a triangle that was not committed may be a candidate
///   again, even of geometry with `no_duplicate_any_hit`: a query keeps no list of what it has shown. Whoever
///   must not count a triangle twice keeps one, or builds without splits. One that was committed never is,
///   and a box is a candidate once, though it may be barely missed.
/// - Calls at the wrong time do nothing or return `None`.
///
/// A query takes about 8 KiB, most of it not initialised, and allocates nothing;
/// [`RayQuery::restart`] uses it for the next ray.
///
/// ```
/// use std::sync::Arc;
///
/// use glam::{Affine3A, Vec3};
/// use rayburst_accel::{
///     Blas, BuildError, BuildOptions, CandidateType, CommittedStatus, Instance, ProceduralBoxes,
///     RayFlags, RayQuery, Tlas, TriangleMesh,
/// };
/// use rayburst_math::{Aabb, Ray};
///
/// // A square whose lower left half is cut out, in front of a sphere.
/// let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
/// let positions = corners.map(Vec3::from);
/// let square = TriangleMesh::new(&positions, &[[0, 1, 2], [3, 2, 1]]);
/// let square = TriangleMesh { opaque: false, ..square };
/// let bounds = [Aabb { lower: Vec3::new(-1.0, -1.0, 2.0), upper: Vec3::new(1.0, 1.0, 4.0) }];
/// let sphere = ProceduralBoxes::new(&bounds);
/// let options = BuildOptions::default();
/// let blas = Blas::of_geometries(&[square.into(), sphere.into()], &options)?;
/// let instance = Instance::new(0, Affine3A::from_scale(Vec3::splat(2.0)));
/// let tlas = Tlas::build(vec![Arc::new(blas)], &[instance], &options)?;
///
/// let trace = |x: f32, y: f32| {
///     let ray = Ray::new(Vec3::new(x, y, -1.0), Vec3::Z);
///     let mut query = RayQuery::new(&tlas, RayFlags::empty(), 0xFF, &ray);
///     while query.proceed() {
///         match query.candidate_type() {
///             Some(CandidateType::NonOpaqueTriangle) => {
///                 // Alpha: nothing of the first triangle is there.
///                 if query.candidate_primitive_index() == Some(1) {
///                     query.commit_non_opaque_triangle_hit();
///                 }
///             }
///             Some(CandidateType::ProceduralPrimitive) => {
///                 // A sphere of radius 1 around (0, 0, 3) in object space.
///                 let origin = query.candidate_object_ray_origin().unwrap();
///                 let direction = query.candidate_object_ray_direction().unwrap();
///                 let from = origin - Vec3::new(0.0, 0.0, 3.0);
///                 let (a, b) = (direction.length_squared(), from.dot(direction));
///                 let root = (b * b - a * (from.length_squared() - 1.0)).sqrt();
///                 // NaN, where it is missed, is no hit.
///                 query.commit_procedural_primitive_hit((-b - root) / a);
///             }
///             None => (),
///         }
///     }
///     (query.committed_status(), query.committed_ray_t())
/// };
/// assert_eq!(trace(0.5, 0.5), (CommittedStatus::TriangleHit, 1.0));
/// let (status, t) = trace(-0.2, -0.2);
/// assert_eq!(status, CommittedStatus::ProceduralPrimitiveHit);
/// assert!((t - (7.0 - 3.92_f32.sqrt())).abs() < 1e-5);
/// assert_eq!(trace(-1.9, -1.9), (CommittedStatus::Nothing, f32::INFINITY));
/// # Ok::<(), BuildError>(())
/// ```
pub struct RayQuery<'a> {
    root: Root<'a>,
    flags: RayFlags,
    options: TraceOptions,
    ray: Ray,
    candidate: Option<Candidate>,
    /// A miss as long as nothing is committed.
    committed: Hit,
    stage: Stage,
    /// The ray among instances, if it is there in this stage.
    world: Option<PreparedRay>,
    /// The tree in which it is now.
    inside: Inside<'a>,
    /// The leaf of triangles in which it is now, and the lanes that are left of it.
    leaf: u32,
    lanes: u32,
    /// Where it is among instances, and in the tree of one.
    top: Cursor,
    bottom: Cursor,
}

/// What is traced.
#[derive(Clone, Copy)]
enum Root<'a> {
    Blas(&'a Blas),
    Tlas(&'a Tlas),
}

impl<'a> RayQuery<'a> {
    /// A query of a ray among instances (DXR's `TraceRayInline`); those whose mask shares no bit with
    /// `mask` are skipped. Nothing is searched yet.
    #[inline]
    pub fn new(tlas: &'a Tlas, flags: RayFlags, mask: u8, ray: &Ray) -> Self {
        Self::of_root(Root::Tlas(tlas), flags, mask, ray)
    }

    /// A query of one BLAS, as if it were the only instance, with the index and the number 0.
    #[inline]
    pub fn of_blas(blas: &'a Blas, flags: RayFlags, ray: &Ray) -> Self {
        Self::of_root(Root::Blas(blas), flags, 0xFF, ray)
    }

    #[inline]
    fn of_root(root: Root<'a>, flags: RayFlags, mask: u8, ray: &Ray) -> Self {
        Self {
            root,
            flags,
            options: flags.options(mask),
            ray: *ray,
            candidate: None,
            committed: Hit::MISS,
            stage: Stage::Begin,
            world: None,
            inside: Inside::Nothing,
            leaf: 0,
            lanes: 0,
            top: Cursor::new(),
            bottom: Cursor::new(),
        }
    }

    /// Forgets the ray and all of its hits for a new one in the same structure; a BLAS has no mask.
    #[inline]
    pub fn restart(&mut self, flags: RayFlags, mask: u8, ray: &Ray) {
        (self.flags, self.options, self.ray) = (flags, flags.options(mask), *ray);
        (self.candidate, self.committed) = (None, Hit::MISS);
        self.stage = Stage::Begin;
        self.leave();
    }

    /// Searches on until there is a candidate; `false` if the search is over, for good.
    #[inline]
    pub fn proceed(&mut self) -> bool {
        self.candidate = None;
        if self.stage == Stage::Ended {
            return false;
        }
        let isa = match self.root {
            Root::Blas(blas) => blas.isa_level(),
            Root::Tlas(tlas) => tlas.isa_level(),
        };
        isa.dispatch(advance::Advance(self))
    }

    /// Ends the search: what is committed is the answer.
    #[inline]
    pub fn abort(&mut self) {
        self.stage = Stage::Ended;
    }

    /// The flags it was started with.
    pub fn ray_flags(&self) -> RayFlags {
        self.flags
    }

    /// The ray it was started with, in the world (DXR's `WorldRayOrigin`, `WorldRayDirection`,
    /// `RayTMin`).
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    /// Where the interval ends now.
    #[inline(always)]
    fn t_max(&self) -> f32 {
        if self.committed.is_hit() { self.committed.t } else { self.ray.t_max }
    }

    /// Commits a hit within the interval, if the search is not over and the hit precedes the one that is
    /// committed; returns whether it was.
    #[inline(always)]
    fn commit(&mut self, hit: &Hit) -> bool {
        let better = self.is_better(hit) && self.stage != Stage::Ended;
        if better {
            self.committed = *hit;
            if self.flags.contains(RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH) {
                self.abort();
            }
        }
        better
    }

    #[inline(always)]
    fn is_better(&self, hit: &Hit) -> bool {
        !self.committed.is_hit() || hit.precedes(&self.committed)
    }

    fn instance_id(&self, instance: u32) -> u32 {
        match self.root {
            Root::Blas(_) => 0,
            Root::Tlas(tlas) => tlas.instances()[instance as usize].id,
        }
    }

    fn contribution(&self, instance: u32) -> u32 {
        match self.root {
            Root::Blas(_) => 0,
            Root::Tlas(tlas) => tlas.instances()[instance as usize].contribution,
        }
    }

    fn object_to_world(&self, instance: u32) -> Affine3A {
        match self.root {
            Root::Blas(_) => Affine3A::IDENTITY,
            Root::Tlas(tlas) => tlas.object_to_world(instance),
        }
    }

    fn world_to_object(&self, instance: u32) -> Affine3A {
        match self.root {
            Root::Blas(_) => Affine3A::IDENTITY,
            Root::Tlas(tlas) => tlas.world_to_object(instance),
        }
    }

    fn object_ray_origin(&self, instance: u32) -> Vec3 {
        match self.root {
            Root::Blas(_) => self.ray.origin,
            Root::Tlas(_) => self.world_to_object(instance).transform_point3(self.ray.origin),
        }
    }

    fn object_ray_direction(&self, instance: u32) -> Vec3 {
        match self.root {
            Root::Blas(_) => self.ray.direction,
            Root::Tlas(_) => self.world_to_object(instance).transform_vector3(self.ray.direction),
        }
    }
}

impl std::fmt::Debug for RayQuery<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { flags, ray, stage, candidate, committed, .. } = self;
        f.debug_struct("RayQuery")
            .field("flags", flags)
            .field("ray", ray)
            .field("stage", stage)
            .field("candidate", candidate)
            .field("committed", committed)
            .finish_non_exhaustive()
    }
}
