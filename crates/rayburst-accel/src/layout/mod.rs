//! Memory layouts of the trees.

pub(crate) mod arena;
mod boxes8;
pub(crate) mod bvh2;
pub(crate) mod bvh8;
pub(crate) mod collapse;
pub(crate) mod compressed;
pub(crate) mod curve_leaves;
pub(crate) mod hlbvh8;
pub(crate) mod morton8;
pub(crate) mod triangles;
pub(crate) mod view;
