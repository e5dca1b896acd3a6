//! Hit groups of portable shaders.

use std::sync::Arc;

use bytemuck::Pod;
use rayburst_accel::{GeometryKind, Tlas};
use rayburst_math::Hit;

use super::{
    Next, PortableCandidate, PortableHit, PortableRay, PortableReport, PortableReports,
    shade::Group,
};
use crate::{
    AnyHitResult, Barycentrics, MAX_ATTRIBUTE_BYTES,
    hit_group::attributes_of,
    procedural::{Attributes, barycentrics, words_of},
};

type ClosestHitFn<'s, P, R> = dyn Fn(&mut Group<'_, P>, &R) + Send + Sync + 's;
type AnyHitFn<'s, P, A, R> = dyn Fn(&PortableHit<'_, A, R>, &P) -> AnyHitResult + Send + Sync + 's;
type IntersectionFn<'s, P, A, R> =
    dyn Fn(&PortableCandidate<'_, R>, &P) -> PortableReports<A> + Send + Sync + 's;

/// The portable shaders of triangles, or of procedural primitives with attributes `A`, with a payload `P` and a
/// record `R`.
pub struct PortableHitGroup<'s, P, A = Barycentrics, R = ()> {
    name: Arc<str>,
    kind: GeometryKind,
    closest_hit: Option<Arc<ClosestHitFn<'s, P, R>>>,
    any_hit: Option<Arc<AnyHitFn<'s, P, A, R>>>,
    intersection: Option<Arc<IntersectionFn<'s, P, A, R>>>,
}

impl<P, A, R> Clone for PortableHitGroup<'_, P, A, R> {
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

impl<P, R> PortableHitGroup<'_, P, Barycentrics, R> {
    /// A group for triangles, without shaders yet; the name is for messages.
    pub fn triangles(name: &str) -> Self {
        let (name, kind) = (name.into(), GeometryKind::Triangles);
        Self { name, kind, closest_hit: None, any_hit: None, intersection: None }
    }
}

impl<'s, P: Copy, A: Pod, R> PortableHitGroup<'s, P, A, R> {
    /// A group for procedural primitives: the shader says where a ray meets one. Attributes of more than 32
    /// bytes do not compile.
    pub fn procedural(
        name: &str,
        intersection: impl Fn(&PortableCandidate<'_, R>, &P) -> PortableReports<A> + Send + Sync + 's,
    ) -> Self {
        const { assert!(size_of::<A>() <= MAX_ATTRIBUTE_BYTES) };
        let (name, kind) = (name.into(), GeometryKind::Procedural);
        let intersection = Some(Arc::new(intersection) as _);
        Self { name, kind, closest_hit: None, any_hit: None, intersection }
    }

    /// What happens at the nearest hit. Without this shader a ray that hits is done.
    pub fn closest_hit(
        mut self,
        shader: impl Fn(&PortableHit<'_, A, R>, P) -> (P, Next) + Send + Sync + 's,
    ) -> Self {
        self.closest_hit = Some(Arc::new(move |group: &mut Group<'_, P>, record: &R| {
            let (tlas, hits, attributes) = (group.step.tlas, group.hits, group.attributes);
            group.run(|ray, index, payload| {
                let hit = &hits[index];
                let attributes = match attributes.get(index) {
                    Some(words) => attributes_of(words),
                    None => attributes_of(&barycentrics(hit)),
                };
                shader(&PortableHit { ray, hit, attributes, record, tlas }, payload)
            });
        }));
        self
    }

    /// Decides whether a ray stops at a hit of geometry that is not opaque, without changing the payload.
    /// [`AnyHitResult::AcceptAndEndSearch`] is as good as [`AnyHitResult::Accept`] here.
    pub fn any_hit(
        mut self,
        shader: impl Fn(&PortableHit<'_, A, R>, &P) -> AnyHitResult + Send + Sync + 's,
    ) -> Self {
        self.any_hit = Some(Arc::new(shader));
        self
    }

    /// The group's name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// A hit before its record is known.
pub(super) struct AnyHit<'a> {
    pub(super) ray: PortableRay<'a>,
    pub(super) hit: &'a Hit,
    pub(super) attributes: &'a Attributes,
    pub(super) tlas: &'a Tlas,
}

/// A record, whatever the types of its attributes and data.
pub(super) trait PortableRecord<P>: Send + Sync {
    fn group(&self) -> &str;
    fn kind(&self) -> GeometryKind;
    fn has_any_hit(&self) -> bool;
    fn has_closest_hit(&self) -> bool;
    fn closest_hit(&self, group: &mut Group<'_, P>);
    fn any_hit(&self, hit: &AnyHit<'_>, payload: &P) -> AnyHitResult;
    /// Tells of every hit that is reported.
    fn intersection(
        &self,
        candidate: &PortableCandidate<'_, ()>,
        payload: &P,
        report: &mut dyn FnMut(f32, u8, &Attributes),
    );
}

/// A group and the data of one of its records.
pub(super) struct Record<'s, P, A, R> {
    pub(super) group: PortableHitGroup<'s, P, A, R>,
    pub(super) data: R,
}

impl<P, A: Pod, R: Send + Sync> PortableRecord<P> for Record<'_, P, A, R> {
    fn group(&self) -> &str {
        &self.group.name
    }

    fn kind(&self) -> GeometryKind {
        self.group.kind
    }

    fn has_any_hit(&self) -> bool {
        self.group.any_hit.is_some()
    }

    fn has_closest_hit(&self) -> bool {
        self.group.closest_hit.is_some()
    }

    fn closest_hit(&self, group: &mut Group<'_, P>) {
        if let Some(shader) = &self.group.closest_hit {
            shader(group, &self.data);
        }
    }

    fn any_hit(&self, hit: &AnyHit<'_>, payload: &P) -> AnyHitResult {
        let &AnyHit { ray, hit, attributes, tlas } = hit;
        match &self.group.any_hit {
            Some(shader) => {
                let (attributes, record) = (attributes_of(attributes), &self.data);
                shader(&PortableHit { ray, hit, attributes, record, tlas }, payload)
            }
            None => AnyHitResult::Accept,
        }
    }

    fn intersection(
        &self,
        candidate: &PortableCandidate<'_, ()>,
        payload: &P,
        report: &mut dyn FnMut(f32, u8, &Attributes),
    ) {
        let Some(shader) = &self.group.intersection else { return };
        let &PortableCandidate { ray, primitive, t_current, tlas, .. } = candidate;
        let record = &self.data;
        let candidate = PortableCandidate { ray, primitive, t_current, record, tlas };
        for &PortableReport { t, kind, attributes } in shader(&candidate, payload).as_slice() {
            report(t, kind, &words_of(&attributes));
        }
    }
}
