//! Instruction sets as values: tokens that prove a CPU can run an instruction set, run-time dispatch
//! on them, and the vector operations at the leaves of the ray tracing kernels.
//!
//! A [`Kernel`] is written once, generic over [`Isa`]. [`IsaLevel::dispatch`] enters the
//! instruction set's feature region once per batch; inside it the kernel calls the leaf operations
//! of the token, which take and return plain arrays. Every operation of every instruction set gives
//! the bits of [`Scalar`], unless its documentation says otherwise.

mod boxes;
mod compressed;
mod each;
mod group;
mod isa;
mod level;
mod raster;
mod scalar;
mod triangles;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(any(target_arch = "aarch64", all(target_arch = "wasm32", target_feature = "simd128")))]
mod lanes4;
#[cfg(target_arch = "aarch64")]
mod neon;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod simd128;
#[cfg(target_arch = "x86_64")]
mod x86;
#[cfg(target_arch = "x86_64")]
mod x86_group;
#[cfg(target_arch = "x86_64")]
mod x86_lanes;
#[cfg(target_arch = "x86_64")]
mod x86_quads;
#[cfg(target_arch = "x86_64")]
mod x86_raster;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub use avx512::Avx512;
pub use boxes::{Boxes8, SlabRay};
pub use compressed::{LEAF_WORDS, QuantizedNode8, TriangleRows, UNIT_WORDS};
pub use each::{Meetings, Pairs, meet_each};
pub use group::{
    Extent16, Frustum, GROUP, Group16, GroupAxes, Preparation16, Question16, Rays16, Row16,
};
pub use isa::{Isa, Kernel, SLOT};
pub use level::{ISA_VARIABLE, IsaError, IsaLevel};
#[cfg(target_arch = "aarch64")]
pub use neon::Neon;
pub use raster::{PixelEdges, PixelPlanes, PixelTile, PixelTriangle, TilePart};
pub use scalar::Scalar;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub use simd128::Simd128;
pub use triangles::{
    Nearest, ShearRay, TriangleHits, Triangles4, along, barycentric, corners, corners_along,
};

#[cfg(test)]
mod group_tests;
#[cfg(test)]
mod raster_tests;
#[cfg(test)]
mod tests;
