//! Shapes without triangles: what rays meet of spheres, tori, curves, height fields, signed distance
//! fields and what is made of them.
//!
//! A [`Shape`] lives in object space, knows its box and finds its hits: all that an intersection shader
//! needs. Rays have directions of any length, `t` is in units of them, and hits are those with
//! `t_min ≤ t ≤ t_max`, where `t_min` may be negative. Invalid rays
//! ([`rayburst_math::Ray::is_valid`]) hit nothing.
#![forbid(unsafe_code)]

mod cone;
mod crossed;
pub mod csg;
mod cuboid;
mod cylinder;
mod disk;
mod frustum;
mod interval;
mod line;
mod quad;
mod roots;
mod shape;
mod solid;
mod sphere;
mod torus;

pub use cone::Cone;
pub use csg::{Csg, Operation};
pub use cuboid::Cuboid;
pub use cylinder::Cylinder;
pub use disk::Disk;
pub use interval::{Crossing, Interval, IntervalList};
pub use line::Line;
pub use quad::Quad;
pub use shape::{Shape, ShapeHit};
pub use solid::Solid;
pub use sphere::Sphere;
pub use torus::Torus;
