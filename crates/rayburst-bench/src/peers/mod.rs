//! Other engines: loaded at run time, or crates behind the feature `peers`.

pub mod embree;
#[cfg(feature = "peers")]
pub mod obvhs;
