//! What tests of several crates share: oracles, meshes with known properties. Never part of the
//! product.
#![forbid(unsafe_code)]

pub mod meshes;
pub mod oracle;
pub mod statistics;

pub use meshes::TestMesh;
pub use oracle::{Oracle, Verdict};
