//! Builders: from the boxes of primitives to a binary tree over them.

pub(crate) mod binned_sah;
mod bins;
mod bounds;
pub(crate) mod boxes;
mod clip;
pub(crate) mod clusters;
pub(crate) mod curve_order;
pub(crate) mod monitor;
pub(crate) mod morton;
mod object;
mod partition;
pub(crate) mod ploc;
pub(crate) mod primitives;
pub(crate) mod reinsertion;
pub(crate) mod sbvh;
mod small;
pub(crate) mod spatial;
pub(crate) mod triangle_keys;
