//! A checked shader table, and running it.

use std::{any::TypeId, collections::HashSet};

use glam::UVec3;
use rayburst_accel::{GeometryKind, Tlas};
use rayon::prelude::*;

use crate::{
    DispatchError, PipelineError, RayGenerationId, ShaderTable,
    call::{Call, Dispatch, Failure},
    context::RayGeneration,
    hit_group::HitRecord,
    identity::Identity,
    table::{CallableRecord, MissRecord, RayGenerationRecord, RayTypeInfo},
};

/// The deepest recursion that may be declared, as in DXR.
pub const MAX_RECURSION_DEPTH: u32 = 31;
/// The most launches of a dispatch, as in DXR.
pub const MAX_LAUNCHES: u64 = 1 << 30;
/// Contributions and multipliers of ray types have four bits.
const MAX_CONTRIBUTION: u32 = 0xF;
const MAX_MISS: u32 = 0xFFFF;
/// Ids and contributions of instances have 24 bits.
const MAX_OF_INSTANCE: u32 = 0xFF_FFFF;
/// Launches are run in tiles of so many by so many.
const TILE: u32 = 32;
/// Launches of a tile follow each other in blocks of so many by so many: their rays need the same memory.
const BLOCK: u32 = 8;

/// Shaders that fit together, ready to be run over structures (DXR's state object and shader table).
///
/// Made by [`ShaderTable::build`].
pub struct Pipeline<'s> {
    pub(crate) identity: Identity,
    pub(crate) ray_types: Vec<RayTypeInfo>,
    pub(crate) ray_generations: Vec<RayGenerationRecord<'s>>,
    pub(crate) misses: Vec<Option<MissRecord<'s>>>,
    pub(crate) hits: Vec<Option<Box<dyn HitRecord + 's>>>,
    pub(crate) callables: Vec<CallableRecord<'s>>,
    pub(crate) max_recursion_depth: u32,
    /// Whether any group has the shader.
    pub(crate) has_any_hit: bool,
    pub(crate) has_intersection: bool,
}

fn name_of(kind: GeometryKind) -> &'static str {
    match kind {
        GeometryKind::Triangles => "triangles",
        GeometryKind::Procedural => "procedural primitives",
    }
}

impl<'s> Pipeline<'s> {
    pub(crate) fn new(
        table: ShaderTable<'s>,
        max_recursion_depth: u32,
    ) -> Result<Self, PipelineError> {
        if max_recursion_depth > MAX_RECURSION_DEPTH {
            let (depth, limit) = (max_recursion_depth, MAX_RECURSION_DEPTH);
            return Err(PipelineError::RecursionDepth { depth, limit });
        }
        let hits = || table.hits.iter().flatten();
        let has_any_hit = hits().any(|record| record.has_any_hit());
        let has_intersection = hits().any(|record| record.kind() == GeometryKind::Procedural);
        let ShaderTable { identity, ray_types, ray_generations, misses, hits, callables } = table;
        for ray_type in &ray_types {
            check_ray_type(ray_type, &misses)?;
        }
        Ok(Self {
            identity,
            ray_types,
            ray_generations,
            misses,
            hits,
            callables,
            max_recursion_depth,
            has_any_hit,
            has_intersection,
        })
    }

    /// Whether every record that a ray can find in a structure is there and fits: its payload is the ray
    /// type's, and its group is for what the geometry consists of. Every dispatch checks.
    pub fn check(&self, tlas: &Tlas) -> Result<(), PipelineError> {
        check_hits(self, &self.ray_types, tlas)
    }

    /// Runs a ray generation shader once for every index of a grid of `width × height × depth`, on the
    /// current thread pool, in no particular order; rays are traced in `tlas` (DXR's `DispatchRays`).
    ///
    /// If a launch fails, the others run to the end all the same, and the error is that of the first
    /// launch that failed, in the order of rows.
    pub fn dispatch_rays(
        &self,
        tlas: &Tlas,
        shader: RayGenerationId,
        width: u32,
        height: u32,
        depth: u32,
    ) -> Result<(), DispatchError> {
        let Some(record) = self.ray_generations.get(self.identity.index(shader.key)) else {
            return Err(DispatchError::OtherRayGeneration);
        };
        check_launches(width, height, depth)?;
        self.check(tlas)?;
        let dimensions = UVec3::new(width, height, depth);
        let dispatch = Dispatch { pipeline: self, tlas, dimensions, failure: Failure::default() };
        tiles(dimensions, TILE).for_each(|launches| {
            launches.for_each(|launch_index| {
                let call = Call { dispatch: &dispatch, launch_index, depth: 0, callable_depth: 0 };
                (record.run)(&RayGeneration { call });
            });
        });
        dispatch.failure.into_result()
    }
}

/// Whether a grid has no more launches than allowed.
pub(crate) fn check_launches(width: u32, height: u32, depth: u32) -> Result<(), DispatchError> {
    let launches =
        u64::from(width).saturating_mul(u64::from(height)).saturating_mul(u64::from(depth));
    if launches > MAX_LAUNCHES {
        return Err(DispatchError::TooManyLaunches { launches, limit: MAX_LAUNCHES });
    }
    Ok(())
}

