//! Tests of what rays meet of shapes, against references in double precision.

mod csg;
mod degenerate;
mod rays;
mod sheets;
mod solids;
