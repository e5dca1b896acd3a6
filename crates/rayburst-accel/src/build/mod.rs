//! Builders: from the boxes of primitives to a binary tree over them.

pub(crate) mod binned_sah;
mod bins;
mod bounds;
pub(crate) mod monitor;
mod partition;
pub(crate) mod primitives;
mod small;
