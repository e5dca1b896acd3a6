//! From cell to cell along a ray, over blocks that it passes above or below.
//!
//! The grid walk is that of Amanatides, Woo: "A Fast Voxel Traversal Algorithm for Ray Tracing" (1987);
//! leaving out blocks by their range of heights follows Tevs, Ihrke, Seidel: "Maximum Mipmaps for Fast,
//! Accurate, and Scalable Dynamic Height Field Rendering" (2008), here with minima too, as rays may
//! come from below. Along a ray the height above a bilinear patch is a quadratic polynomial, which is
//! cut where it turns; its sign at a cell's end is the one that the next cell begins with, so that no
//! crossing is lost or found twice between cells.

use glam::{DVec2, DVec3, Vec2};
use std::ops::ControlFlow;

use super::HeightField;
use super::pyramid::{cell_heights, cell_range};
use crate::ShapeHit;
use crate::segment::Segment;

type Report<'a> = &'a mut dyn FnMut(ShapeHit) -> ControlFlow<()>;

/// A segment in units of cells.
struct GridRay {
    origin: DVec2,
    direction: DVec2,
    cells: [usize; 2],
}

impl GridRay {
    /// Where the segment leaves the cells from `first` to `last` along an axis.
    fn exit(&self, axis: usize, first: usize, last: usize) -> f64 {
        let d = self.direction[axis];
        if d == 0.0 {
            return f64::INFINITY;
        }
        let border = if d > 0.0 { last + 1 } else { first };
        (border as f64 - self.origin[axis]) / d
    }

    /// The cell at `s` along an axis, at least `first` and at most `last`.
    fn cell(&self, axis: usize, s: f64, first: usize, last: usize) -> usize {
        let place = self.origin[axis] + s * self.direction[axis];
        (place.max(0.0) as usize).clamp(first, last)
    }
}

impl HeightField {
    pub(super) fn walk(&self, segment: &Segment, report: Report<'_>) -> ControlFlow<()> {
        let flat = |v: DVec3| DVec2::new(v.x, v.z);
        let ray = GridRay {
            origin: (flat(segment.origin) - self.lower) / self.cell,
            direction: flat(segment.direction) / self.cell,
            cells: [self.columns - 1, self.rows - 1],
        };
        let mut at = [0, 1].map(|axis| ray.cell(axis, 0.0, 0, ray.cells[axis] - 1));
        let mut s = 0.0;
        let mut value = {
            let patch = self.patch(segment, &ray, at, 0.0);
            if patch.value == 0.0 {
                report(self.hit(segment, &ray, &patch, 0.0))?;
            }
            patch.value
        };
        let top = self.pyramid.top();
        let mut level = top;
        loop {
            let first = at.map(|i| (i >> level) << level);
            let last = [0, 1].map(|axis| (first[axis] + (1 << level)).min(ray.cells[axis]) - 1);
            let exits = [0, 1].map(|axis| ray.exit(axis, first[axis], last[axis]));
            let exit = exits[0].min(exits[1]).min(segment.length).max(s);

            let heights = cell_heights(self.columns, &self.heights, at[0], at[1]);
            let range = if level == 0 {
                cell_range(&heights)
            } else {
                self.pyramid.range(level, at[0], at[1])
            };
            let y = |s: f64| segment.origin.y + s * segment.direction.y;
            let (low, high) = (y(s).min(y(exit)), y(s).max(y(exit)));
            if low > f64::from(range[1]) {
                value = 1.0;
            } else if high < f64::from(range[0]) {
                value = -1.0;
            } else if level > 0 {
                level -= 1;
                continue;
            } else {
                let patch = self.patch(segment, &ray, at, s);
                value = self.cross(segment, &ray, &patch, value, exit - s, report)?;
            }
            if exit >= segment.length {
                return ControlFlow::Continue(());
            }

            s = exit;
            let along = usize::from(exits[1] < exits[0]);
            let across = 1 - along;
            let before = at;
            at[along] = if ray.direction[along] > 0.0 {
                last[along] + 1
            } else if first[along] > 0 {
                first[along] - 1
            } else {
                return ControlFlow::Continue(());
            };
            if at[along] >= ray.cells[along] {
                return ControlFlow::Continue(());
            }
            // Never back, whatever the rounding.
            at[across] = if ray.direction[across] >= 0.0 {
                ray.cell(across, s, at[across], last[across])
            } else {
                ray.cell(across, s, first[across], at[across])
            };
            if level < top && before.map(|i| i >> (level + 1)) != at.map(|i| i >> (level + 1)) {
                level += 1;
            }
        }
    }