/// The launches of each tile of a grid, block by block; tiles are of `side × side`.
pub(crate) fn tiles(
    dimensions: UVec3,
    side: u32,
) -> impl ParallelIterator<Item = impl Iterator<Item = UVec3>> {
    let UVec3 { x: width, y: height, z: depth } = dimensions;
    let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
    let count = u64::from(columns) * u64::from(rows) * u64::from(depth);
    (0..count).into_par_iter().map(move |tile| {
        let (column, row) = (tile % u64::from(columns), tile / u64::from(columns));
        let (row, z) = ((row % u64::from(rows)) as u32, (row / u64::from(rows)) as u32);
        let (left, top) = (column as u32 * side, row * side);
        let part = |from: u32, size: u32, end: u32| from..end.min(from.saturating_add(size));
        part(top, side, height).step_by(BLOCK as usize).flat_map(move |y0| {
            part(left, side, width).step_by(BLOCK as usize).flat_map(move |x0| {
                part(y0, BLOCK, height)
                    .flat_map(move |y| part(x0, BLOCK, width).map(move |x| UVec3::new(x, y, z)))
            })
        })
    })
}

/// The hit records of a table as they are checked.
pub(crate) trait HitTable {
    fn records(&self) -> usize;

    /// What makes groups for triangles and for procedural primitives.
    fn constructors(&self) -> [&'static str; 2];

    /// The group of a record, what it is for, and its payload; `None` if the record is empty.
    fn record(&self, index: usize) -> Option<(&str, GeometryKind, (TypeId, &'static str))>;
}

impl HitTable for Pipeline<'_> {
    fn constructors(&self) -> [&'static str; 2] {
        ["HitGroup::triangles", "HitGroup::procedural"]
    }

    fn records(&self) -> usize {
        self.hits.len()
    }

    fn record(&self, index: usize) -> Option<(&str, GeometryKind, (TypeId, &'static str))> {
        let record = self.hits[index].as_ref()?;
        Some((record.group(), record.kind(), record.payload()))
    }
}

/// Checks every hit record that rays of some types can find in a structure.
pub(crate) fn check_hits(
    table: &impl HitTable,
    ray_types: &[RayTypeInfo],
    tlas: &Tlas,
) -> Result<(), PipelineError> {
    let mut seen = HashSet::new();
    let mut last = None;
    for (instance, number) in tlas.instances().iter().zip(0..) {
        for (what, value) in [("id", instance.id), ("contribution", instance.contribution)] {
            if value > MAX_OF_INSTANCE {
                let (instance, limit) = (number, MAX_OF_INSTANCE);
                return Err(PipelineError::InstanceTooLarge { instance, what, value, limit });
            }
        }
        let key = (instance.blas, instance.contribution);
        if last.replace(key) == Some(key) || !seen.insert(key) {
            continue;
        }
        let Some(blas) = tlas.blases().get(instance.blas as usize) else { continue };
        for (info, geometry) in blas.geometries().iter().zip(0..) {
            for ray_type in ray_types {
                let index = ray_type.record(instance.contribution, geometry);
                check_hit(table, ray_type, number, geometry, info.kind, index)?;
            }
        }
    }
    Ok(())
}

fn check_hit(
    table: &impl HitTable,
    ray_type: &RayTypeInfo,
    instance: u32,
    geometry: u32,
    kind: GeometryKind,
    index: u64,
) -> Result<(), PipelineError> {
    let (records, name) = (table.records(), || ray_type.name.clone());
    if index >= records as u64 {
        let ray_type = name();
        return Err(PipelineError::NoHitRecord { ray_type, instance, geometry, index, records });
    }
    let Some((group, found, payload)) = table.record(index as usize) else { return Ok(()) };
    let group = group.to_owned();
    if found != kind {
        let constructors = table.constructors();
        let constructor = match kind {
            GeometryKind::Triangles => constructors[0],
            GeometryKind::Procedural => constructors[1],
        };
        return Err(PipelineError::HitKind {
            ray_type: name(),
            instance,
            geometry,
            index,
            group,
            expected: name_of(kind),
            found: name_of(found),
            constructor,
        });
    }
    if payload.0 != ray_type.payload.0 {
        return Err(PipelineError::HitPayload {
            ray_type: name(),
            instance,
            geometry,
            index,
            group,
            expected: ray_type.payload.1,
            found: payload.1,
        });
    }
    Ok(())
}

/// Whether the numbers of a ray type have as few bits as DXR has for them, and its miss record is there.
pub(crate) fn check_numbers(ray_type: &RayTypeInfo, misses: usize) -> Result<(), PipelineError> {
    let name = || ray_type.name.clone();
    for (what, value, limit) in [
        ("contribution", ray_type.contribution, MAX_CONTRIBUTION),
        ("multiplier", ray_type.multiplier, MAX_CONTRIBUTION),
        ("miss index", ray_type.miss, MAX_MISS),
    ] {
        if value > limit {
            return Err(PipelineError::TooLarge { ray_type: name(), what, value, limit });
        }
    }
    let index = ray_type.miss;
    if index as usize >= misses {
        return Err(PipelineError::NoMissRecord { ray_type: name(), index, records: misses });
    }
    Ok(())
}

fn check_ray_type(
    ray_type: &RayTypeInfo,
    misses: &[Option<MissRecord<'_>>],
) -> Result<(), PipelineError> {
    check_numbers(ray_type, misses.len())?;
    match &misses[ray_type.miss as usize] {
        Some(miss) if miss.payload.0 != ray_type.payload.0 => Err(PipelineError::MissPayload {
            ray_type: ray_type.name.clone(),
            index: ray_type.miss,
            shader: miss.name.clone(),
            expected: ray_type.payload.1,
            found: miss.payload.1,
        }),
        _ => Ok(()),
    }
}
