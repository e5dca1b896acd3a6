//! Shapes without triangles: what rays meet of spheres, tori, curves, height fields, signed distance
//! fields and what is made of them.
//!
//! A [`Shape`] lives in object space, knows its box and finds its hits: all that an intersection shader
//! needs. Rays have directions of any length, `t` is in units of them, and hits are those with
//! `t_min ≤ t ≤ t_max`, where `t_min` may be negative. Invalid rays
//! ([`rayburst_math::Ray::is_valid`]) hit nothing.
#![forbid(unsafe_code)]

mod bernstein;
pub mod curve;
pub mod distance_field;
pub mod fractal;
pub mod height_field;
pub mod metaballs;
mod root;
mod segment;
mod shape;
pub mod subdivision;

pub use curve::{Curve, CurveError};
pub use distance_field::{DistanceField, DistanceFieldError};
pub use fractal::Landscape;
pub use height_field::{HeightField, HeightFieldError};
pub use metaballs::{Metaball, Metaballs, MetaballsError};
pub use shape::{Shape, ShapeHit};
pub use subdivision::{CageError, Subdivision};
