//! Keys along a space-filling curve straight from triangles, in one pass over them.
//!
//! The grid spans the box of the vertices, which is cheaper to find than that of the triangles. Should
//! the triangles that can be hit fill only a small part of it (stray vertices), the keys are made
//! again over the box that they fill.

use std::sync::atomic::AtomicU64;

use glam::{Affine3A, Vec3, Vec4};
use rayon::prelude::*;

use super::{
    morton::{Grid, INACTIVE},
    primitives::{active_bounds, outside},
};
use crate::{BuildError, Curve, TriangleMesh, geometry::MAX_COORDINATE};

/// Vertices or triangles of one task.
const TASK: usize = 1 << 14;

/// By how much a difference of products of edges may be off, relative to the products and absolute:
/// each is off by less than 3·2⁻²⁴ of itself, unless it is too small for that.
pub(crate) const AREA_ERROR: (f32, f32) = (1e-6, 1e-30);

/// The corners of a triangle, w zero; `None` if it can never be hit.
///
/// Decides as [`active_bounds`] does, and asks it if the area might be lost in rounding.
#[inline(always)]
pub(crate) fn hittable(corners: [Vec3; 3]) -> Option<[Vec4; 3]> {
    let [a, b, c] = corners.map(|corner| corner.extend(0.0));
    let limit = Vec4::splat(MAX_COORDINATE);
    // False for NaN.
    let inside = a.abs().cmple(limit) & b.abs().cmple(limit) & c.abs().cmple(limit);
    let (p, q) = (b - a, c - a);
    let (p1, p2) = (yzx(p), zxy(p));
    let (q1, q2) = (yzx(q), zxy(q));
    let (first, second) = (p1 * q2, p2 * q1);
    let error = (first.abs() + second.abs()) * AREA_ERROR.0 + Vec4::splat(AREA_ERROR.1);
    let has_area = (first - second).abs().cmpgt(error);
    if inside.all() && has_area.any() {
        return Some([a, b, c]);
    }
    active_bounds(corners).map(|_| [a, b, c])
}

#[inline(always)]
fn yzx(v: Vec4) -> Vec4 {
    glam::Vec4Swizzles::yzxw(v)
}

#[inline(always)]
fn zxy(v: Vec4) -> Vec4 {
    glam::Vec4Swizzles::zxyw(v)
}

/// A box in four lanes, of which the last is meaningless.
#[derive(Clone, Copy)]
struct Range {
    lower: Vec4,
    upper: Vec4,
}

impl Range {
    const EMPTY: Self =
        Self { lower: Vec4::splat(f32::INFINITY), upper: Vec4::splat(f32::NEG_INFINITY) };

    #[inline(always)]
    fn grow(&mut self, place: Vec4) {
        self.lower = self.lower.min(place);
        self.upper = self.upper.max(place);
    }

    fn merge(self, other: Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// Whether this box is much shorter than another in its longest direction.
    fn is_small_in(&self, other: &Self) -> bool {
        let side = |range: &Self| (range.upper - range.lower).truncate().max_element();
        side(self) < 0.4 * side(other)
    }
}

/// A key for each triangle; those of triangles that can never be hit are [`INACTIVE`].
pub(crate) fn of_triangles(
    geometries: &[TriangleMesh<'_>],
    starts: &[u32],
    curve: Curve,
) -> Result<Vec<AtomicU64>, BuildError> {
    let vertices = geometries
        .iter()
        .map(|mesh| {
            let tasks = mesh.positions.par_chunks(TASK);
            tasks.map(|p| vertex_range(p, mesh.transform.as_ref())).reduce(empty, Range::merge)
        })
        .fold(Range::EMPTY, Range::merge);
    // Places are thrice the centroids.
    let vertices = Range { lower: vertices.lower * 3.0, upper: vertices.upper * 3.0 };
    let (keys, places) = keys(geometries, starts, &vertices, curve)?;
    if places.is_small_in(&vertices) {
        return Ok(self::keys(geometries, starts, &places, curve)?.0);
    }
    Ok(keys)
}

fn empty() -> Range {
    Range::EMPTY
}

fn vertex_range(positions: &[Vec3], transform: Option<&Affine3A>) -> Range {
    let limit = Vec4::splat(MAX_COORDINATE);
    let mut range = Range::EMPTY;
    for &position in positions {
        let position = match transform {
            Some(transform) => transform.transform_point3(position),
            None => position,
        };
        let place = position.extend(0.0);
        if place.abs().cmple(limit).all() {
            range.grow(place);
        }
    }
    range
}

/// The keys in a grid over a box, and the box that the places of active triangles fill.
fn keys(
    geometries: &[TriangleMesh<'_>],
    starts: &[u32],
    range: &Range,
    curve: Curve,
) -> Result<(Vec<AtomicU64>, Range), BuildError> {
    let total: usize = geometries.iter().map(|mesh| mesh.indices.len()).sum();
    let mut keys: Vec<AtomicU64> = Vec::new();
    keys.try_reserve_exact(total).map_err(|_| BuildError::OutOfMemory {
        what: "the builder's keys",
        bytes: total.saturating_mul(size_of::<u64>()),
    })?;
    (0..total).into_par_iter().map(|_| AtomicU64::new(INACTIVE)).collect_into_vec(&mut keys);
    let grid = Grid::new(range.lower, range.upper, curve);
    let mut places = Range::EMPTY;
    let mut rest = keys.as_mut_slice();
    for (geometry, (mesh, &start)) in geometries.iter().zip(starts).enumerate() {
        let (own, others) = rest.split_at_mut(mesh.indices.len());
        rest = others;
        let filled = own
            .par_chunks_mut(TASK)
            .enumerate()
            .map(|(task, keys)| fill(mesh, &grid, task * TASK, start, keys))
            .try_reduce(empty, |a, b| Some(a.merge(b)));
        match filled {
            Some(filled) => places = places.merge(filled),
            None => return Err(outside(geometry, mesh)),
        }
    }
    Ok((keys, places))
}

/// Writes the keys of consecutive triangles; `None` if an index is out of range.
fn fill(
    mesh: &TriangleMesh<'_>,
    grid: &Grid,
    first: usize,
    start: u32,
    keys: &mut [AtomicU64],
) -> Option<Range> {
    let mut places = Range::EMPTY;
    let indices = &mesh.indices[first..][..keys.len()];
    for (i, (&[a, b, c], key)) in indices.iter().zip(keys).enumerate() {
        let corner = |index: u32| {
            let position = *mesh.positions.get(index as usize)?;
            Some(match &mesh.transform {
                Some(transform) => transform.transform_point3(position),
                None => position,
            })
        };
        if let Some([a, b, c]) = hittable([corner(a)?, corner(b)?, corner(c)?]) {
            let place = a + b + c;
            places.grow(place);
            *key.get_mut() = grid.key(place, start + (first + i) as u32);
        }
    }
    Some(places)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hittable_decides_as_the_exact_test_does() {
        let numbers = [0.0, 1.0, -1.0, 3.0, 0.1, 0.3, 1e-20, 1e-38, 1e15, 1e18, 2e18, f32::NAN];
        let mut state = 1u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
            numbers[(state >> 40) as usize % numbers.len()]
        };
        let (mut yes, mut no) = (0, 0);
        for _ in 0..200_000 {
            let corners = [(); 3].map(|()| Vec3::new(number(), number(), number()));
            let expected = active_bounds(corners).is_some();
            assert_eq!(hittable(corners).is_some(), expected, "{corners:?}");
            if expected { yes += 1 } else { no += 1 }
        }
        assert!(yes > 10_000 && no > 10_000, "{yes} {no}");
    }
}
