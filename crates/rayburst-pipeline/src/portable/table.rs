//! The shader table of portable shaders.

use std::{any::TypeId, any::type_name, sync::Arc};

use rayburst_accel::{GeometryKind, Tlas};

use super::{Next, PortableHit, PortableRay};
use crate::{
    AnyHitResult, PipelineError,
    pipeline::{HitTable, check_hits, check_numbers},
    table::RayTypeInfo,
};

/// Which records rays find; see [`crate::RayType`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PortableRayType {
    pub(crate) index: u32,
}

type ClosestHitFn<'s, P, R> = dyn Fn(&PortableHit<'_, R>, P) -> (P, Next) + Send + Sync + 's;
type AnyHitFn<'s, P, R> = dyn Fn(&PortableHit<'_, R>, &P) -> AnyHitResult + Send + Sync + 's;
type MissFn<'s, P> = dyn Fn(&PortableRay<'_>, P) -> (P, Next) + Send + Sync + 's;

/// The portable shaders of triangles, with a payload `P` and a record `R`.
pub struct PortableHitGroup<'s, P, R = ()> {
    name: Arc<str>,
    closest_hit: Option<Arc<ClosestHitFn<'s, P, R>>>,
    any_hit: Option<Arc<AnyHitFn<'s, P, R>>>,
}

impl<P, R> Clone for PortableHitGroup<'_, P, R> {
    fn clone(&self) -> Self {
        Self {
            name: self.name.clone(),
            closest_hit: self.closest_hit.clone(),
            any_hit: self.any_hit.clone(),
        }
    }
}

impl<'s, P, R> PortableHitGroup<'s, P, R> {
    /// A group for triangles, without shaders yet; the name is for messages.
    pub fn triangles(name: &str) -> Self {
        Self { name: name.into(), closest_hit: None, any_hit: None }
    }

    /// What happens at the nearest hit. Without this shader a ray that hits is done.
    pub fn closest_hit(
        mut self,
        shader: impl Fn(&PortableHit<'_, R>, P) -> (P, Next) + Send + Sync + 's,
    ) -> Self {
        self.closest_hit = Some(Arc::new(shader));
        self
    }

    /// Decides whether a ray stops at a hit of geometry that is not opaque, without changing the payload.
    /// [`AnyHitResult::AcceptAndEndSearch`] is as good as [`AnyHitResult::Accept`] here.
    pub fn any_hit(
        mut self,
        shader: impl Fn(&PortableHit<'_, R>, &P) -> AnyHitResult + Send + Sync + 's,
    ) -> Self {
        self.any_hit = Some(Arc::new(shader));
        self
    }
}

/// A record, whatever the type of its data.
pub(super) trait PortableRecord<P>: Send + Sync {
    fn group(&self) -> &str;
    fn has_any_hit(&self) -> bool;
    fn has_closest_hit(&self) -> bool;
    fn closest_hit(&self, hit: &PortableHit<'_, ()>, payload: P) -> (P, Next);
    fn any_hit(&self, hit: &PortableHit<'_, ()>, payload: &P) -> AnyHitResult;
}

struct Record<'s, P, R> {
    group: PortableHitGroup<'s, P, R>,
    data: R,
}

/// The hit with the record's data.
fn with_record<'a, R>(hit: &PortableHit<'a, ()>, record: &'a R) -> PortableHit<'a, R> {
    PortableHit { ray: hit.ray, hit: hit.hit, record, tlas: hit.tlas }
}

impl<P, R: Send + Sync> PortableRecord<P> for Record<'_, P, R> {
    fn group(&self) -> &str {
        &self.group.name
    }

    fn has_any_hit(&self) -> bool {
        self.group.any_hit.is_some()
    }

    fn has_closest_hit(&self) -> bool {
        self.group.closest_hit.is_some()
    }

    fn closest_hit(&self, hit: &PortableHit<'_, ()>, payload: P) -> (P, Next) {
        match &self.group.closest_hit {
            Some(shader) => shader(&with_record(hit, &self.data), payload),
            None => (payload, Next::Done),
        }
    }

    fn any_hit(&self, hit: &PortableHit<'_, ()>, payload: &P) -> AnyHitResult {
        match &self.group.any_hit {
            Some(shader) => shader(&with_record(hit, &self.data), payload),
            None => AnyHitResult::Accept,
        }
    }
}

pub(super) struct Miss<'s, P> {
    pub(super) run: Box<MissFn<'s, P>>,
}

/// A table of portable shaders in the making, all with a payload `P`.
pub struct PortableTable<'s, P> {
    ray_types: Vec<RayTypeInfo>,
    misses: Vec<Option<Miss<'s, P>>>,
    hits: Vec<Option<Box<dyn PortableRecord<P> + 's>>>,
}

