//! Simple solids against their signed distances.

mod cone;
mod cuboid;
mod cylinder;
pub(crate) mod reference;
mod sphere;
mod torus;
