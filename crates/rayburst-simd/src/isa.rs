//! The token of an instruction set and the kernels that run under it.

/// A proof that the running CPU has an instruction set: tokens other than [`crate::Scalar`] are only
/// made by detection.
pub trait Isa: Copy + Send + Sync + std::fmt::Debug + 'static {
    /// The name by which `RAYBURST_ISA` and `--isa` know it.
    const NAME: &'static str;

    /// Runs a kernel in a region compiled for this instruction set.
    fn vectorize<K: Kernel>(self, kernel: K) -> K::Output;
}

/// Work written once for every instruction set.
pub trait Kernel {
    /// What the work returns.
    type Output;

    /// Does the work. Implementations are `#[inline(always)]`, and so is what they call in their
    /// inner loops: code that is not inlined is compiled for the baseline instruction set.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}
