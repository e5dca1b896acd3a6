//! Frames in real time.

mod eye_rays;
mod visibility;

pub use visibility::{PrimaryRaster, rasterise, trace_primary};
