//! Polygon lights without samples: light of a polygon on a surface in closed form, by linearly
//! transformed cosines.
//!
//! Heitz, Dupuy, Hill, Neubelt: "Real-Time Polygonal-Light Shading with Linearly Transformed
//! Cosines", SIGGRAPH 2016. A lobe is a cosine lobe seen through a linear map; the inverse of the map
//! takes a polygon to where its light is an integral of a cosine. The maps are fitted to the GGX lobe
//! of [`crate::bsdf`], see [`fit`]. Where this differs from the paper: what Schlick's Fresnel term adds
//! towards grazing angles is a lobe of its own, polygons are cut off at the surface before they are
//! mapped, and what depends on the incident cosine only (the base under its coat, the light of multiple
//! scattering) is integrated as polynomials.
//!
//! Nothing here knows of shadows.

mod axial;
pub mod fit;
mod lights;
mod merge;
mod polygon;
mod ranking;
mod shading;
mod simplex;
mod table;

pub use lights::{PolygonLight, PolygonLightLimits, PolygonLights, PolygonSample};
pub use polygon::MAX_CORNERS;
pub use ranking::SurfaceBounds;
pub use shading::{PolygonIntegral, PolygonShading};
pub use table::{COSINES, Part, ROUGHNESSES, row_bytes};
