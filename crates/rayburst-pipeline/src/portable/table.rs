//! The shader table of portable shaders.

use std::any::{TypeId, type_name};

use bytemuck::Pod;
use rayburst_accel::{GeometryKind, Tlas};

use super::{
    Next, PortableHitGroup, PortableRay,
    group::{PortableRecord, Record},
    queue::Queues,
    shade::Group,
};
use crate::{
    PipelineError,
    identity::Identity,
    pipeline::{HitTable, check_hits, check_numbers},
    table::RayTypeInfo,
};

/// Which records rays find; see [`crate::RayType`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PortableRayType {
    pub(crate) key: u32,
}

type MissFn<'s, P> = dyn Fn(&mut Group<'_, P>) + Send + Sync + 's;

pub(super) struct Miss<'s, P> {
    pub(super) run: Box<MissFn<'s, P>>,
}

/// A table of portable shaders in the making, all with a payload `P`.
pub struct PortableTable<'s, P> {
    identity: Identity,
    ray_types: Vec<RayTypeInfo>,
    misses: Vec<Option<Miss<'s, P>>>,
    hits: Vec<Option<Box<dyn PortableRecord<P> + 's>>>,
}

impl<P> Default for PortableTable<'_, P> {
    fn default() -> Self {
        Self { identity: Identity::new(), ray_types: vec![], misses: vec![], hits: vec![] }
    }
}

impl<'s, P: Copy + 'static> PortableTable<'s, P> {
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
        PortableRayType { key: self.identity.last(&self.ray_types) }
    }

    /// Adds a miss shader, and gives the index of its record.
    pub fn miss(
        &mut self,
        shader: impl Fn(&PortableRay<'_>, P) -> (P, Next) + Send + Sync + 's,
    ) -> u32 {
        let run = Box::new(move |group: &mut Group<'_, P>| {
            group.run(|ray, _, payload| shader(&ray, payload));
        });
        self.misses.push(Some(Miss { run }));
        self.misses.len() as u32 - 1
    }

    /// Adds a miss record without a shader, and gives its index: a ray that finds it is done.
    pub fn no_miss(&mut self) -> u32 {
        self.misses.push(None);
        self.misses.len() as u32 - 1
    }

    /// Adds a record of a hit group, and gives its index.
    pub fn hit<A: Pod, R: Send + Sync + 's>(
        &mut self,
        group: &PortableHitGroup<'s, P, A, R>,
        data: R,
    ) -> u32 {
        self.hits.push(Some(Box::new(Record { group: group.clone(), data })));
        self.hits.len() as u32 - 1
    }

    /// Adds a hit record without shaders, and gives its index: a ray that finds it is done at
    /// triangles; procedural primitives do not stop it.
    pub fn no_hit(&mut self) -> u32 {
        self.hits.push(None);
        self.hits.len() as u32 - 1
    }

    /// Makes a pipeline of which each launch traces at most `max_rays` rays, one after another.
    pub fn build(self, max_rays: u32) -> Result<PortablePipeline<'s, P>, PipelineError> {
        let Self { identity, ray_types, misses, hits } = self;
        for ray_type in &ray_types {
            check_numbers(ray_type, misses.len())?;
        }
        let is_procedural = |kind| kind == GeometryKind::Procedural;
        let has_intersection = hits.iter().flatten().any(|record| is_procedural(record.kind()));
        let asks =
            |record: &dyn PortableRecord<P>| record.has_any_hit() && !is_procedural(record.kind());
        let has_any_hit = hits.iter().flatten().any(|record| asks(record.as_ref()));
        let queues = Queues::default();
        Ok(PortablePipeline {
            identity,
            ray_types,
            misses,
            hits,
            max_rays,
            has_any_hit,
            has_intersection,
            queues,
        })
    }
}

/// Portable shaders that fit together, ready to be run over structures.
pub struct PortablePipeline<'s, P> {
    identity: Identity,
    pub(super) ray_types: Vec<RayTypeInfo>,
    pub(super) misses: Vec<Option<Miss<'s, P>>>,
    pub(super) hits: Vec<Option<Box<dyn PortableRecord<P> + 's>>>,
    pub(super) max_rays: u32,
    /// Whether any group for triangles has the shader.
    pub(super) has_any_hit: bool,
    /// Whether there are groups for procedural primitives.
    pub(super) has_intersection: bool,
    pub(super) queues: Queues<P>,
}

impl<P> PortablePipeline<'_, P> {
    /// The ray type that a key stands for, unless it is another table's.
    #[inline(always)]
    pub(super) fn ray_type(&self, key: u32) -> Option<&RayTypeInfo> {
        self.ray_types.get(self.identity.index(key))
    }
}

impl<P: 'static> PortablePipeline<'_, P> {
    /// Whether every record that a ray can find in a structure is there and fits; every dispatch checks.
    pub fn check(&self, tlas: &Tlas) -> Result<(), PipelineError> {
        check_hits(self, &self.ray_types, tlas)
    }
}

impl<P: 'static> HitTable for PortablePipeline<'_, P> {
    fn constructors(&self) -> [&'static str; 2] {
        ["PortableHitGroup::triangles", "PortableHitGroup::procedural"]
    }

    fn records(&self) -> usize {
        self.hits.len()
    }

    fn record(&self, index: usize) -> Option<(&str, GeometryKind, (TypeId, &'static str))> {
        let record = self.hits[index].as_ref()?;
        let payload = (TypeId::of::<P>(), type_name::<P>());
        Some((record.group(), record.kind(), payload))
    }
}
