//! Other engines, loaded at run time.

pub mod embree;
