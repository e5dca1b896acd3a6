//! What builders see of a primitive: its box and its index.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{Vec3, Vec4};
use rayburst_math::Aabb;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use super::bounds::Bounds4;
use crate::{BuildError, TriangleMesh, geometry::MAX_COORDINATE, layout::arena::advise_huge_pages};

/// Structures hold at most this many primitives.
pub(crate) const MAX_PRIMITIVES: usize = (1 << 29) - 1;

/// A primitive to build over: 32 bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PrimitiveRef {
    /// Smallest coordinates; w holds the index as the bits of a normal number, at which no
    /// arithmetic stumbles.
    lower: Vec4,
    /// Largest coordinates; w is zero.
    upper: Vec4,
}

impl PrimitiveRef {
    /// The index that marks primitives that are never hit.
    const INACTIVE: u32 = MAX_PRIMITIVES as u32;
    const INDEX_BIAS: u32 = 64 << 23;

    pub(crate) fn new(bounds: &Aabb, index: u32) -> Self {
        Self {
            lower: bounds.lower.extend(f32::from_bits(index + Self::INDEX_BIAS)),
            upper: bounds.upper.extend(0.0),
        }
    }

    /// What stands for no primitive.
    pub(super) const NONE: Self = Self { lower: Vec4::ZERO, upper: Vec4::ZERO };

    /// The primitive's index.
    #[inline(always)]
    pub(crate) fn index(&self) -> u32 {
        self.lower.w.to_bits() - Self::INDEX_BIAS
    }

    /// The primitive's index; any index for [`Self::NONE`].
    pub(super) fn index_or_any(&self) -> u32 {
        self.lower.w.to_bits().saturating_sub(Self::INDEX_BIAS)
    }

    /// The same primitive in another box.
    #[inline(always)]
    pub(super) fn with_bounds(&self, bounds: &Bounds4) -> Self {
        let (mut lower, mut upper) = (bounds.lower, bounds.upper);
        lower.w = self.lower.w;
        upper.w = 0.0;
        Self { lower, upper }
    }

    /// Smallest coordinates; w is meaningless.
    #[inline(always)]
    pub(crate) fn lower(&self) -> Vec4 {
        self.lower
    }

    /// Largest coordinates; w is zero.
    #[inline(always)]
    pub(crate) fn upper(&self) -> Vec4 {
        self.upper
    }

    /// The smallest and the largest coordinate on an axis.
    #[inline(always)]
    pub(super) fn interval(&self, axis: usize) -> [f32; 2] {
        [self.lower[axis], self.upper[axis]]
    }
}

/// Whether a box may be built over: finite and within [`MAX_COORDINATE`].
pub(crate) fn is_traceable(bounds: &Aabb) -> bool {
    let limit = Vec3::splat(MAX_COORDINATE);
    bounds.lower.cmpge(-limit).all() && bounds.upper.cmple(limit).all()
}

/// The box of a triangle that rays can hit.
pub(crate) fn active_bounds(corners: [Vec3; 3]) -> Option<Aabb> {
    let [a, b, c] = corners;
    // NaN would vanish in minima and maxima.
    if !(a.is_finite() && b.is_finite() && c.is_finite()) {
        return None;
    }
    let bounds = Aabb { lower: a.min(b).min(c), upper: a.max(b).max(c) };
    (is_traceable(&bounds) && has_area(corners)).then_some(bounds)
}

/// Whether corners are not on one line.
///
/// This is decided in `f64`, where edges and the products of their coordinates are exact for most
/// `f32`: corners on one line give zero, not a sliver of rounding errors. Most triangles are so far
/// from a line that `f32` is sure: its rounding changes neither product of a component by more than
/// `4ε` of itself, unless they underflow, when nothing is larger than [`f32::MIN_POSITIVE`].
fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    let (p, q) = (b - a, c - a);
    let first = Vec3::new(p.x * q.y, p.y * q.z, p.z * q.x);
    let second = Vec3::new(p.y * q.x, p.z * q.y, p.x * q.z);
    let error = 8.0 * f32::EPSILON * (first.abs() + second.abs()) + f32::MIN_POSITIVE;
    if (first - second).abs().cmpgt(error).any() {
        return true;
    }
    let a = a.as_dvec3();
    let (p, q) = (b.as_dvec3() - a, c.as_dvec3() - a);
    p.x * q.y != p.y * q.x || p.y * q.z != p.z * q.y || p.z * q.x != p.x * q.z
}

