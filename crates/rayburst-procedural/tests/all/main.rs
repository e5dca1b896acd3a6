//! Shapes against independent references in `f64`.

mod check;
mod curve;
mod distance_field;
mod height_field;
mod metaballs;
mod numeric;
mod polynomial;
mod rays;
mod subdivision;
