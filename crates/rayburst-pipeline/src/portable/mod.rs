//! Portable shaders: values in, a payload and the next ray out.
//!
//! A portable shader calls nothing and changes nothing: it takes a hit and a payload by value, and returns
//! the payload and what is to be traced next; an intersection shader returns the hits that it reports. Rays
//! therefore need no stack, and can be traced in batches: a tile of the grid is generated, traced, grouped by
//! record, shaded, traced again, until no ray is left. The same picture comes out as from tracing
//! recursively, several times as fast, and the form is one that languages without recursion and function
//! pointers can express.
//!
//! A ray type is what it is for other pipelines; all have one payload type here.

mod group;
mod procedural;
mod queue;
mod reports;
mod shade;
mod table;

use glam::UVec3;
use rayburst_accel::{Instance, ProceduralCandidate, RayFlags, Tlas};
use rayburst_math::{Hit, Ray};

pub use group::PortableHitGroup;
pub use reports::{MAX_PORTABLE_REPORTS, PortableReport, PortableReports};
pub use table::{PortablePipeline, PortableRayType, PortableTable};

use crate::Barycentrics;

/// A ray to trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceRequest {
    /// Which records the ray finds.
    pub ray_type: PortableRayType,
    /// What the ray asks for. With [`RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH`] any hit may be the first:
    /// if a closest hit shader is to run, it is the nearest one.
    pub flags: RayFlags,
    /// The ray sees instances whose mask shares a bit with this one.
    pub mask: u8,
    /// The ray.
    pub ray: Ray,
}

/// What comes after a shader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Nothing: the payload is finished.
    Done,
    /// Another ray, with the payload that was returned.
    Trace(TraceRequest),
}

/// What a portable shader sees of its launch and ray.
#[derive(Clone, Copy, Debug)]
pub struct PortableRay<'a> {
    /// Index in the grid.
    pub launch_index: UVec3,
    /// Size of the grid.
    pub launch_dimensions: UVec3,
    /// The ray that was traced.
    pub ray: &'a Ray,
    /// Rays that were traced for this launch before.
    pub depth: u32,
}

/// What a portable shader sees of a hit, with attributes `A` and a record `R`.
pub struct PortableHit<'a, A = Barycentrics, R = ()> {
    /// The launch and the ray.
    pub ray: PortableRay<'a>,
    /// The hit.
    pub hit: &'a Hit,
    /// The barycentric coordinates of a triangle, or what the intersection shader reported.
    pub attributes: A,
    /// The data of the record.
    pub record: &'a R,
    pub(crate) tlas: &'a Tlas,
}

impl<A, R> PortableHit<'_, A, R> {
    /// The instance that was hit.
    pub fn instance(&self) -> &Instance {
        &self.tlas.instances()[self.hit.instance as usize]
    }

    /// The structure that rays are traced in.
    pub fn structure(&self) -> &Tlas {
        self.tlas
    }
}

/// What a portable intersection shader sees: a procedural primitive whose box a ray meets, with a record `R`.
pub struct PortableCandidate<'a, R = ()> {
    /// The launch and the ray.
    pub ray: PortableRay<'a>,
    /// The primitive.
    pub primitive: ProceduralCandidate,
    /// Where the interval ends now: at the nearest hit so far.
    pub t_current: f32,
    /// The data of the record.
    pub record: &'a R,
    pub(crate) tlas: &'a Tlas,
}

impl<R> PortableCandidate<'_, R> {
    /// The ray in the instance's space, up to the nearest hit so far; `t` means the same there.
    pub fn object_ray(&self) -> Ray {
        let to_object = self.tlas.world_to_object(self.primitive.instance);
        let ray = self.ray.ray;
        Ray {
            origin: to_object.transform_point3(ray.origin),
            direction: to_object.transform_vector3(ray.direction),
            t_min: ray.t_min,
            t_max: self.t_current,
        }
    }

    /// The primitive's instance.
    pub fn instance(&self) -> &Instance {
        &self.tlas.instances()[self.primitive.instance as usize]
    }

    /// The structure that rays are traced in.
    pub fn structure(&self) -> &Tlas {
        self.tlas
    }
}
