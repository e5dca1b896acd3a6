//! What needs a decision, and the decision.

use glam::{Affine3A, Vec2, Vec3};
use rayburst_math::{Hit, HitKind};

use super::RayQuery;

/// What a candidate is (DXR's `CANDIDATE_TYPE`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CandidateType {
    /// A hit of a triangle that is not opaque.
    NonOpaqueTriangle,
    /// A procedural primitive whose box is met.
    ProceduralPrimitive,
}

/// A candidate; the distance of a procedural one is infinite.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) hit: Hit,
    pub(super) opaque: bool,
}

impl Candidate {
    fn is_procedural(&self) -> bool {
        self.hit.kind.is_procedural()
    }
}

/// The candidate that [`RayQuery::proceed`] stopped at, until it is called again.
impl RayQuery<'_> {
    /// What it is; `None` if there is none.
    pub fn candidate_type(&self) -> Option<CandidateType> {
        self.candidate.map(|candidate| {
            if candidate.is_procedural() {
                CandidateType::ProceduralPrimitive
            } else {
                CandidateType::NonOpaqueTriangle
            }
        })
    }

    /// Commits the triangle, unless there is none, the search is over, or what was committed since
    /// precedes it. Returns whether it was committed.
    pub fn commit_non_opaque_triangle_hit(&mut self) -> bool {
        match self.candidate {
            Some(candidate) if !candidate.is_procedural() => self.commit(&candidate.hit),
            _ => false,
        }
    }

    /// Commits a hit of the procedural primitive at `t`, in units of the ray's direction, unless there is
    /// no such candidate, the search is over, `t` is not finite or not within `t_min` and the end of the
    /// interval, both inclusive, or at equal `t` what is committed precedes it. Returns whether it was
    /// committed. May be called several times for a candidate: the nearest hit stays.
    pub fn commit_procedural_primitive_hit(&mut self, t: f32) -> bool {
        let is_inside = self.ray.t_min <= t && t <= self.t_max() && t.is_finite();
        match self.candidate {
            Some(candidate) if candidate.is_procedural() && is_inside => {
                // Adding zero makes −0 a 0.
                self.commit(&Hit { t: t + 0.0, ..candidate.hit })
            }
            _ => false,
        }
    }

    fn triangle(&self) -> Option<&Hit> {
        let candidate = self.candidate.as_ref();
        candidate.filter(|candidate| !candidate.is_procedural()).map(|candidate| &candidate.hit)
    }

    fn primitive(&self) -> Option<&Hit> {
        self.candidate.as_ref().map(|candidate| &candidate.hit)
    }

    /// Where the triangle is hit, in units of the ray's direction; `None` if it is none.
    pub fn candidate_triangle_ray_t(&self) -> Option<f32> {
        self.triangle().map(|hit| hit.t)
    }

    /// The barycentric coordinates of the second and third vertex; `None` if it is no triangle.
    pub fn candidate_triangle_barycentrics(&self) -> Option<Vec2> {
        self.triangle().map(|hit| Vec2::new(hit.u, hit.v))
    }

    /// Whether the front of the triangle is seen; `None` if it is none.
    pub fn candidate_triangle_front_face(&self) -> Option<bool> {
        self.triangle().map(|hit| hit.kind == HitKind::TRIANGLE_FRONT)
    }

    /// Whether hits of the procedural primitive are not final, so that a shader with an any hit shader
    /// would run it; `None` if it is no procedural primitive.
    pub fn candidate_procedural_primitive_non_opaque(&self) -> Option<bool> {
        let candidate = self.candidate.filter(Candidate::is_procedural);
        candidate.map(|candidate| !candidate.opaque)
    }

    /// The index of the instance.
    pub fn candidate_instance_index(&self) -> Option<u32> {
        self.primitive().map(|hit| hit.instance)
    }

    /// The number of the instance, [`crate::Instance::id`].
    pub fn candidate_instance_id(&self) -> Option<u32> {
        self.primitive().map(|hit| self.instance_id(hit.instance))
    }

    /// [`crate::Instance::contribution`] of the instance.
    pub fn candidate_instance_contribution(&self) -> Option<u32> {
        self.primitive().map(|hit| self.contribution(hit.instance))
    }

    /// The index of the geometry in its BLAS.
    pub fn candidate_geometry_index(&self) -> Option<u32> {
        self.primitive().map(|hit| hit.geometry)
    }

    /// The index of the primitive in its geometry.
    pub fn candidate_primitive_index(&self) -> Option<u32> {
        self.primitive().map(|hit| hit.primitive)
    }

    /// The ray's origin in object space.
    pub fn candidate_object_ray_origin(&self) -> Option<Vec3> {
        self.primitive().map(|hit| self.object_ray_origin(hit.instance))
    }

    /// The ray's direction in object space, not normalised: `t` is the same there.
    pub fn candidate_object_ray_direction(&self) -> Option<Vec3> {
        self.primitive().map(|hit| self.object_ray_direction(hit.instance))
    }

    /// From object space to the world.
    pub fn candidate_object_to_world(&self) -> Option<Affine3A> {
        self.primitive().map(|hit| self.object_to_world(hit.instance))
    }

    /// From the world to object space.
    pub fn candidate_world_to_object(&self) -> Option<Affine3A> {
        self.primitive().map(|hit| self.world_to_object(hit.instance))
    }
}
