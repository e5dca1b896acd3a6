//! Traversal of wide trees, generic over the instruction set, the query, the filter and the counters.

pub(crate) mod all;
pub(crate) mod answers;
pub(crate) mod any;
pub(crate) mod batch;
pub(crate) mod bits;
pub(crate) mod bundle;
pub(crate) mod closest;
pub(crate) mod count;
pub(crate) mod gather;
pub(crate) mod interleaved;
pub(crate) mod nearest;
pub(crate) mod prepare;
pub(crate) mod query;
pub(crate) mod stream;
pub(crate) mod walk;
