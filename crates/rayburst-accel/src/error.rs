//! Why a structure could not be built.

use rayburst_simd::IsaError;
use thiserror::Error;

use crate::{Builder, GeometryKind};

/// Input from which no structure can be built. Positions that are not finite and degenerate
/// triangles are no errors: such triangles are never hit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A triangle refers to a vertex that does not exist.
    #[error(
        "triangle {primitive} of geometry {geometry} refers to vertex {index}, but the geometry has \
         {vertices} vertices; fix its indices"
    )]
    IndexOutOfRange {
        /// Which geometry.
        geometry: u32,
        /// Which triangle of it.
        primitive: u32,
        /// The index in it.
        index: u32,
        /// How many vertices the geometry has.
        vertices: usize,
    },
    /// More primitives than references can count.
    #[error("{count} {what}, but one structure holds at most {limit}; split them over several")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// An instance names a BLAS that was not given.
    #[error("instance {instance} refers to BLAS {blas}, but {blases} were given")]
    NoSuchBlas {
        /// Which instance.
        instance: u32,
        /// The BLAS it names.
        blas: u32,
        /// How many there are.
        blases: usize,
    },
    /// A refit with another number of geometries than the structure was built from.
    #[error("refit with {given} geometries, but the structure was built from {built}; rebuild it")]
    GeometriesDiffer {
        /// How many it was built from.
        built: usize,
        /// How many were given.
        given: usize,
    },
    /// A refit with another number of triangles than the structure was built from.
    #[error(
        "refit with {given} triangles in geometry {geometry}, but the structure was built from \
         {built}; rebuild it"
    )]
    TrianglesDiffer {
        /// Which geometry.
        geometry: u32,
        /// How many it was built from.
        built: usize,
        /// How many were given.
        given: usize,
    },
    /// A refit would have to add a triangle.
    #[error(
        "triangle {primitive} of geometry {geometry} can be hit now, but could not when the \
         structure was built; rebuild it"
    )]
    Reappeared {
        /// Which geometry.
        geometry: u32,
        /// Which triangle of it.
        primitive: u32,
    },
    /// A refit with another number of boxes than the structure was built from.
    #[error(
        "refit with {given} boxes in geometry {geometry}, but the structure was built from {built}; \
         rebuild it"
    )]
    BoxesDiffer {
        /// Which geometry.
        geometry: u32,
        /// How many it was built from.
        built: usize,
        /// How many were given.
        given: usize,
    },
    /// A refit of triangles as boxes, or the other way round.
    #[error(
        "refit of geometry {geometry} as {given:?}, but the structure was built from {built:?}; rebuild it"
    )]
    KindsDiffer {
        /// Which geometry.
        geometry: u32,
        /// What it was built from.
        built: GeometryKind,
        /// What was given.
        given: GeometryKind,
    },
    /// A refit would have to add a procedural primitive.
    #[error(
        "procedural primitive {primitive} of geometry {geometry} can be met now, but could not when the \
         structure was built; rebuild it"
    )]
    BoxReappeared {
        /// Which geometry.
        geometry: u32,
        /// Which primitive of it.
        primitive: u32,
    },
    /// A refit of a triangle that there is not.
    #[error(
        "triangle {primitive} of geometry {geometry} is said to have changed, but there is no such \
         triangle"
    )]
    NoSuchTriangle {
        /// Which geometry.
        geometry: u32,
        /// Which triangle of it.
        primitive: u32,
    },
    /// An update with another number of instances than the structure was built from.
    #[error("update with {given} instances, but the structure was built from {built}; rebuild it")]
    InstancesDiffer {
        /// How many it was built from.
        built: usize,
        /// How many were given.
        given: usize,
    },
    /// An update that gives an instance another BLAS.
    #[error(
        "update of instance {instance} to BLAS {given}, but the structure was built with its BLAS \
         {built}; rebuild it"
    )]
    OtherBlas {
        /// Which instance.
        instance: u32,
        /// The BLAS it was built with.
        built: u32,
        /// The BLAS it names now.
        given: u32,
    },
    /// An update would have to add an instance.
    #[error(
        "instance {instance} can be hit now, but could not when the structure was built; rebuild it"
    )]
    InstanceReappeared {
        /// Which instance.
        instance: u32,
    },
    /// A refit of a compressed structure.
    #[error(
        "a compressed structure cannot be refitted; rebuild it, or build it in the wide layout"
    )]
    CompressedRefit,
    /// Reinsertion after a builder that makes no binary tree.
    #[error(
        "reinsertion improves binary trees, and {builder:?} makes none; choose another builder"
    )]
    NoBinaryTree {
        /// The builder.
        builder: Builder,
    },
    /// Memory ran out.
    #[error("not enough memory for {what}: {bytes} bytes; use a smaller scene or instances")]
    OutOfMemory {
        /// What the memory was for.
        what: &'static str,
        /// How much was asked for.
        bytes: usize,
    },
    /// The build was told to stop, see [`crate::BuildControl::cancel`].
    #[error("the build was cancelled")]
    Cancelled,
    /// `RAYBURST_ISA` names no instruction set of this CPU.
    #[error(transparent)]
    Isa(#[from] IsaError),
}