    /// The height above a cell's patch along a segment, from `start` on.
    fn patch(&self, segment: &Segment, ray: &GridRay, at: [usize; 2], start: f64) -> Patch {
        let h = cell_heights(self.columns, &self.heights, at[0], at[1]).map(f64::from);
        let slope = DVec2::new(h[1] - h[0], h[2] - h[0]);
        let twist = (h[3] - h[2]) - slope.x;
        let corner = DVec2::new(at[0] as f64, at[1] as f64);
        let place = ray.origin + start * ray.direction - corner;
        let height = h[0] + slope.dot(place) + twist * place.x * place.y;
        let d = ray.direction;
        Patch {
            start,
            corner,
            slope,
            twist,
            value: segment.origin.y + start * segment.direction.y - height,
            linear: segment.direction.y - slope.dot(d) - twist * (place.x * d.y + place.y * d.x),
            quadratic: -twist * d.x * d.y,
        }
    }

    /// Reports where the height above the patch is zero after its start, up to `length` on; gives the
    /// height at the end.
    fn cross(
        &self,
        segment: &Segment,
        ray: &GridRay,
        patch: &Patch,
        value: f64,
        length: f64,
        report: Report<'_>,
    ) -> ControlFlow<(), f64> {
        let turn = -0.5 * patch.linear / patch.quadratic;
        let ends = if turn > 0.0 && turn < length { [turn, length] } else { [length, length] };
        let (mut from, mut before) = (0.0, value);
        for to in ends {
            let after = patch.at(to);
            if before * after < 0.0 {
                let s = patch.start + patch.root(from, to);
                report(self.hit(segment, ray, patch, s))?;
            } else if after == 0.0 && before != 0.0 {
                report(self.hit(segment, ray, patch, patch.start + to))?;
            }
            (from, before) = (to, after);
        }
        ControlFlow::Continue(before)
    }

    fn hit(&self, segment: &Segment, ray: &GridRay, patch: &Patch, s: f64) -> ShapeHit {
        let place = ray.origin + s * ray.direction;
        let inside = place - patch.corner;
        let slope = (patch.slope + patch.twist * DVec2::new(inside.y, inside.x)) / self.cell;
        let uv = place / DVec2::new(ray.cells[0] as f64, ray.cells[1] as f64);
        segment.hit(
            s,
            DVec3::new(-slope.x, 1.0, -slope.y).normalize(),
            uv.as_vec2().clamp(Vec2::ZERO, Vec2::ONE),
        )
    }
}

/// The height above a bilinear patch, `value + linear · τ + quadratic · τ²` with `τ = s - start`.
struct Patch {
    start: f64,
    corner: DVec2,
    slope: DVec2,
    twist: f64,
    value: f64,
    linear: f64,
    quadratic: f64,
}

impl Patch {
    fn at(&self, tau: f64) -> f64 {
        self.value + tau * (self.linear + tau * self.quadratic)
    }

    /// The zero between two places without a turn between them, whose signs differ.
    fn root(&self, from: f64, to: f64) -> f64 {
        let discriminant =
            (self.linear * self.linear - 4.0 * self.quadratic * self.value).max(0.0).sqrt();
        let q = -0.5 * (self.linear + discriminant.copysign(self.linear));
        let roots = [q / self.quadratic, self.value / q].map(|root| {
            let inside = root.clamp(from, to);
            if inside.is_nan() { (f64::INFINITY, from) } else { ((root - inside).abs(), inside) }
        });
        if roots[0].0 < roots[1].0 { roots[0].1 } else { roots[1].1 }
    }
}
