//! Sixteen surfaces at once, in vectors: the twins of [`FlatScene::surface`] and
//! [`FlatScene::shading_point`], which they follow step by step.
//!
//! What is calculated is always inlined, so that it takes the instruction set of its caller; what gathers
//! from memory is called. Lanes do not know of each other.
//!
//! [`FlatScene::surface`]: crate::FlatScene::surface
//! [`FlatScene::shading_point`]: crate::FlatScene::shading_point

mod shading;
mod surface;
#[cfg(test)]
mod tests;
mod texture;

pub use shading::{Footprint16, ShadingPoint16};
pub use surface::{Surface16, UvSet16};
