//! What can be wrong with pipelines and dispatches.

use glam::UVec3;
use thiserror::Error;

/// What is wrong with a shader table, by itself or for a structure.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// More recursion than DXR allows.
    #[error("a recursion depth of {depth} was declared, but it must be 0 to {limit}")]
    RecursionDepth {
        /// What was declared.
        depth: u32,
        /// The most there may be.
        limit: u32,
    },
    /// A number with more bits than DXR has for it.
    #[error("ray type '{ray_type}' has a {what} of {value}, but at most {limit} is allowed")]
    TooLarge {
        /// The ray type.
        ray_type: String,
        /// Which of its numbers.
        what: &'static str,
        /// The number.
        value: u32,
        /// The most it may be.
        limit: u32,
    },
    /// A ray type whose miss record does not exist.
    #[error(
        "rays of type '{ray_type}' that miss find miss record {index}, but there are {records}; add a \
         miss shader with `miss`, or an empty record with `no_miss`"
    )]
    NoMissRecord {
        /// The ray type.
        ray_type: String,
        /// The index of the record.
        index: u32,
        /// How many records there are.
        records: usize,
    },
    /// A miss shader for another payload than the ray type's.
    #[error(
        "miss record {index}, shader '{shader}', takes the payload {found}, but rays of type '{ray_type}' \
         find it with the payload {expected}; change the ray type's miss index or the shader"
    )]
    MissPayload {
        /// The ray type.
        ray_type: String,
        /// The index of the record.
        index: u32,
        /// The shader in it.
        shader: String,
        /// The ray type's payload.
        expected: &'static str,
        /// The shader's payload.
        found: &'static str,
    },
    /// A geometry whose hit record does not exist.
    #[error(
        "rays of type '{ray_type}' that hit geometry {geometry} of instance {instance} find hit record \
         {index}, but there are {records}; add records with `hit` or `no_hit`, or change the instance's \
         contribution"
    )]
    NoHitRecord {
        /// The ray type.
        ray_type: String,
        /// The instance.
        instance: u32,
        /// The geometry in its BLAS.
        geometry: u32,
        /// The index of the record.
        index: u64,
        /// How many records there are.
        records: usize,
    },
    /// A hit group for another payload than the ray type's.
    #[error(
        "hit record {index}, group '{group}', takes the payload {found}, but rays of type '{ray_type}' \
         that hit geometry {geometry} of instance {instance} find it with the payload {expected}; change \
         the ray type's contribution or multiplier, the instance's contribution, or the group"
    )]
    HitPayload {
        /// The ray type.
        ray_type: String,
        /// The instance.
        instance: u32,
        /// The geometry in its BLAS.
        geometry: u32,
        /// The index of the record.
        index: u64,
        /// The group in it.
        group: String,
        /// The ray type's payload.
        expected: &'static str,
        /// The group's payload.
        found: &'static str,
    },
    /// A hit group for triangles at procedural geometry, or the other way round.
    #[error(
        "hit record {index}, group '{group}', is for {found}, but geometry {geometry} of instance \
         {instance} consists of {expected}, which rays of type '{ray_type}' find there; use a group made \
         with `{constructor}`"
    )]
    HitKind {
        /// The ray type.
        ray_type: String,
        /// The instance.
        instance: u32,
        /// The geometry in its BLAS.
        geometry: u32,
        /// The index of the record.
        index: u64,
        /// The group in it.
        group: String,
        /// What the geometry consists of.
        expected: &'static str,
        /// What the group is for.
        found: &'static str,
        /// What makes the right group.
        constructor: &'static str,
    },
    /// An instance with a number of more bits than DXR has for it.
    #[error(
        "instance {instance} has a {what} of {value}, but DXR has 24 bits for it: at most {limit}"
    )]
    InstanceTooLarge {
        /// The instance.
        instance: u32,
        /// Which of its numbers.
        what: &'static str,
        /// The number.
        value: u32,
        /// The most it may be.
        limit: u32,
    },
}

/// Why a dispatch failed: what it wrote is incomplete.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DispatchError {
    /// The shader table does not fit the structure; nothing ran.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The ray generation shader is another pipeline's; nothing ran.
    #[error(
        "the ray generation shader is another pipeline's; use the handle that `ray_generation` of this \
         pipeline's table gave"
    )]
    OtherRayGeneration,
    /// A grid with more launches than DXR allows; nothing ran.
    #[error(
        "a grid of {launches} launches, but at most {limit} are allowed; use several dispatches"
    )]
    TooManyLaunches {
        /// How many it has.
        launches: u64,
        /// How many it may have.
        limit: u64,
    },
    /// Rays were traced inside each other deeper than declared.
    #[error(
        "launch {launch} traces a ray {limit} deep in others, but the declared recursion depth is {limit}; \
         declare more, or ask `remaining_depth` first"
    )]
    RecursionDepth {
        /// The launch's index.
        launch: UVec3,
        /// What was declared.
        limit: u32,
    },
    /// A launch of portable shaders asked for more rays than were declared.
    #[error(
        "launch {launch} asks for more than the {limit} rays that were declared; declare more, or end by \
         `PortableRay::depth`"
    )]
    TooManyRays {
        /// The launch's index.
        launch: UVec3,
        /// What was declared.
        limit: u32,
    },
    /// Callable shaders called each other too deep.
    #[error("launch {launch} calls callable shaders more than 31 deep")]
    CallableDepth {
        /// The launch's index.
        launch: UVec3,
    },
    /// A handle of a callable shader that is another pipeline's.
    #[error(
        "launch {launch} calls a callable shader with parameters {data} that is another pipeline's; use the \
         handle that `callable` of this pipeline's table gave"
    )]
    OtherCallable {
        /// The launch's index.
        launch: UVec3,
        /// The shader's parameters.
        data: &'static str,
    },
    /// A handle of a ray type that is another pipeline's.
    #[error(
        "launch {launch} traces a ray with the payload {payload} of a type that is another pipeline's; use \
         the handle that `ray_type` of this pipeline's table gave"
    )]
    OtherPipeline {
        /// The launch's index.
        launch: UVec3,
        /// The ray's payload.
        payload: &'static str,
    },
    /// A payload or parameters of another type than a shader takes: only with handles of another pipeline
    /// that happened to pass for this one's.
    #[error(
        "launch {launch} runs a shader with {expected} for data of another type: a handle is another \
         pipeline's"
    )]
    OtherPayload {
        /// The launch's index.
        launch: UVec3,
        /// What the shader takes.
        expected: &'static str,
    },
}
