//! Surfaces at sixteen hits.

use glam::{Mat3A, Vec3, Vec3A};
use rayburst_math::{
    Hit, HitKind,
    lanes::{F32x16, LANES, Mask16, Vec2x16, Vec3x16},
    offset::gamma,
};

use crate::{FlatInstance, FlatScene};

/// Texture coordinates of sixteen surfaces in one UV set.
#[derive(Clone, Copy, Debug, Default)]
pub struct UvSet16 {
    /// At the hits.
    pub at: Vec2x16,
    /// Along the triangles' edges from their first corners.
    pub edges: [Vec2x16; 2],
}

/// Sixteen surfaces in world space; see [`crate::Surface`].
#[derive(Clone, Debug)]
pub struct Surface16 {
    /// Where.
    pub position: Vec3x16,
    /// Bounds of the error of each coordinate of `position`.
    pub error: Vec3x16,
    /// Unit normals of the triangles' planes, on the front sides.
    pub geometric_normal: Vec3x16,
    /// Unit interpolated normals, on the front sides.
    pub shading_normal: Vec3x16,
    /// Interpolated tangents; zero where the mesh has none.
    pub tangent: Vec3x16,
    /// Which way bitangents go: 1 or −1.
    pub handedness: F32x16,
    /// Edges of the triangles from their first corners to the others.
    pub edges: [Vec3x16; 2],
    /// The first two UV sets; a missing second set repeats the first.
    pub uv: [UvSet16; 2],
    /// Linear vertex colours.
    pub color: Vec3x16,
    /// Indices of materials.
    pub material: [u32; LANES],
    /// Indices of nodes.
    pub node: [u32; LANES],
    /// Whether fronts were hit.
    pub front: Mask16,
}

/// What is in memory of the triangles of sixteen hits, in the space of their instances.
struct Corners {
    points: [Vec3x16; 3],
    /// Interpolated; zero where the mesh has none.
    normal: Vec3x16,
    /// Not mirrored: 1; else −1.
    side: F32x16,
    has_normals: Mask16,
    tangent: Vec3x16,
    handedness: F32x16,
    uv: [[Vec2x16; 3]; 2],
    two_sets: bool,
    color: Vec3x16,
    material: [u32; LANES],
    node: [u32; LANES],
    front: Mask16,
    u: F32x16,
    v: F32x16,
    /// The instances' records, if any is placed by a matrix.
    placed: bool,
}

/// Matrices of instances: columns, the translation last.
struct Placements {
    to_world: [Vec3x16; 4],
    normals: [Vec3x16; 3],
    placed: Mask16,
}

impl FlatScene {
    /// The surfaces that sixteen hits name. The hits must be of this scene.
    #[inline(always)]
    pub fn surface16(&self, hits: &[Hit; LANES]) -> Surface16 {
        let corners = gather(self, hits);
        let mut surface = corners.surface();
        if corners.placed {
            placements(self, hits).apply(&mut surface);
        }
        // Authored normals that point to the back: the winding decides.
        let back = surface.shading_normal.dot(surface.geometric_normal).is_less(F32x16::ZERO);
        surface.shading_normal = back.select(-surface.shading_normal, surface.shading_normal);
        surface
    }
}

