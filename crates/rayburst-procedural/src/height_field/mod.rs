//! Heights on a regular grid, with a bilinear patch in every cell.

mod pyramid;
mod walk;

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Ray};
use std::ops::ControlFlow;

use crate::segment::Segment;
use crate::{Shape, ShapeHit};
use pyramid::Pyramid;

/// Why heights make no field.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HeightFieldError {
    /// Fewer than two columns or rows: there is no cell.
    #[error("a height field needs at least 2 by 2 heights, not {columns} by {rows}")]
    TooFew {
        /// Heights along x.
        columns: usize,
        /// Heights along z.
        rows: usize,
    },
    /// The number of heights is not columns times rows.
    #[error("{columns} by {rows} heights were announced, {found} were given")]
    Count {
        /// Heights along x.
        columns: usize,
        /// Heights along z.
        rows: usize,
        /// Heights given.
        found: usize,
    },
    /// A height is infinite or not a number.
    #[error("height {index} is not a finite number")]
    NotFinite {
        /// Which height.
        index: usize,
    },
    /// The rectangle has no area, or is not finite.
    #[error("the rectangle of a height field must be finite and have an area")]
    Rectangle,
}

/// A surface `y = h(x, z)` over a rectangle, bilinear between the heights of a regular grid.
///
/// It is a sheet whose front is above (normals have `y > 0`); rays that enter below it through the
/// sides of its box hit nothing there. Normals are those of the patches and change from cell to cell.
/// `uv` is the place in the rectangle, x and z each from 0 to 1. A ray that lies in the surface over
/// some stretch hits it where the stretch begins, if anywhere.
#[derive(Clone, Debug)]
pub struct HeightField {
    columns: usize,
    rows: usize,
    heights: Vec<f32>,
    lower: DVec2,
    cell: DVec2,
    bounds: Aabb,
    pyramid: Pyramid,
}

impl HeightField {
    /// A field of `columns` heights along x by `rows` along z, those of equal z side by side, over the
    /// rectangle from `lower` to `upper` (x and z).
    pub fn new(
        columns: usize,
        rows: usize,
        heights: Vec<f32>,
        lower: Vec2,
        upper: Vec2,
    ) -> Result<Self, HeightFieldError> {
        if columns < 2 || rows < 2 {
            return Err(HeightFieldError::TooFew { columns, rows });
        }
        if columns.checked_mul(rows) != Some(heights.len()) {
            return Err(HeightFieldError::Count { columns, rows, found: heights.len() });
        }
        if let Some(index) = heights.iter().position(|h| !h.is_finite()) {
            return Err(HeightFieldError::NotFinite { index });
        }
        if !(lower.is_finite() && upper.is_finite() && lower.cmplt(upper).all()) {
            return Err(HeightFieldError::Rectangle);
        }
        let (lowest, highest) = heights
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), &h| (a.min(h), b.max(h)));
        let pyramid = Pyramid::new(columns, rows, &heights);
        Ok(Self {
            columns,
            rows,
            heights,
            lower: lower.as_dvec2(),
            cell: (upper.as_dvec2() - lower.as_dvec2())
                / DVec2::new((columns - 1) as f64, (rows - 1) as f64),
            bounds: Aabb {
                lower: Vec3::new(lower.x, lowest, lower.y),
                upper: Vec3::new(upper.x, highest, upper.y),
            },
            pyramid,
        })
    }

    /// Heights along x.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Heights along z.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The heights, those of equal z side by side.
    pub fn heights(&self) -> &[f32] {
        &self.heights
    }
}

impl Shape for HeightField {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        let (lower, upper) = (self.bounds.lower.as_dvec3(), self.bounds.upper.as_dvec3());
        // Beyond the sides there is no surface; above and below there is none either, but a flat
        // field's box has no height that rounding could not miss.
        let pad = DVec3::Y * (1e-6 * (upper.y - lower.y).max(lower.y.abs()).max(upper.y.abs()))
            + DVec3::Y * f64::from(f32::MIN_POSITIVE);
        if let Some(segment) = Segment::clip(ray, lower - pad, upper + pad) {
            let _ = self.walk(&segment, report);
        }
    }
}