/// The references of all triangles that rays can hit, and how many cannot be hit.
///
/// Triangles are numbered through all geometries; `starts` holds each geometry's first number.
pub(crate) fn of_triangles(
    geometries: &[TriangleMesh<'_>],
    starts: &[u32],
) -> Result<(Vec<PrimitiveRef>, usize), BuildError> {
    let total: usize = geometries.iter().map(|mesh| mesh.indices.len()).sum();
    let mut refs: Vec<PrimitiveRef> = Vec::new();
    refs.try_reserve_exact(total).map_err(|_| BuildError::OutOfMemory {
        what: "the builder's primitives",
        bytes: total.saturating_mul(size_of::<PrimitiveRef>()),
    })?;
    advise_huge_pages(&refs);
    let any_inactive = AtomicBool::new(false);
    for (geometry, (mesh, &start)) in geometries.iter().zip(starts).enumerate() {
        let any_outside = AtomicBool::new(false);
        refs.par_extend((0..mesh.indices.len()).into_par_iter().with_min_len(4096).map(|i| {
            if is_outside(mesh, &mesh.indices[i]) {
                any_outside.store(true, Ordering::Relaxed);
            } else if let Some(bounds) = active_bounds(mesh.triangle(i)) {
                return PrimitiveRef::new(&bounds, start + i as u32);
            }
            any_inactive.store(true, Ordering::Relaxed);
            PrimitiveRef::new(&Aabb::EMPTY, PrimitiveRef::INACTIVE)
        }));
        if any_outside.into_inner() {
            return Err(outside(geometry, mesh));
        }
    }
    if any_inactive.into_inner() {
        refs.retain(|reference| reference.index() != PrimitiveRef::INACTIVE);
    }
    let inactive = total - refs.len();
    Ok((refs, inactive))
}

fn is_outside(mesh: &TriangleMesh<'_>, corners: &[u32; 3]) -> bool {
    corners[0].max(corners[1]).max(corners[2]) as usize >= mesh.positions.len()
}

/// Whether all indices of a mesh name vertices.
pub(crate) fn check_indices(
    isa: IsaLevel,
    geometry: usize,
    mesh: &TriangleMesh<'_>,
) -> Result<(), BuildError> {
    // The largest index is found in vectors; a search for one that is too large is not.
    let largest = |corners: &[[u32; 3]]| isa.dispatch(Largest(corners.as_flattened()));
    let fits = |corners: &[[u32; 3]]| (largest(corners) as usize) < mesh.positions.len();
    if mesh.indices.par_chunks(1 << 14).all(fits) { Ok(()) } else { Err(outside(geometry, mesh)) }
}

/// The largest of some numbers, or 0, as a kernel.
struct Largest<'a>(&'a [u32]);

impl Kernel for Largest<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> u32 {
        let mut largest = 0;
        for &number in self.0 {
            largest = largest.max(number);
        }
        largest
    }
}

/// Whether the indices of one triangle name vertices.
pub(crate) fn check_triangle(
    geometry: usize,
    mesh: &TriangleMesh<'_>,
    primitive: usize,
) -> Result<(), BuildError> {
    if is_outside(mesh, &mesh.indices[primitive]) {
        return Err(outside_at(geometry, mesh, primitive));
    }
    Ok(())
}

/// Names the first index that is out of range.
pub(crate) fn outside(geometry: usize, mesh: &TriangleMesh<'_>) -> BuildError {
    let primitive = mesh.indices.iter().position(|corners| is_outside(mesh, corners));
    outside_at(geometry, mesh, primitive.unwrap_or_default())
}

/// Names the index of a triangle that is out of range.
fn outside_at(geometry: usize, mesh: &TriangleMesh<'_>, primitive: usize) -> BuildError {
    let vertices = mesh.positions.len();
    let corners = mesh.indices[primitive];
    let index = corners.into_iter().find(|&index| index as usize >= vertices);
    BuildError::IndexOutOfRange {
        geometry: geometry as u32,
        primitive: primitive as u32,
        index: index.unwrap_or_default(),
        vertices,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn needles_have_area_and_lines_have_none() {
        let line = |x: f32| Vec3::new(1.0, 3.0, -2.0) * x;
        assert!(!has_area([line(0.0), line(1.0), line(3.0)]));
        assert!(!has_area([line(1e-30), line(2e-30), line(4e-30)]));
        assert!(!has_area([Vec3::X; 3]) && !has_area([Vec3::X, Vec3::Y, Vec3::Y]));
        let thin = Vec3::new(1.0, f32::from_bits(3.0f32.to_bits() + 1), -2.0);
        assert!(has_area([Vec3::ZERO, line(3.0), thin]));
        assert!(has_area([Vec3::ZERO, 1e-30 * Vec3::X, 1e-30 * Vec3::Y]));
        assert!(has_area([Vec3::ZERO, 1e18 * Vec3::X, 1e18 * Vec3::Y]));
    }
}