#[inline(never)]
fn gather(scene: &FlatScene, hits: &[Hit; LANES]) -> Corners {
    let mut corners = Corners {
        points: [Vec3x16::ZERO; 3],
        normal: Vec3x16::ZERO,
        side: F32x16::ONE,
        has_normals: Mask16::NONE,
        tangent: Vec3x16::ZERO,
        handedness: F32x16::ONE,
        uv: [[Vec2x16::ZERO; 3]; 2],
        two_sets: false,
        color: Vec3x16::splat(Vec3::ONE),
        material: [0; LANES],
        node: [0; LANES],
        front: Mask16::NONE,
        u: F32x16::ZERO,
        v: F32x16::ZERO,
        placed: false,
    };
    for (lane, hit) in hits.iter().enumerate() {
        let (instance, geometry) = scene.records(hit);
        let primitive = &*geometry.primitive;
        let corner = primitive.indices[hit.primitive as usize].map(|i| i as usize);
        let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
        for (points, i) in corners.points.iter_mut().zip(corner) {
            points.set_lane(lane, geometry.transform.transform_point3(primitive.positions[i]));
        }
        if let Some(normals) = &primitive.normals {
            let n = weights.x * normals[corner[0]]
                + weights.y * normals[corner[1]]
                + weights.z * normals[corner[2]];
            corners.normal.set_lane(lane, geometry.normal_transform * n);
            corners.has_normals.set_lane(lane, true);
        }
        if let Some(tangents) = &primitive.tangents {
            let t = weights.x * tangents[corner[0]]
                + weights.y * tangents[corner[1]]
                + weights.z * tangents[corner[2]];
            let sign = if geometry.mirrored { -1.0 } else { 1.0 };
            corners.tangent.set_lane(lane, geometry.transform.transform_vector3(t.truncate()));
            corners.handedness.0[lane] =
                if tangents[corner[0]].w * sign < 0.0 { -1.0 } else { 1.0 };
        }
        for (set, uvs) in primitive.uvs.iter().take(2).enumerate() {
            corners.two_sets |= set == 1;
            for (uv, i) in corners.uv[set].iter_mut().zip(corner) {
                uv.set_lane(lane, uvs[i]);
            }
        }
        if let Some(colors) = &primitive.colors {
            let color = weights.x * colors[corner[0]]
                + weights.y * colors[corner[1]]
                + weights.z * colors[corner[2]];
            corners.color.set_lane(lane, color.truncate());
        }
        corners.side.0[lane] = if geometry.mirrored { -1.0 } else { 1.0 };
        corners.material[lane] = geometry.material;
        corners.node[lane] = geometry.node;
        corners.front.set_lane(lane, (hit.kind == HitKind::TRIANGLE_FRONT) != geometry.mirrored);
        corners.u.0[lane] = hit.u;
        corners.v.0[lane] = hit.v;
        corners.placed |= !instance.is_identity;
    }
    if corners.two_sets {
        // Meshes with a single set beside others.
        for (lane, hit) in hits.iter().enumerate() {
            if scene.records(hit).1.primitive.uvs.len() == 1 {
                for corner in 0..3 {
                    let first = corners.uv[0][corner].lane(lane);
                    corners.uv[1][corner].set_lane(lane, first);
                }
            }
        }
    }
    corners
}

impl Corners {
    /// Surfaces in the space of the instances.
    #[inline(always)]
    fn surface(&self) -> Surface16 {
        let [a, b, c] = self.points;
        let (u, v) = (self.u, self.v);
        let w = 1.0 - u - v;
        let parts = [a * w, b * u, c * v];
        let position = (parts[0] + parts[1]) + parts[2];
        let spread = (parts[0].abs() + parts[1].abs()) + parts[2].abs();
        let edges = [b - a, c - a];
        let cross = edges[0].cross(edges[1]);

        // `rayburst_math::offset::intersection_error`.
        let size =
            edges[0].abs().max(edges[1].abs()).max((edges[1] - edges[0]).abs()).max_element();
        let area = cross.length();
        let narrow = size * size / area.max(F32x16::splat(f32::MIN_POSITIVE));
        let narrow = narrow.max(F32x16::ONE).min(F32x16::splat(1e4));
        let off = F32x16::splat(gamma(4)) * size * narrow.sqrt();
        let off = Vec3x16 { x: off, y: off, z: off };
        let error = spread * F32x16::splat(gamma(7)) + off;

        let tiny = edge_scaled(edges).normalize_or(Vec3x16::splat(Vec3::Y));
        let geometric_normal = (cross * self.side).normalize_or(tiny);
        let smooth = self.normal.normalize_or(geometric_normal);
        let shading_normal = self.has_normals.select(smooth, geometric_normal);

        let mut uv = [UvSet16::default(); 2];
        for set in 0..2 {
            let [a, b, c] = self.uv[if self.two_sets { set } else { 0 }];
            uv[set] = UvSet16 { at: (a * w + b * u) + c * v, edges: [b - a, c - a] };
        }
        Surface16 {
            position,
            error,
            geometric_normal,
            shading_normal,
            tangent: self.tangent,
            handedness: self.handedness,
            edges,
            uv,
            color: self.color,
            material: self.material,
            node: self.node,
            front: self.front,
        }
    }
}

