//! Shapes without triangles: what rays meet of spheres, tori, curves, height fields, signed distance
//! fields and what is made of them.
//!
//! A [`Shape`] lives in object space, knows its box and finds its hits: all that an intersection shader
//! needs. Rays have directions of any length, `t` is in units of them, and hits are those with
//! `t_min ≤ t ≤ t_max`, where `t_min` may be negative. Invalid rays
//! ([`rayburst_math::Ray::is_valid`]) hit nothing.
#![forbid(unsafe_code)]

mod bernstein;
mod cone;
mod crossed;
pub mod csg;
mod cuboid;
pub mod curve;
mod cylinder;
mod disk;
pub mod distance_field;
pub mod fractal;
mod frustum;
pub mod height_field;
mod interval;
mod line;
pub mod metaballs;
mod quad;
mod root;
mod roots;
mod segment;
mod shape;
mod solid;
mod sphere;
pub mod subdivision;
mod torus;

pub use cone::Cone;
pub use csg::{Csg, Operation};
pub use cuboid::Cuboid;
pub use curve::{Curve, CurveError};
pub use cylinder::Cylinder;
pub use disk::Disk;
pub use distance_field::{DistanceField, DistanceFieldError};
pub use fractal::Landscape;
pub use height_field::{HeightField, HeightFieldError};
pub use interval::{Crossing, Interval, IntervalList};
pub use line::Line;
pub use metaballs::{Metaball, Metaballs, MetaballsError};
pub use quad::Quad;
pub use shape::{Shape, ShapeHit};
pub use solid::Solid;
pub use sphere::Sphere;
pub use subdivision::{CageError, Subdivision};
pub use torus::Torus;
