//! The shader table: records of ray generation, miss and callable shaders and of hit groups, and the ray
//! types by which rays find theirs.

use std::{
    any::{Any, TypeId, type_name},
    fmt,
    marker::PhantomData,
};

use bytemuck::Pod;

use crate::{
    HitGroup, Pipeline, PipelineError,
    context::{Callable, Miss, RayGeneration},
    hit_group::{HitRecord, Record},
    identity::Identity,
};

/// A ray type with a payload `P`: which records its rays find.
///
/// A ray that hits geometry `g` of an instance finds the hit record `contribution + multiplier · g + the
/// instance's contribution` (DXR's `RayContributionToHitGroupIndex`,
/// `MultiplierForGeometryContributionToHitGroupIndex` and `InstanceContributionToHitGroupIndex`); one that
/// misses the miss record `miss`. Records are numbered from 0 in the order in which they are added.
pub struct RayType<P> {
    pub(crate) key: u32,
    payload: PhantomData<fn(&mut P)>,
}

/// Where a ray generation shader is in its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RayGenerationId {
    pub(crate) key: u32,
}

/// Where a callable shader with parameters `D` is in its table.
///
/// The handle is plain data: keep several in an array, pick one at run time.
pub struct CallableId<D> {
    pub(crate) key: u32,
    data: PhantomData<fn(&mut D)>,
}

/// Handles are copied and printed whatever their types are.
macro_rules! handle {
    ($name:ident) => {
        impl<T> Clone for $name<T> {
            fn clone(&self) -> Self {
                *self
            }
        }

        impl<T> Copy for $name<T> {}

        impl<T> fmt::Debug for $name<T> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}<{}>({})", stringify!($name), type_name::<T>(), self.key)
            }
        }
    };
}

handle!(RayType);
handle!(CallableId);

/// What a pipeline knows of a ray type.
pub(crate) struct RayTypeInfo {
    pub(crate) name: String,
    pub(crate) contribution: u32,
    pub(crate) multiplier: u32,
    pub(crate) miss: u32,
    pub(crate) payload: (TypeId, &'static str),
}

impl RayTypeInfo {
    /// The index of a hit record; [`u64`] since the sum may exceed 32 bits.
    #[inline]
    pub(crate) fn record(&self, instance_contribution: u32, geometry: u32) -> u64 {
        u64::from(self.contribution)
            + u64::from(self.multiplier) * u64::from(geometry)
            + u64::from(instance_contribution)
    }
}

pub(crate) type RayGenerationFn<'s> = dyn Fn(&RayGeneration<'_>) + Send + Sync + 's;
pub(crate) type MissFn<'s> = dyn Fn(&Miss<'_>, &mut dyn Any) + Send + Sync + 's;
pub(crate) type CallableFn<'s> = dyn Fn(&Callable<'_>, &mut dyn Any) + Send + Sync + 's;

pub(crate) struct RayGenerationRecord<'s> {
    pub(crate) run: Box<RayGenerationFn<'s>>,
}

pub(crate) struct MissRecord<'s> {
    pub(crate) name: String,
    pub(crate) payload: (TypeId, &'static str),
    pub(crate) run: Box<MissFn<'s>>,
}

pub(crate) struct CallableRecord<'s> {
    pub(crate) run: Box<CallableFn<'s>>,
}

/// A shader table in the making; see [`Pipeline`]. What its shaders capture by reference must be declared before
/// it, and lives as long as the table and the pipeline do.
#[derive(Default)]
pub struct ShaderTable<'s> {
    pub(crate) identity: Identity,
    pub(crate) ray_types: Vec<RayTypeInfo>,
    pub(crate) ray_generations: Vec<RayGenerationRecord<'s>>,
    pub(crate) misses: Vec<Option<MissRecord<'s>>>,
    pub(crate) hits: Vec<Option<Box<dyn HitRecord + 's>>>,
    pub(crate) callables: Vec<CallableRecord<'s>>,
}

impl<'s> ShaderTable<'s> {
    /// A table without records.
    pub fn new() -> Self {
        Self::default()
    }

    /// A type of rays with a payload `P`; see [`RayType`]. Contribution and multiplier are at most 15, the
    /// miss index at most 65,535, as in DXR.
    pub fn ray_type<P: 'static>(
        &mut self,
        name: &str,
        contribution: u32,
        multiplier: u32,
        miss: u32,
    ) -> RayType<P> {
        let payload = (TypeId::of::<P>(), type_name::<P>());
        self.ray_types.push(RayTypeInfo {
            name: name.to_owned(),
            contribution,
            multiplier,
            miss,
            payload,
        });
        RayType { key: self.identity.last(&self.ray_types), payload: PhantomData }
    }

    /// Adds a ray generation shader: it runs once for every index of a dispatch's grid.
    pub fn ray_generation(
        &mut self,
        shader: impl Fn(&RayGeneration<'_>) + Send + Sync + 's,
    ) -> RayGenerationId {
        self.ray_generations.push(RayGenerationRecord { run: Box::new(shader) });
        RayGenerationId { key: self.identity.last(&self.ray_generations) }
    }

    /// Adds a miss shader, and gives the index of its record; the name is for messages.
    pub fn miss<P: 'static>(
        &mut self,
        name: &str,
        shader: impl Fn(&Miss<'_>, &mut P) + Send + Sync + 's,
    ) -> u32 {
        let run = Box::new(move |miss: &Miss<'_>, payload: &mut dyn Any| {
            if let Some(payload) = miss.call.payload(payload) {
                shader(miss, payload);
            }
        });
        let payload = (TypeId::of::<P>(), type_name::<P>());
        self.misses.push(Some(MissRecord { name: name.to_owned(), payload, run }));
        self.misses.len() as u32 - 1
    }

    /// Adds a miss record without a shader (DXR's null shader identifier), and gives its index.
    pub fn no_miss(&mut self) -> u32 {
        self.misses.push(None);
        self.misses.len() as u32 - 1
    }

    /// Adds a record of a hit group, with data that its shaders see as `record()`, and gives its index.
    pub fn hit<P: 'static, A: Pod, R: Send + Sync + 's>(
        &mut self,
        group: &HitGroup<'s, P, A, R>,
        data: R,
    ) -> u32 {
        self.hits.push(Some(Box::new(Record { group: group.clone(), data })));
        self.hits.len() as u32 - 1
    }

    /// Adds a hit record without shaders (DXR's null shader identifier), and gives its index: triangles stop
    /// rays, procedural primitives do not.
    pub fn no_hit(&mut self) -> u32 {
        self.hits.push(None);
        self.hits.len() as u32 - 1
    }

    /// Adds a callable shader with parameters `D`.
    pub fn callable<D: 'static>(
        &mut self,
        shader: impl Fn(&Callable<'_>, &mut D) + Send + Sync + 's,
    ) -> CallableId<D> {
        let run = Box::new(move |callable: &Callable<'_>, data: &mut dyn Any| {
            if let Some(data) = callable.call.payload(data) {
                shader(callable, data);
            }
        });
        self.callables.push(CallableRecord { run });
        CallableId { key: self.identity.last(&self.callables), data: PhantomData }
    }

    /// Makes a pipeline whose rays are traced inside each other at most `max_recursion_depth` deep: 1 if
    /// only ray generation shaders trace, at most 31.
    pub fn build(self, max_recursion_depth: u32) -> Result<Pipeline<'s>, PipelineError> {
        Pipeline::new(self, max_recursion_depth)
    }
}
