//! Hit groups: the shaders of a surface.

use std::{any::Any, any::TypeId, marker::PhantomData, sync::Arc};

use bytemuck::{Pod, Zeroable};
use rayburst_accel::{GeometryKind, ProceduralCandidate};
use rayburst_math::Hit;

use crate::{
    call::{Call, TracedRay},
    context::{AnyHit, ClosestHit, Intersection},
    procedural::{Attributes, Reports},
};

/// What an any hit shader decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AnyHitResult {
    /// The ray passes.
    Ignore,
    /// The ray stops here unless it stops before.
    Accept,
    /// The ray stops here.
    AcceptAndEndSearch,
}

/// The attributes of triangles (DXR's `BuiltInTriangleIntersectionAttributes`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Barycentrics {
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
}

/// Attributes may have so many bytes, as in DXR.
pub const MAX_ATTRIBUTE_BYTES: usize = 32;

type ClosestHitFn<'s, P, A, R> = dyn Fn(&ClosestHit<'_, A, R>, &mut P) + Send + Sync + 's;
type AnyHitFn<'s, P, A, R> = dyn Fn(&AnyHit<'_, A, R>, &mut P) -> AnyHitResult + Send + Sync + 's;
type IntersectionFn<'s, P, A, R> = dyn Fn(&mut Intersection<'_, '_, P, A, R>) + Send + Sync + 's;

/// The shaders that run where rays with a payload `P` meet a surface: of triangles, or of procedural
/// primitives with attributes `A`; `R` is the data of each record of the group in the shader table.
///
/// Every shader but the intersection shader may be absent: without an any hit shader all hits are
/// accepted, without a closest hit shader nothing happens at the nearest.
pub struct HitGroup<'s, P, A = Barycentrics, R = ()> {
    name: Arc<str>,
    kind: GeometryKind,
    closest_hit: Option<Arc<ClosestHitFn<'s, P, A, R>>>,
    any_hit: Option<Arc<AnyHitFn<'s, P, A, R>>>,
    intersection: Option<Arc<IntersectionFn<'s, P, A, R>>>,
}

impl<P, A, R> Clone for HitGroup<'_, P, A, R> {
    fn clone(&self) -> Self {
        Self {
            name: self.name.clone(),
            kind: self.kind,
            closest_hit: self.closest_hit.clone(),
            any_hit: self.any_hit.clone(),
            intersection: self.intersection.clone(),
        }
    }
}

impl<P: 'static, R> HitGroup<'_, P, Barycentrics, R> {
    /// A group for triangles, without shaders yet; the name is for messages.
    pub fn triangles(name: &str) -> Self {
        Self {
            name: name.into(),
            kind: GeometryKind::Triangles,
            closest_hit: None,
            any_hit: None,
            intersection: None,
        }
    }
}

impl<'s, P: 'static, A: Pod, R> HitGroup<'s, P, A, R> {
    /// A group for procedural primitives: the shader reports where a ray meets one. Attributes of more
    /// than 32 bytes do not compile.
    pub fn procedural(
        name: &str,
        intersection: impl Fn(&mut Intersection<'_, '_, P, A, R>) + Send + Sync + 's,
    ) -> Self {
        const { assert!(size_of::<A>() <= MAX_ATTRIBUTE_BYTES) };
        Self {
            name: name.into(),
            kind: GeometryKind::Procedural,
            closest_hit: None,
            any_hit: None,
            intersection: Some(Arc::new(intersection)),
        }
    }

    /// What happens at the nearest hit.
    pub fn closest_hit(
        mut self,
        shader: impl Fn(&ClosestHit<'_, A, R>, &mut P) + Send + Sync + 's,
    ) -> Self {
        self.closest_hit = Some(Arc::new(shader));
        self
    }

    /// Decides whether a ray stops at a hit of geometry that is not opaque.
    pub fn any_hit(
        mut self,
        shader: impl Fn(&AnyHit<'_, A, R>, &mut P) -> AnyHitResult + Send + Sync + 's,
    ) -> Self {
        self.any_hit = Some(Arc::new(shader));
        self
    }

    /// The group's name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// A record of a hit group in a shader table, whatever its types.
pub(crate) trait HitRecord: Send + Sync {
    fn group(&self) -> &str;
    fn kind(&self) -> GeometryKind;
    fn payload(&self) -> (TypeId, &'static str);
    fn has_any_hit(&self) -> bool;
    fn closest_hit(
        &self,
        call: &Call<'_>,
        ray: &TracedRay,
        hit: &Hit,
        attributes: &Attributes,
        payload: &mut dyn Any,
    );
    fn any_hit(
        &self,
        call: &Call<'_>,
        ray: &TracedRay,
        hit: &Hit,
        attributes: &Attributes,
        payload: &mut dyn Any,
    ) -> AnyHitResult;
    fn intersection(
        &self,
        call: &Call<'_>,
        ray: &TracedRay,
        candidate: &ProceduralCandidate,
        reports: &mut Reports<'_>,
    );
}

/// A group and the data of one of its records.
pub(crate) struct Record<'s, P, A, R> {
    pub(crate) group: HitGroup<'s, P, A, R>,
    pub(crate) data: R,
}

/// The attributes in the first words.
pub(crate) fn attributes_of<A: Pod>(words: &Attributes) -> A {
    bytemuck::pod_read_unaligned(&bytemuck::cast_slice(words)[..size_of::<A>()])
}

impl<P: 'static, A: Pod, R: Send + Sync> HitRecord for Record<'_, P, A, R> {
    fn group(&self) -> &str {
        &self.group.name
    }

    fn kind(&self) -> GeometryKind {
        self.group.kind
    }

    fn payload(&self) -> (TypeId, &'static str) {
        (TypeId::of::<P>(), std::any::type_name::<P>())
    }

    fn has_any_hit(&self) -> bool {
        self.group.any_hit.is_some()
    }

    fn closest_hit(
        &self,
        call: &Call<'_>,
        ray: &TracedRay,
        hit: &Hit,
        attributes: &Attributes,
        payload: &mut dyn Any,
    ) {
        if let Some(shader) = &self.group.closest_hit
            && let Some(payload) = call.payload(payload)
        {
            let attributes = attributes_of(attributes);
            let record = &self.data;
            shader(&ClosestHit { call, ray, hit, attributes, record }, payload);
        }
    }

    fn any_hit(
        &self,
        call: &Call<'_>,
        ray: &TracedRay,
        hit: &Hit,
        attributes: &Attributes,
        payload: &mut dyn Any,
    ) -> AnyHitResult {
        match (&self.group.any_hit, call.payload(payload)) {
            (Some(shader), Some(payload)) => {
                let attributes = attributes_of(attributes);
                let record = &self.data;
                shader(&AnyHit { call, ray, hit, attributes, record }, payload)
            }
            _ => AnyHitResult::Accept,
        }
    }

    fn intersection(
        &self,
        call: &Call<'_>,
        ray: &TracedRay,
        candidate: &ProceduralCandidate,
        reports: &mut Reports<'_>,
    ) {
        if let Some(shader) = &self.group.intersection {
            shader(&mut Intersection {
                call,
                ray,
                candidate: *candidate,
                record: &self.data,
                reports,
                types: PhantomData,
            });
        }
    }
}
