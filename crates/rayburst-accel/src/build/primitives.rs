//! What builders see of a primitive: its box and its index.

use glam::{Vec3, Vec4};
use rayburst_math::Aabb;
use rayon::prelude::*;

use crate::{BuildError, TriangleMesh, geometry::MAX_COORDINATE};

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

    /// The primitive's index.
    #[inline(always)]
    pub(crate) fn index(&self) -> u32 {
        self.lower.w.to_bits() - Self::INDEX_BIAS
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
}

/// Whether a box may be built over: finite and within [`MAX_COORDINATE`].
pub(crate) fn is_traceable(bounds: &Aabb) -> bool {
    let limit = Vec3::splat(MAX_COORDINATE);
    bounds.lower.cmpge(-limit).all() && bounds.upper.cmple(limit).all()
}

/// The box of a triangle that rays can hit.
///
/// The area is tested in `f64`, where edges and the products of their coordinates are exact for
/// most `f32`: corners on one line give zero, not a sliver of rounding errors.
pub(crate) fn active_bounds(corners: [Vec3; 3]) -> Option<Aabb> {
    let [a, b, c] = corners;
    // NaN would vanish in minima and maxima.
    if !(a.is_finite() && b.is_finite() && c.is_finite()) {
        return None;
    }
    let bounds = Aabb { lower: a.min(b).min(c), upper: a.max(b).max(c) };
    let a = a.as_dvec3();
    let (p, q) = (b.as_dvec3() - a, c.as_dvec3() - a);
    let has_area = p.x * q.y != p.y * q.x || p.y * q.z != p.z * q.y || p.z * q.x != p.x * q.z;
    (has_area && is_traceable(&bounds)).then_some(bounds)
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
    for (geometry, (mesh, &start)) in geometries.iter().zip(starts).enumerate() {
        check_indices(geometry, mesh)?;
        refs.par_extend((0..mesh.indices.len()).into_par_iter().with_min_len(4096).map(|i| {
            match active_bounds(mesh.triangle(i)) {
                Some(bounds) => PrimitiveRef::new(&bounds, start + i as u32),
                None => PrimitiveRef::new(&Aabb::EMPTY, PrimitiveRef::INACTIVE),
            }
        }));
    }
    refs.retain(|reference| reference.index() != PrimitiveRef::INACTIVE);
    let inactive = total - refs.len();
    Ok((refs, inactive))
}

pub(crate) fn check_indices(geometry: usize, mesh: &TriangleMesh<'_>) -> Result<(), BuildError> {
    let vertices = mesh.positions.len();
    let outside =
        |corners: &[u32; 3]| corners[0].max(corners[1]).max(corners[2]) as usize >= vertices;
    match mesh.indices.par_iter().with_min_len(4096).position_first(outside) {
        None => Ok(()),
        Some(primitive) => {
            let corners = &mesh.indices[primitive];
            let index = corners.iter().copied().find(|&index| index as usize >= vertices);
            Err(BuildError::IndexOutOfRange {
                geometry: geometry as u32,
                primitive: primitive as u32,
                index: index.unwrap_or_default(),
                vertices,
            })
        }
    }
}
