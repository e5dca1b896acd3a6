//! What shaders see: DXR's system values, and what a shader of a type may do. What it may not do has no
//! method: `trace_ray` and `call_shader` are absent where DXR forbids them, so breaking the rule does not
//! compile.

use std::{any::Any, marker::PhantomData};

use bytemuck::Pod;
use glam::{Affine3A, UVec3, Vec3};
use rayburst_accel::{Instance, RayFlags, Tlas};
use rayburst_math::{Hit, Ray};

use crate::{
    AnyHitResult, CallableId, DispatchError, RayType,
    call::{Call, TracedRay},
    procedural::{Reports, words_of},
};

/// Methods of every shader type.
macro_rules! launch_values {
    () => {
        /// Index in the grid (DXR's `DispatchRaysIndex`).
        pub fn launch_index(&self) -> UVec3 {
            self.call.launch_index
        }

        /// Size of the grid (DXR's `DispatchRaysDimensions`).
        pub fn launch_dimensions(&self) -> UVec3 {
            self.call.dispatch.dimensions
        }
    };
}

/// Methods of shader types that may trace and call.
macro_rules! calls {
    () => {
        /// Traces a ray of a type in the dispatch's structure (DXR's `TraceRay`): any hit, intersection,
        /// then closest hit or miss shaders run before it returns, and change the payload.
        ///
        /// `mask` and an instance's mask must share a bit. The direction may have any length; `t` is in
        /// units of it. Triangles are hit for `t_min < t < t_max`, procedural primitives for `t_min ≤ t ≤
        /// t_max`. An invalid ray ([`Ray::is_valid`]) misses. At the declared depth of recursion nothing
        /// is traced, the payload stays, and the dispatch fails.
        pub fn trace_ray<P: 'static>(
            &self,
            ray_type: RayType<P>,
            flags: RayFlags,
            mask: u8,
            ray: &Ray,
            payload: &mut P,
        ) {
            let pipeline = self.call.dispatch.pipeline;
            match pipeline.ray_types.get(pipeline.identity.index(ray_type.key)) {
                Some(info) => crate::trace::trace_ray(&self.call, info, flags, mask, ray, payload),
                None => self.call.fail(|launch| DispatchError::OtherPipeline {
                    launch,
                    payload: std::any::type_name::<P>(),
                }),
            }
        }

        /// How many more rays may be traced inside each other from here.
        pub fn remaining_depth(&self) -> u32 {
            self.call.remaining_depth()
        }

        /// The structure that rays are traced in, for queries without shaders.
        pub fn structure(&self) -> &Tlas {
            self.call.dispatch.tlas
        }

        /// Calls a callable shader (DXR's `CallShader`) and returns when it has.
        pub fn call_shader<D: 'static>(&self, shader: CallableId<D>, data: &mut D) {
            crate::call::call_shader(&self.call, shader, data);
        }
    };
}

/// Methods of shader types that belong to a ray.
macro_rules! ray_values {
    () => {
        /// The ray as traced (DXR's `WorldRayOrigin`, `WorldRayDirection`, `RayTMin`); its `t_max` is that
        /// of the call.
        pub fn world_ray(&self) -> &Ray {
            &self.ray.ray
        }

        /// Flags of the call (DXR's `RayFlags`).
        pub fn ray_flags(&self) -> RayFlags {
            self.ray.flags
        }
    };
}

/// Methods of shader types that belong to an instance.
macro_rules! instance_values {
    ($primitive:ident) => {
        /// Index of the primitive in its geometry.
        pub fn primitive_index(&self) -> u32 {
            self.$primitive.primitive
        }

        /// Index of the geometry in its BLAS.
        pub fn geometry_index(&self) -> u32 {
            self.$primitive.geometry
        }

        /// Index of the instance in the TLAS.
        pub fn instance_index(&self) -> u32 {
            self.$primitive.instance
        }

        /// The number that the instance was given (DXR's `InstanceID`).
        pub fn instance_id(&self) -> u32 {
            self.instance().id
        }

        fn instance(&self) -> &Instance {
            &self.call.dispatch.tlas.instances()[self.$primitive.instance as usize]
        }

        /// From the instance's space to the world.
        pub fn object_to_world(&self) -> Affine3A {
            self.call.dispatch.tlas.object_to_world(self.$primitive.instance)
        }

        /// From the world to the instance's space.
        pub fn world_to_object(&self) -> Affine3A {
            self.call.dispatch.tlas.world_to_object(self.$primitive.instance)
        }

        /// The ray in the instance's space (DXR's `ObjectRayOrigin`, `ObjectRayDirection`); `t` means the
        /// same there.
        pub fn object_ray(&self) -> Ray {
            let to_object = self.world_to_object();
            Ray {
                origin: to_object.transform_point3(self.ray.ray.origin),
                direction: to_object.transform_vector3(self.ray.ray.direction),
                ..self.ray.ray
            }
        }
    };
}

