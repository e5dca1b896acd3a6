//! The token of an instruction set and the kernels that run under it.

use crate::{Boxes8, ShearRay, SlabRay, TriangleHits, Triangles4};

/// A proof that the running CPU has an instruction set: tokens other than [`crate::Scalar`] are only
/// made by detection.
pub trait Isa: Copy + Send + Sync + std::fmt::Debug + 'static {
    /// The name by which `RAYBURST_ISA` and `--isa` know it.
    const NAME: &'static str;

    /// Runs a kernel in a region compiled for this instruction set.
    fn vectorize<K: Kernel>(self, kernel: K) -> K::Output;

    /// Which of eight boxes a ray may meet in `t_min ≤ t ≤ t_max`, as bits, and the distances at
    /// which it enters them (no less than `t_min`).
    fn slab8(
        self,
        boxes: &Boxes8,
        ray: &SlabRay,
        t_min: f32,
        t_max: f32,
        distances: &mut [f32; 8],
    ) -> u32;

    /// Which of four triangles a ray meets in `t_min ≤ t ≤ t_max`; returns `hits.mask`, and leaves
    /// the rest of `hits` alone if that is zero.
    fn triangles4(
        self,
        block: &Triangles4,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        hits: &mut TriangleHits,
    ) -> u32;

    /// Asks for the cache line at an address, which need not be valid.
    fn prefetch<T>(self, address: *const T);
}

/// Work written once for every instruction set.
pub trait Kernel {
    /// What the work returns.
    type Output;

    /// Does the work. Implementations are `#[inline(always)]`, and so is what they call in their
    /// inner loops: code that is not inlined is compiled for the baseline instruction set.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}
