//! The surface at a hit: position with its error bound, normals, texture coordinates.

use glam::{Vec2, Vec3, Vec4};
use rayburst_math::{
    Hit, HitKind,
    offset::{gamma, interpolation_error, intersection_error, spawn_origin},
};

use crate::{FlatGeometry, FlatInstance, FlatScene};

/// A point of a surface in world space.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Where.
    pub position: Vec3,
    /// Bound on the error of each coordinate of `position`.
    pub error: Vec3,
    /// Unit normal of the triangle's plane, on its front side.
    pub geometric_normal: Vec3,
    /// Unit interpolated normal, on the front side.
    pub shading_normal: Vec3,
    /// Interpolated tangent with the bitangent's handedness in w; zero when the mesh has none.
    pub tangent: Vec4,
    /// The first two UV sets; a missing second set repeats the first.
    pub uv: [Vec2; 2],
    /// Edges of the triangle from its first corner to the others.
    pub edges: [Vec3; 2],
    /// The same edges in each UV set.
    pub uv_edges: [[Vec2; 2]; 2],
    /// Linear vertex colour.
    pub color: Vec4,
    /// Index of the material.
    pub material: u32,
    /// Index of the node.
    pub node: u32,
    /// Whether the front was hit.
    pub front: bool,
}

impl Surface {
    /// The geometric normal on the side of `direction`.
    #[inline]
    pub fn normal_towards(&self, direction: Vec3) -> Vec3 {
        if self.geometric_normal.dot(direction) < 0.0 {
            -self.geometric_normal
        } else {
            self.geometric_normal
        }
    }

    /// The origin of a ray that leaves towards `direction` and does not meet this surface again.
    #[inline]
    pub fn spawn(&self, direction: Vec3) -> Vec3 {
        spawn_origin(self.position, self.error, self.geometric_normal, direction)
    }
}

/// Corners of a triangle in world space, in the winding of the file.
#[derive(Clone, Copy, Debug)]
pub struct WorldTriangle {
    /// Corners.
    pub points: [Vec3; 3],
    /// Whether the front is the clockwise side (an odd number of mirrorings).
    pub flipped: bool,
}

impl WorldTriangle {
    /// Area times the unit normal of the front.
    #[inline]
    pub fn area_vector(&self) -> Vec3 {
        let [a, b, c] = self.points;
        let n = 0.5 * (b - a).cross(c - a);
        if self.flipped { -n } else { n }
    }
}

impl FlatScene {
    /// Records of the instance and the geometry that a hit names.
    #[inline]
    pub fn records(&self, hit: &Hit) -> (&FlatInstance, &FlatGeometry) {
        let instance = &self.instances[hit.instance as usize];
        (instance, &self.geometries[(instance.first_geometry + hit.geometry) as usize])
    }