impl<P> Default for PortableTable<'_, P> {
    fn default() -> Self {
        Self { ray_types: vec![], misses: vec![], hits: vec![] }
    }
}

impl<'s, P: 'static> PortableTable<'s, P> {
    /// A table without records.
    pub fn new() -> Self {
        Self::default()
    }

    /// A type of rays; see [`crate::ShaderTable::ray_type`].
    pub fn ray_type(
        &mut self,
        name: &str,
        contribution: u32,
        multiplier: u32,
        miss: u32,
    ) -> PortableRayType {
        let (name, payload) = (name.to_owned(), (TypeId::of::<P>(), type_name::<P>()));
        self.ray_types.push(RayTypeInfo { name, contribution, multiplier, miss, payload });
        PortableRayType { index: self.ray_types.len() as u32 - 1 }
    }

    /// Adds a miss shader, and gives the index of its record.
    pub fn miss(
        &mut self,
        shader: impl Fn(&PortableRay<'_>, P) -> (P, Next) + Send + Sync + 's,
    ) -> u32 {
        self.misses.push(Some(Miss { run: Box::new(shader) }));
        self.misses.len() as u32 - 1
    }

    /// Adds a miss record without a shader, and gives its index: a ray that finds it is done.
    pub fn no_miss(&mut self) -> u32 {
        self.misses.push(None);
        self.misses.len() as u32 - 1
    }

    /// Adds a record of a hit group, and gives its index.
    pub fn hit<R: Send + Sync + 's>(&mut self, group: &PortableHitGroup<'s, P, R>, data: R) -> u32
    where
        P: 's,
    {
        self.hits.push(Some(Box::new(Record { group: group.clone(), data })));
        self.hits.len() as u32 - 1
    }

    /// Adds a hit record without shaders, and gives its index: a ray that finds it is done.
    pub fn no_hit(&mut self) -> u32 {
        self.hits.push(None);
        self.hits.len() as u32 - 1
    }

    /// Makes a pipeline of which each launch traces at most `max_rays` rays, one after another.
    pub fn build(self, max_rays: u32) -> Result<PortablePipeline<'s, P>, PipelineError> {
        let Self { ray_types, misses, hits } = self;
        for ray_type in &ray_types {
            check_numbers(ray_type, misses.len())?;
        }
        let has_any_hit = hits.iter().flatten().any(|record| record.has_any_hit());
        Ok(PortablePipeline { ray_types, misses, hits, max_rays, has_any_hit })
    }
}

/// Portable shaders that fit together, ready to be run over structures of triangles.
pub struct PortablePipeline<'s, P> {
    pub(super) ray_types: Vec<RayTypeInfo>,
    pub(super) misses: Vec<Option<Miss<'s, P>>>,
    pub(super) hits: Vec<Option<Box<dyn PortableRecord<P> + 's>>>,
    pub(super) max_rays: u32,
    pub(super) has_any_hit: bool,
}

impl<P: 'static> PortablePipeline<'_, P> {
    /// Whether every record that a ray can find in a structure is there and fits; every dispatch checks.
    pub fn check(&self, tlas: &Tlas) -> Result<(), PipelineError> {
        check_hits(self, &self.ray_types, tlas)
    }
}

impl<P: 'static> HitTable for PortablePipeline<'_, P> {
    fn records(&self) -> usize {
        self.hits.len()
    }

    fn record(&self, index: usize) -> Option<(&str, GeometryKind, (TypeId, &'static str))> {
        let record = self.hits[index].as_ref()?;
        let payload = (TypeId::of::<P>(), type_name::<P>());
        Some((record.group(), GeometryKind::Triangles, payload))
    }
}
