//! Shapes against independent references in `f64`.

mod check;
mod height_field;
mod rays;