/// Methods of shader types that look at a hit.
macro_rules! hit_values {
    () => {
        /// Distance of the hit in units of the ray's direction (DXR's `RayTCurrent`).
        pub fn t(&self) -> f32 {
            self.hit.t
        }

        /// Where the ray meets the primitive, in the world.
        pub fn world_position(&self) -> Vec3 {
            self.ray.ray.at(self.hit.t)
        }

        /// What was hit (DXR's `HitKind`): 254 and 255 for front and back faces of triangles, what the
        /// intersection shader reported otherwise.
        pub fn hit_kind(&self) -> u8 {
            self.hit.kind.code()
        }

        /// Whether the front face of a triangle was hit.
        pub fn is_front_face(&self) -> bool {
            self.hit.kind == rayburst_math::HitKind::TRIANGLE_FRONT
        }

        /// The corners of the triangle that was hit, in the instance's space (DXR's
        /// `TriangleObjectPositions`); `None` if it was a procedural primitive. The first call for a BLAS
        /// makes an index of four bytes a triangle.
        pub fn triangle(&self) -> Option<[Vec3; 3]> {
            let tlas = self.call.dispatch.tlas;
            let blas = &tlas.blases()[self.instance().blas as usize];
            blas.triangle(self.hit.geometry, self.hit.primitive)
        }

        /// A normal of the instance's space in the world, of length one: by the inverse transpose of the
        /// instance's transform, so that it stays at right angles to the surface under scales and shears, and
        /// on its side under mirrors. Zero if the normal is zero or not finite.
        pub fn normal_to_world(&self, normal: Vec3) -> Vec3 {
            let to_object = self.world_to_object().matrix3;
            (to_object.transpose() * normal).normalize_or_zero()
        }

        /// The hit as plain data.
        pub fn hit(&self) -> &Hit {
            self.hit
        }

        /// The attributes: [`crate::Barycentrics`] of a triangle, or what the intersection shader reported.
        pub fn attributes(&self) -> A {
            self.attributes
        }

        /// The data of the hit group's record in the shader table.
        pub fn record(&self) -> &R {
            self.record
        }
    };
}

/// What a ray generation shader sees.
pub struct RayGeneration<'a> {
    pub(crate) call: Call<'a>,
}

impl RayGeneration<'_> {
    launch_values!();
    calls!();
}

/// What a closest hit shader sees, of attributes `A` and a record `R`.
pub struct ClosestHit<'a, A, R> {
    pub(crate) call: &'a Call<'a>,
    pub(crate) ray: &'a TracedRay,
    pub(crate) hit: &'a Hit,
    pub(crate) attributes: A,
    pub(crate) record: &'a R,
}

impl<A: Copy, R> ClosestHit<'_, A, R> {
    launch_values!();
    calls!();
    ray_values!();
    instance_values!(hit);
    hit_values!();
}

/// What a miss shader sees.
pub struct Miss<'a> {
    pub(crate) call: &'a Call<'a>,
    pub(crate) ray: &'a TracedRay,
}

impl Miss<'_> {
    launch_values!();
    calls!();
    ray_values!();
}

/// What an any hit shader sees, of attributes `A` and a record `R`. It decides whether the ray stops, in no
/// particular order of hits, and may change the payload even of hits that it ignores.
pub struct AnyHit<'a, A, R> {
    pub(crate) call: &'a Call<'a>,
    pub(crate) ray: &'a TracedRay,
    pub(crate) hit: &'a Hit,
    pub(crate) attributes: A,
    pub(crate) record: &'a R,
}

impl<A: Copy, R> AnyHit<'_, A, R> {
    launch_values!();
    ray_values!();
    instance_values!(hit);
    hit_values!();

    /// The ray passes (DXR's `IgnoreHit`).
    pub fn ignore_hit(&self) -> AnyHitResult {
        AnyHitResult::Ignore
    }

    /// The ray stops here unless it stops before.
    pub fn accept_hit(&self) -> AnyHitResult {
        AnyHitResult::Accept
    }

    /// The ray stops here, even if it would have stopped before (DXR's `AcceptHitAndEndSearch`).
    pub fn accept_hit_and_end_search(&self) -> AnyHitResult {
        AnyHitResult::AcceptAndEndSearch
    }
}

/// What an intersection shader sees, of attributes `A`, a payload `P` that it may only read, and a record `R`.
pub struct Intersection<'a, 'b, P, A, R> {
    pub(crate) call: &'a Call<'a>,
    pub(crate) ray: &'a TracedRay,
    pub(crate) candidate: rayburst_accel::ProceduralCandidate,
    pub(crate) record: &'a R,
    pub(crate) reports: &'a mut Reports<'b>,
    pub(crate) types: PhantomData<fn(&P, A)>,
}

impl<P: 'static, A: Pod, R> Intersection<'_, '_, P, A, R> {
    launch_values!();
    ray_values!();
    instance_values!(candidate);

    /// Where the interval ends now (DXR's `RayTCurrent`): at the nearest hit so far.
    pub fn t_current(&self) -> f32 {
        self.reports.t_max
    }

    /// Reports a hit (DXR's `ReportHit`): its distance in units of the ray's direction, a kind of 0 to 127
    /// (greater bits are dropped) and its attributes. Runs the any hit shader if the primitive is not
    /// opaque. True if the hit was accepted: it lies in the interval, and no any hit shader ignored it.
    ///
    /// Where an any hit shader ends the search, DXR ends this shader too; here it goes on, and what it
    /// reports later is not accepted.
    pub fn report_hit(&mut self, t: f32, kind: u8, attributes: A) -> bool {
        self.reports.report(t, kind, words_of(&attributes))
    }

    /// The payload, which this shader must not change.
    ///
    /// `None` only if the pipeline's checks were evaded by payloads of other types.
    pub fn payload(&self) -> Option<&P> {
        (self.reports.payload as &dyn Any).downcast_ref()
    }

    /// The data of the hit group's record in the shader table.
    pub fn record(&self) -> &R {
        self.record
    }
}

/// What a callable shader sees. It may call others, but not trace.
pub struct Callable<'a> {
    pub(crate) call: Call<'a>,
}

impl Callable<'_> {
    launch_values!();

    /// Calls another callable shader, or itself: up to 31 deep, beyond which the dispatch fails.
    pub fn call_shader<D: 'static>(&self, shader: CallableId<D>, data: &mut D) {
        crate::call::call_shader(&self.call, shader, data);
    }
}
