//! Shapes against independent references in `f64`.

mod check;
mod csg;
mod curve;
mod degenerate;
mod distance_field;
mod height_field;
mod metaballs;
mod numeric;
mod polynomial;
mod random_rays;
mod rays;
mod sheets;
mod solids;
mod subdivision;
