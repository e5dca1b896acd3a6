//! What is committed.

use glam::{Affine3A, Vec2, Vec3};
use rayburst_math::{Hit, HitKind};

use super::RayQuery;

/// What is committed (DXR's `COMMITTED_STATUS`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CommittedStatus {
    /// Nothing yet, or a miss if the search is over.
    Nothing,
    /// A hit of a triangle.
    TriangleHit,
    /// A hit of a procedural primitive.
    ProceduralPrimitiveHit,
}

/// What is committed, at any time; the answer once the search is over.
impl RayQuery<'_> {
    /// What it is.
    pub fn committed_status(&self) -> CommittedStatus {
        if !self.committed.is_hit() {
            CommittedStatus::Nothing
        } else if self.committed.kind.is_procedural() {
            CommittedStatus::ProceduralPrimitiveHit
        } else {
            CommittedStatus::TriangleHit
        }
    }

    /// The hit, or [`Hit::MISS`]; of a procedural primitive its kind is `HitKind::procedural(0)`.
    pub fn committed(&self) -> Hit {
        self.committed
    }

    /// Where the interval ends: at the hit, or at the ray's `t_max` if there is none.
    pub fn committed_ray_t(&self) -> f32 {
        self.t_max()
    }

    fn hit(&self) -> Option<&Hit> {
        Some(&self.committed).filter(|hit| hit.is_hit())
    }

    fn triangle_hit(&self) -> Option<&Hit> {
        Some(&self.committed).filter(|hit| hit.kind.is_triangle())
    }

    /// The barycentric coordinates of the second and third vertex; `None` if it is no triangle.
    pub fn committed_triangle_barycentrics(&self) -> Option<Vec2> {
        self.triangle_hit().map(|hit| Vec2::new(hit.u, hit.v))
    }

    /// Whether the front of the triangle is seen; `None` if it is none.
    pub fn committed_triangle_front_face(&self) -> Option<bool> {
        self.triangle_hit().map(|hit| hit.kind == HitKind::TRIANGLE_FRONT)
    }

    /// The index of the instance; like all that follow `None` if nothing is committed.
    pub fn committed_instance_index(&self) -> Option<u32> {
        self.hit().map(|hit| hit.instance)
    }

    /// The number of the instance, [`crate::Instance::id`].
    pub fn committed_instance_id(&self) -> Option<u32> {
        self.hit().map(|hit| self.instance_id(hit.instance))
    }

    /// [`crate::Instance::contribution`] of the instance.
    pub fn committed_instance_contribution(&self) -> Option<u32> {
        self.hit().map(|hit| self.contribution(hit.instance))
    }

    /// The index of the geometry in its BLAS.
    pub fn committed_geometry_index(&self) -> Option<u32> {
        self.hit().map(|hit| hit.geometry)
    }

    /// The index of the primitive in its geometry.
    pub fn committed_primitive_index(&self) -> Option<u32> {
        self.hit().map(|hit| hit.primitive)
    }

    /// The ray's origin in object space.
    pub fn committed_object_ray_origin(&self) -> Option<Vec3> {
        self.hit().map(|hit| self.object_ray_origin(hit.instance))
    }

    /// The ray's direction in object space, not normalised.
    pub fn committed_object_ray_direction(&self) -> Option<Vec3> {
        self.hit().map(|hit| self.object_ray_direction(hit.instance))
    }

    /// From object space to the world.
    pub fn committed_object_to_world(&self) -> Option<Affine3A> {
        self.hit().map(|hit| self.object_to_world(hit.instance))
    }

    /// From the world to object space.
    pub fn committed_world_to_object(&self) -> Option<Affine3A> {
        self.hit().map(|hit| self.world_to_object(hit.instance))
    }
}
