//! The instruction sets of the running CPU, and the choice of one.

use crate::{Isa, Kernel, Scalar};

#[cfg(target_arch = "aarch64")]
use crate::Neon;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use crate::Simd128;
#[cfg(target_arch = "x86_64")]
use crate::{Avx2, Avx512};

/// The environment variable that names the instruction set to use instead of the best one.
pub const ISA_VARIABLE: &str = "RAYBURST_ISA";

/// A name that is no instruction set of this CPU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IsaError {
    name: String,
}

impl std::fmt::Display for IsaError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<_> = IsaLevel::available().iter().map(|level| level.name()).collect();
        write!(
            f,
            "this CPU has no instruction set called '{}'; choose one of: {} (or unset {ISA_VARIABLE})",
            self.name,
            names.join(", ")
        )
    }
}

impl std::error::Error for IsaError {}

/// An instruction set that the running CPU has; holds the token that proves it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum IsaLevel {
    /// Plain Rust.
    Scalar(Scalar),
    /// AVX2 with FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// AVX-512.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    /// NEON.
    #[cfg(target_arch = "aarch64")]
    Neon(Neon),
    /// WebAssembly's vectors of 128 bits.
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    Simd128(Simd128),
}

impl IsaLevel {
    /// The instruction sets of this CPU, the plainest first.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "some targets have no other")]
        let mut levels = vec![Self::Scalar(Scalar)];
        #[cfg(target_arch = "x86_64")]
        {
            levels.extend(Avx2::detect().map(Self::Avx2));
            levels.extend(Avx512::detect().map(Self::Avx512));
        }
        #[cfg(target_arch = "aarch64")]
        levels.extend(Neon::detect().map(Self::Neon));
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        levels.extend(Simd128::detect().map(Self::Simd128));
        levels
    }

    /// The best instruction set of this CPU.
    pub fn detect() -> Self {
        Self::available().pop().unwrap_or(Self::Scalar(Scalar))
    }

    /// The instruction set that `RAYBURST_ISA` names, or the best one when it is unset or empty.
    pub fn from_environment() -> Result<Self, IsaError> {
        match std::env::var_os(ISA_VARIABLE) {
            Some(name) if !name.is_empty() => Self::from_name(&name.to_string_lossy()),
            _ => Ok(Self::detect()),
        }
    }

    /// The instruction set of this name, if this CPU has it.
    pub fn from_name(name: &str) -> Result<Self, IsaError> {
        Self::available()
            .into_iter()
            .find(|level| level.name() == name)
            .ok_or_else(|| IsaError { name: name.to_owned() })
    }

    /// The name of this instruction set.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar(_) => Scalar::NAME,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => Avx2::NAME,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => Avx512::NAME,
            #[cfg(target_arch = "aarch64")]
            Self::Neon(_) => Neon::NAME,
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128(_) => Simd128::NAME,
        }
    }

    /// Runs a kernel under this instruction set. Costs one to two nanoseconds: once per batch.
    #[inline]
    pub fn dispatch<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Scalar(token) => token.vectorize(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(token) => token.vectorize(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(token) => token.vectorize(kernel),
            #[cfg(target_arch = "aarch64")]
            Self::Neon(token) => token.vectorize(kernel),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128(token) => token.vectorize(kernel),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_levels() {
        for level in IsaLevel::available() {
            assert_eq!(IsaLevel::from_name(level.name()), Ok(level));
        }
        assert!(IsaLevel::available().contains(&IsaLevel::detect()));
    }

    #[test]
    fn an_unknown_name_is_an_error_that_lists_the_known_ones() {
        let message = IsaLevel::from_name("avx1024").unwrap_err().to_string();
        assert!(message.contains("avx1024") && message.contains("scalar"), "{message}");
    }

    #[test]
    fn portable_vectors_are_where_they_belong() {
        let has = |name: &str| IsaLevel::available().iter().any(|level| level.name() == name);
        assert_eq!(has("neon"), cfg!(target_arch = "aarch64"));
        let simd128 = cfg!(all(target_arch = "wasm32", target_feature = "simd128"));
        assert_eq!(has("simd128"), simd128);
    }

    #[test]
    fn kernels_run_under_every_level() {
        struct Sum<'a>(&'a [u32]);
        impl Kernel for Sum<'_> {
            type Output = (u32, &'static str);
            #[inline(always)]
            fn run<I: Isa>(self, _: I) -> Self::Output {
                (self.0.iter().sum(), I::NAME)
            }
        }
        for level in IsaLevel::available() {
            assert_eq!(level.dispatch(Sum(&[1, 2, 3])), (6, level.name()));
        }
    }
}
