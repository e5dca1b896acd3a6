//! A tile rasteriser: the triangle that every pixel's centre sees, as rays through the centres would find it,
//! and how deep it is.
//!
//! Meshes are cut into [`Clusters`] once. A picture is drawn in waves, the nearest clusters first: clusters
//! outside of the picture or hidden by what is drawn are left out, the triangles of the others are projected
//! and sorted into bins of 64×64 pixels, and bins are filled side by side (the sort-middle arrangement of
//! Molnar, Cox, Ellsworth, Fuchs, "A sorting classification of parallel rendering", 1994; binning for wide
//! vectors as in Seiler et al., "Larrabee", 2008).
//!
//! What holds:
//! - A pixel's centre on an edge that two triangles share is covered by just one of them: the one for which
//!   it is a left edge, or a top one. Edges are exact to about 10⁻⁴ pixels, so closed meshes have no holes.
//! - Nothing is clipped, and there is no near plane: what reaches behind the eye is seen up to the eye.
//! - Both sides of triangles are seen; those seen edge on are not, nor those with corners that are not finite.
//! - Of what is equally deep the earlier mesh's triangle is seen, of one mesh's the first.
//! - Pictures do not depend on the number of threads, and have the same bits with every instruction set.
#![forbid(unsafe_code)]

mod bins;
mod clusters;
mod coverage;
mod error;
mod fill;
mod mesh;
mod planes;
mod point;
mod project;
mod rasteriser;
mod view;

pub use clusters::Clusters;
pub use coverage::{Candidate, Coverage, Solid};
pub use error::{RasterError, Result};
pub use mesh::Mesh;
pub use point::VisiblePoint;
pub use rasteriser::{Rasteriser, Visibility};
pub use rayburst_simd::IsaLevel;
pub use view::{Projection, View};
