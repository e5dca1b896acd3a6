//! Sixteen numbers at once, as plain arrays.
//!
//! Every operation is a loop over an array, always inlined: in code that is compiled for an instruction set
//! with vectors these become vector instructions, elsewhere they stay loops. Results are those of the same
//! scalar operations, bit for bit, unless said otherwise; nothing is fused.

mod numbers;
mod sampler;
mod vectors;
mod warp;

pub use numbers::{F32x16, I32x16, LANES, Mask16, Select, U32x16};
pub use sampler::Sampler16;
pub use vectors::{Frame16, Vec2x16, Vec3x16, spawn_origin};
pub use warp::{concentric_disk, cosine_hemisphere};
