//! The portable instruction set: plain Rust, the oracle of all others.

use crate::{Isa, Kernel};

/// The token of plain Rust, for every CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scalar;

impl Isa for Scalar {
    const NAME: &'static str = "scalar";

    #[inline(always)]
    fn vectorize<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }
}
