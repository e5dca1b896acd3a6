//! Hit groups whose shaders are methods of a type.

use bytemuck::Pod;

use crate::{
    AnyHitResult, Barycentrics, HitGroup,
    context::{AnyHit, ClosestHit, Intersection},
};

/// The shaders of triangles as methods of a type; see [`HitGroup::of_triangles`].
///
/// ```
/// use rayburst_pipeline::{Barycentrics, ClosestHit, HitGroup, TriangleShaders};
///
/// struct Paint {
///     color: [f32; 3],
/// }
///
/// impl TriangleShaders for Paint {
///     type Payload = [f32; 3];
///     type Record = ();
///
///     fn closest_hit(&self, _: &ClosestHit<'_, Barycentrics, ()>, payload: &mut [f32; 3]) {
///         *payload = self.color;
///     }
/// }
///
/// let group = HitGroup::of_triangles("red", Paint { color: [1.0, 0.0, 0.0] });
/// assert_eq!(group.name(), "red");
/// ```
pub trait TriangleShaders: Send + Sync {
    /// The payload of rays that meet the triangles.
    type Payload: 'static;
    /// The data of each record of the group.
    type Record;
    /// Whether there is an any hit shader; without one, none is run.
    const HAS_ANY_HIT: bool = false;

    /// What happens at the nearest hit.
    fn closest_hit(
        &self,
        hit: &ClosestHit<'_, Barycentrics, Self::Record>,
        payload: &mut Self::Payload,
    );

    /// Decides whether a ray stops at a hit of geometry that is not opaque.
    fn any_hit(
        &self,
        hit: &AnyHit<'_, Barycentrics, Self::Record>,
        _payload: &mut Self::Payload,
    ) -> AnyHitResult {
        hit.accept_hit()
    }
}

/// The shaders of procedural primitives as methods of a type; see [`HitGroup::of_procedural`].
pub trait ProceduralShaders: Send + Sync {
    /// The payload of rays that meet the primitives.
    type Payload: 'static;
    /// What the intersection shader reports of a hit, at most 32 bytes.
    type Attributes: Pod;
    /// The data of each record of the group.
    type Record;
    /// Whether there is an any hit shader; without one, none is run.
    const HAS_ANY_HIT: bool = false;

    /// Reports where the ray meets the primitive.
    fn intersection(
        &self,
        ray: &mut Intersection<'_, '_, Self::Payload, Self::Attributes, Self::Record>,
    );

    /// What happens at the nearest hit.
    fn closest_hit(
        &self,
        hit: &ClosestHit<'_, Self::Attributes, Self::Record>,
        payload: &mut Self::Payload,
    );

    /// Decides whether a ray stops at a hit of geometry that is not opaque.
    fn any_hit(
        &self,
        hit: &AnyHit<'_, Self::Attributes, Self::Record>,
        _payload: &mut Self::Payload,
    ) -> AnyHitResult {
        hit.accept_hit()
    }
}

impl<'s, P: 'static, R> HitGroup<'s, P, Barycentrics, R> {
    /// A group for triangles of the shaders of a type; the name is for messages.
    pub fn of_triangles<S>(name: &str, shaders: S) -> Self
    where
        S: TriangleShaders<Payload = P, Record = R> + 's,
    {
        let shaders = std::sync::Arc::new(shaders);
        let (closest, any) = (shaders.clone(), shaders);
        let group = Self::triangles(name)
            .closest_hit(move |hit, payload| closest.closest_hit(hit, payload));
        if S::HAS_ANY_HIT {
            group.any_hit(move |hit, payload| any.any_hit(hit, payload))
        } else {
            group
        }
    }
}

impl<'s, P: 'static, A: Pod, R> HitGroup<'s, P, A, R> {
    /// A group for procedural primitives of the shaders of a type; the name is for messages.
    pub fn of_procedural<S>(name: &str, shaders: S) -> Self
    where
        S: ProceduralShaders<Payload = P, Attributes = A, Record = R> + 's,
    {
        let shaders = std::sync::Arc::new(shaders);
        let (intersection, closest, any) = (shaders.clone(), shaders.clone(), shaders);
        let group = Self::procedural(name, move |ray| intersection.intersection(ray))
            .closest_hit(move |hit, payload| closest.closest_hit(hit, payload));
        if S::HAS_ANY_HIT {
            group.any_hit(move |hit, payload| any.any_hit(hit, payload))
        } else {
            group
        }
    }
}