/// The vector products of edges that are scaled first: of triangles so tiny that it underflows.
#[inline(always)]
fn edge_scaled(edges: [Vec3x16; 2]) -> Vec3x16 {
    let least = F32x16::splat(f32::MIN_POSITIVE);
    let first = edges[0] * (1.0 / edges[0].abs().max_element().max(least));
    let second = edges[1] * (1.0 / edges[1].abs().max_element().max(least));
    first.cross(second)
}

#[inline(never)]
fn placements(scene: &FlatScene, hits: &[Hit; LANES]) -> Placements {
    let mut placements = Placements {
        to_world: [Vec3x16::ZERO; 4],
        normals: [Vec3x16::ZERO; 3],
        placed: Mask16::NONE,
    };
    for (lane, hit) in hits.iter().enumerate() {
        let FlatInstance { object_to_world: m, normal_to_world, is_identity, .. } =
            &scene.instances[hit.instance as usize];
        placements.placed.set_lane(lane, !is_identity);
        for (column, axis) in columns(&m.matrix3).into_iter().enumerate() {
            placements.to_world[column].set_lane(lane, axis.into());
        }
        placements.to_world[3].set_lane(lane, m.translation.into());
        for (column, axis) in columns(normal_to_world).into_iter().enumerate() {
            placements.normals[column].set_lane(lane, axis.into());
        }
    }
    placements
}

fn columns(matrix: &Mat3A) -> [Vec3A; 3] {
    [matrix.x_axis, matrix.y_axis, matrix.z_axis]
}

/// Products of matrices, given by columns, and vectors.
#[inline(always)]
fn transform([x, y, z]: [Vec3x16; 3], v: Vec3x16) -> Vec3x16 {
    (x * v.x + y * v.y) + z * v.z
}

impl Placements {
    /// From the instances' space into the world. Called, so that baked scenes do not pay for it.
    #[inline(never)]
    fn apply(&self, surface: &mut Surface16) {
        let [x, y, z, translation] = self.to_world;
        let (linear, absolute) = ([x, y, z], [x.abs(), y.abs(), z.abs()]);
        let magnitude = transform(absolute, surface.position.abs()) + translation.abs();
        let error = transform(absolute, surface.error) * F32x16::splat(1.0 + gamma(3))
            + magnitude * F32x16::splat(gamma(4));
        let position = transform(linear, surface.position) + translation;
        let edges = [transform(linear, surface.edges[0]), transform(linear, surface.edges[1])];
        let geometric_normal =
            transform(self.normals, surface.geometric_normal).normalize_or(Vec3x16::splat(Vec3::Y));
        let shading_normal =
            transform(self.normals, surface.shading_normal).normalize_or(geometric_normal);
        let mirrored = x.dot(y.cross(z)).is_less(F32x16::ZERO);
        let handedness = mirrored.select(-surface.handedness, surface.handedness);
        let tangent = transform(linear, surface.tangent);

        let at = self.placed;
        surface.position = at.select(position, surface.position);
        surface.error = at.select(error, surface.error);
        for i in 0..2 {
            surface.edges[i] = at.select(edges[i], surface.edges[i]);
        }
        surface.geometric_normal = at.select(geometric_normal, surface.geometric_normal);
        surface.shading_normal = at.select(shading_normal, surface.shading_normal);
        surface.handedness = at.select(handedness, surface.handedness);
        surface.tangent = at.select(tangent, surface.tangent);
    }
}