    /// UVs at a hit in one of the primitive's sets; zero when the primitive has none.
    #[inline]
    pub fn uv_at(&self, hit: &Hit, set: u32) -> Vec2 {
        let (_, geometry) = self.records(hit);
        let primitive = &geometry.primitive;
        let Some(uvs) = primitive.uvs.get(set as usize).or(primitive.uvs.first()) else {
            return Vec2::ZERO;
        };
        let [a, b, c] = primitive.indices[hit.primitive as usize].map(|i| uvs[i as usize]);
        (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c
    }

    /// A triangle in world space.
    pub fn world_triangle(&self, instance: u32, geometry: u32, primitive: u32) -> WorldTriangle {
        let record = &self.instances[instance as usize];
        let g = &self.geometries[(record.first_geometry + geometry) as usize];
        let points = g.primitive.indices[primitive as usize].map(|i| {
            let p = g.transform.transform_point3(g.primitive.positions[i as usize]);
            if record.is_identity { p } else { record.object_to_world.transform_point3(p) }
        });
        let mirrored = g.mirrored != (record.object_to_world.matrix3.determinant() < 0.0);
        WorldTriangle { points, flipped: mirrored }
    }

    /// The surface that a hit names. The hit must be one of this scene's.
    pub fn surface(&self, hit: &Hit) -> Surface {
        let (instance, geometry) = self.records(hit);
        let primitive = &geometry.primitive;
        let corner = primitive.indices[hit.primitive as usize].map(|i| i as usize);
        let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);

        // Object space of the instance: exactly the vertices that the BLAS holds.
        let p = corner.map(|i| geometry.transform.transform_point3(primitive.positions[i]));
        let mut position = weights.x * p[0] + weights.y * p[1] + weights.z * p[2];
        let mut error = interpolation_error(p[0], p[1], p[2], hit.u, hit.v);
        let mut edges = [p[1] - p[0], p[2] - p[0]];
        let mut area_vector = edges[0].cross(edges[1]);
        if geometry.mirrored {
            area_vector = -area_vector;
        }
        error += Vec3::splat(intersection_error(edges, area_vector.length()));
        let mut geometric_normal = unit_cross(area_vector, edges);

        let flat = primitive.normals.as_ref().map_or(geometric_normal, |normals| {
            let n = weights.x * normals[corner[0]]
                + weights.y * normals[corner[1]]
                + weights.z * normals[corner[2]];
            (geometry.normal_transform * n).try_normalize().unwrap_or(geometric_normal)
        });
        let mut shading_normal = flat;
        let mut tangent = primitive.tangents.as_ref().map_or(Vec4::ZERO, |tangents| {
            let t = weights.x * tangents[corner[0]]
                + weights.y * tangents[corner[1]]
                + weights.z * tangents[corner[2]];
            let sign = if geometry.mirrored { -1.0 } else { 1.0 };
            geometry.transform.transform_vector3(t.truncate()).extend(tangents[corner[0]].w * sign)
        });

        if !instance.is_identity {
            let m = &instance.object_to_world;
            let abs = glam::Mat3A::from_cols(
                m.matrix3.x_axis.abs(),
                m.matrix3.y_axis.abs(),
                m.matrix3.z_axis.abs(),
            );
            let magnitude = Vec3::from(abs * glam::Vec3A::from(position.abs()))
                + Vec3::from(m.translation).abs();
            error = Vec3::from(abs * glam::Vec3A::from(error)) * (1.0 + gamma(3))
                + gamma(4) * magnitude;
            position = m.transform_point3(position);
            edges = edges.map(|e| m.transform_vector3(e));
            geometric_normal = (instance.normal_to_world * geometric_normal).normalize_or(Vec3::Y);
            shading_normal =
                (instance.normal_to_world * shading_normal).normalize_or(geometric_normal);
            let sign = if m.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
            tangent = m.transform_vector3(tangent.truncate()).extend(tangent.w * sign);
        }
        if shading_normal.dot(geometric_normal) < 0.0 {
            // Authored normals that point to the back: the winding decides.
            shading_normal = -shading_normal;
        }

        let mut uv = [Vec2::ZERO; 2];
        let mut uv_edges = [[Vec2::ZERO; 2]; 2];
        for (set, uvs) in primitive.uvs.iter().take(2).enumerate() {
            let c = corner.map(|i| uvs[i]);
            uv[set] = weights.x * c[0] + weights.y * c[1] + weights.z * c[2];
            uv_edges[set] = [c[1] - c[0], c[2] - c[0]];
        }
        if primitive.uvs.len() == 1 {
            uv[1] = uv[0];
            uv_edges[1] = uv_edges[0];
        }
        let color = primitive.colors.as_ref().map_or(Vec4::ONE, |colors| {
            weights.x * colors[corner[0]]
                + weights.y * colors[corner[1]]
                + weights.z * colors[corner[2]]
        });
        Surface {
            position,
            error,
            geometric_normal,
            shading_normal,
            tangent,
            uv,
            edges,
            uv_edges,
            color,
            material: geometry.material,
            node: geometry.node,
            front: (hit.kind == HitKind::TRIANGLE_FRONT) != geometry.mirrored,
        }
    }
}

/// The unit vector of a cross product of edges; tiny triangles, whose cross product underflows, are
/// scaled first.
#[inline]
fn unit_cross(cross: Vec3, edges: [Vec3; 2]) -> Vec3 {
    cross.try_normalize().unwrap_or_else(|| {
        let scaled = edges.map(|e| e / e.abs().max_element().max(f32::MIN_POSITIVE));
        scaled[0].cross(scaled[1]).normalize_or(Vec3::Y)
    })
}
