//! Builders: from the boxes of primitives to a binary tree over them.

pub(crate) mod binned_sah;
pub(crate) mod morton;
pub(crate) mod primitives;
pub(crate) mod triangle_keys;
