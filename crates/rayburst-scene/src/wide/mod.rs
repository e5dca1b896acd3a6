//! Sixteen surfaces at once, in vectors: the twins of [`FlatScene::surface`] and
//! [`FlatScene::shading_point`], which they follow step by step.
//!
//! What is calculated is always inlined, so that it takes the instruction set of its caller; what gathers
//! from memory is called. Lanes do not know of each other.
//!
//! [`FlatScene::surface`]: crate::FlatScene::surface
//! [`FlatScene::shading_point`]: crate::FlatScene::shading_point

mod lights;
mod lobes;
mod shading;
mod surface;
#[cfg(test)]
mod tests;
mod texture;

pub use lights::Arrival16;
pub use lobes::{LobeSample16, LobeValues16, Lobes16};
pub use shading::{Footprint16, ShadingPoint16};
pub use surface::{Surface16, UvSet16};
