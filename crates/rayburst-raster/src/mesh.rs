//! Meshes in the world, and how a view sees them: placement, and what is outside of the picture.

use glam::{Affine3A, DAffine3, DMat3, Vec3, Vec4};
use rayburst_math::Aabb;

use crate::{Clusters, View};

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug)]
pub struct Mesh<'a> {
    /// Its triangles.
    pub clusters: &'a Clusters,
    /// From the clusters' space to the world (the instance transform); may shear, mirror and scale
    /// non-uniformly. A mesh whose transform has no inverse is never seen.
    pub transform: Affine3A,
    /// What is told of pixels that show it.
    pub instance: u32,
    /// What is told of pixels that show it.
    pub geometry: u32,
    /// Whether it is solid: then [`crate::Coverage`] is never asked.
    pub opaque: bool,
}

/// What a view must know of a mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    /// The eye in the clusters' space, rounded as the origins of rays are.
    pub(crate) origin: Vec4,
    /// What a step along each axis from there adds to (x, y, depth, 0), in pixels and world units.
    pub(crate) columns: [Vec4; 3],
    /// The left, right, upper and lower side of what the picture shows: slopes along the axes, values at
    /// the origin.
    sides: [Vec4; 3],
    side_offsets: Vec4,
    /// The number of its first triangle.
    pub(crate) first_id: u32,
    /// The number of its first cluster.
    pub(crate) first_cluster: usize,
    /// Whether counter-clockwise triangles appear clockwise.
    pub(crate) mirrored: bool,
    pub(crate) opaque: bool,
    pub(crate) perspective: bool,
    /// Whether it has an inverse.
    pub(crate) usable: bool,
}

/// How far beyond the picture's sides clusters are kept, in pixels: jitter and rounding.
const BORDER: f32 = 2.0;
/// Rounding errors of boxes, relative to distances.
const ROUNDING: f32 = 1.0 / (1 << 20) as f32;

impl Placed {
    pub(crate) fn new(view: &View, mesh: &Mesh<'_>, first_id: u32, first_cluster: usize) -> Self {
        let m = &mesh.transform;
        let to_world = DAffine3::from_cols(
            Vec3::from(m.matrix3.x_axis).as_dvec3(),
            Vec3::from(m.matrix3.y_axis).as_dvec3(),
            Vec3::from(m.matrix3.z_axis).as_dvec3(),
            Vec3::from(m.translation).as_dvec3(),
        );
        let inverse = to_world.inverse();
        let rounded = Affine3A::from_cols(
            inverse.matrix3.x_axis.as_vec3().into(),
            inverse.matrix3.y_axis.as_vec3().into(),
            inverse.matrix3.z_axis.as_vec3().into(),
            inverse.translation.as_vec3().into(),
        );
        let origin =
            if *m == Affine3A::IDENTITY { view.eye } else { rounded.transform_point3(view.eye) };
        let matrix: DMat3 = view.matrix() * to_world.matrix3;
        let columns =
            [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|c| c.as_vec3().extend(0.0));
        let half = 0.5 * view.extent() + BORDER;
        let perspective = view.is_perspective();
        let sides = columns.map(|c| {
            let at = if perspective { half * c.z } else { glam::Vec2::ZERO };
            Vec4::new(at.x + c.x, at.x - c.x, at.y + c.y, at.y - c.y)
        });
        let side_offsets =
            if perspective { Vec4::ZERO } else { Vec4::new(half.x, half.x, half.y, half.y) };
        Self {
            origin: origin.extend(0.0),
            columns,
            sides,
            side_offsets,
            first_id,
            first_cluster,
            // The picture's y axis points down, so its frame is right-handed: (r, −u, v).
            mirrored: matrix.determinant() < 0.0,
            opaque: mesh.opaque,
            perspective,
            usable: to_world.is_finite() && rounded.is_finite() && matrix.is_finite(),
        }
    }

    /// The depth at which a box may begin; `None` if it is outside of the picture or behind.
    #[inline]
    pub(crate) fn sees(&self, centre: Vec3, half: Vec3) -> Option<f32> {
        let d = centre - self.origin.truncate();
        let (reach, h) = (d.abs() + half, half);
        let [x, y, z] = self.sides;
        let distance = x * d.x + y * d.y + z * d.z + self.side_offsets;
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let radius = ax * h.x + ay * h.y + az * h.z;
        let error = (ax * reach.x + ay * reach.y + az * reach.z) * ROUNDING;
        // Comparisons are false for NaN: what is not known is kept.
        if (distance + radius + error).cmplt(Vec4::ZERO).any() {
            return None;
        }
        let along = Vec3::new(self.columns[0].z, self.columns[1].z, self.columns[2].z);
        let (depth, radius) = (along.dot(d), along.abs().dot(h));
        let error = along.abs().dot(reach) * ROUNDING;
        let behind = depth + radius + error < 0.0;
        (!behind).then_some(depth - radius - error)
    }

    /// The box as the picture shows it: least and greatest coordinates from its centre, and the greatest
    /// nearness; `None` if it reaches the eye.
    #[inline]
    pub(crate) fn shown(&self, centre: Vec3, half: Vec3) -> Option<(Vec4, f32)> {
        let d = centre - self.origin.truncate();
        let [x, y, z] = self.columns;
        let middle = x * d.x + y * d.y + z * d.z;
        let (hx, hy, hz) = (x * half.x, y * half.y, z * half.z);
        // (x, y, −x, −y) of corners, and depths.
        let mut bounds = Vec4::INFINITY;
        let mut nearest = f32::INFINITY;
        for corner in 0..8 {
            let sign = |bit: u32, v: Vec4| if corner >> bit & 1 == 0 { v } else { -v };
            let p = middle + sign(0, hx) + sign(1, hy) + sign(2, hz);
            nearest = nearest.min(p.z);
            let p = if self.perspective { p / p.z } else { p };
            bounds = bounds.min(Vec4::new(p.x, p.y, -p.x, -p.y));
        }
        let reach = d.abs() + half;
        let error = reach.element_sum() * ROUNDING * Vec3::new(x.z, y.z, z.z).abs().max_element();
        nearest -= error;
        let in_front = nearest > 64.0 * error;
        if self.perspective && !in_front || !bounds.is_finite() {
            return None;
        }
        let nearness = if self.perspective { 1.0 / nearest } else { -nearest };
        Some((bounds, nearness))
    }
}

/// Whether a view may see anything of a box, at the depth where it begins.
#[inline]
pub(crate) fn sees_bounds(placed: &Placed, bounds: &Aabb) -> bool {
    if bounds.is_empty() || !placed.usable {
        return false;
    }
    let centre = 0.5 * bounds.lower + 0.5 * bounds.upper;
    placed.sees(centre, (bounds.upper - centre).max(centre - bounds.lower)).is_some()
}
