//! Shapes for generators: triangle meshes made in code, the same bytes on every machine.
//!
//! Built from additions, multiplications, divisions and square roots only (see [`trig`]), so that
//! no platform's mathematics library shows in the geometry. Front faces wind counter-clockwise.

pub mod noise;
mod solids;
mod teapot;
pub mod trig;
mod tube;

pub use solids::{ProfilePoint, hemisphere, lathe, sphere};
pub use teapot::teapot;
pub use tube::tube;

use glam::{Mat3, Vec2, Vec3};

use crate::Primitive;

/// A mesh under construction. `normals` and `uvs` are empty or have one entry a position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit shading normals; empty shades flat.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, (0, 0) the upper left corner.
    pub uvs: Vec<Vec2>,
    /// Triangles.
    pub indices: Vec<[u32; 3]>,
}

impl Shape {
    /// Adds a flat, convex quadrilateral; corners counter-clockwise seen from its front.
    pub fn add_quad(&mut self, corners: [Vec3; 4]) {
        debug_assert!(self.normals.is_empty() && self.uvs.is_empty());
        let base = self.positions.len() as u32;
        self.positions.extend(corners);
        self.indices.push([base, base + 1, base + 2]);
        self.indices.push([base, base + 2, base + 3]);
    }

    /// Adds a quadrilateral whose texture coordinates are metres times `repeats_per_metre` along
    /// its first two sides.
    pub fn add_textured_quad(&mut self, corners: [Vec3; 4], repeats_per_metre: f32) {
        debug_assert!(self.normals.is_empty() && self.uvs.len() == self.positions.len());
        let right = (corners[1] - corners[0]).normalize();
        let up = (corners[3] - corners[0]).normalize();
        for corner in corners {
            let along = corner - corners[0];
            self.uvs.push(Vec2::new(along.dot(right), -along.dot(up)) * repeats_per_metre);
        }
        let base = self.positions.len() as u32;
        self.positions.extend(corners);
        self.indices.push([base, base + 1, base + 2]);
        self.indices.push([base, base + 2, base + 3]);
    }

    /// Adds a closed hexahedron between two quadrilaterals: `bottom` and `top`, both
    /// counter-clockwise seen from above, corner above corner.
    pub fn add_hexahedron(&mut self, bottom: [Vec3; 4], top: [Vec3; 4]) {
        debug_assert!(self.normals.is_empty() && self.uvs.is_empty());
        let base = self.positions.len() as u32;
        self.positions.extend(bottom);
        self.positions.extend(top);
        let mut quad = |a: u32, b: u32, c: u32, d: u32| {
            self.indices.push([base + a, base + b, base + c]);
            self.indices.push([base + a, base + c, base + d]);
        };
        quad(4, 5, 6, 7);
        quad(3, 2, 1, 0);
        for i in 0..4 {
            let j = (i + 1) % 4;
            quad(i, j, j + 4, i + 4);
        }
    }

    /// Adds a closed box with sides along the axes.
    pub fn add_box(&mut self, min: Vec3, max: Vec3) {
        let ring = |y: f32| {
            [
                Vec3::new(min.x, y, max.z),
                Vec3::new(max.x, y, max.z),
                Vec3::new(max.x, y, min.z),
                Vec3::new(min.x, y, min.z),
            ]
        };
        self.add_hexahedron(ring(min.y), ring(max.y));
    }

    /// Adds another shape; both or neither have normals, likewise texture coordinates.
    pub fn append(&mut self, other: &Self) {
        let fits = |a: usize, b: usize| a == 0 || b == 0 || (a > 0) == (b > 0);
        debug_assert!(fits(self.normals.len(), other.normals.len()));
        let base = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        self.uvs.extend_from_slice(&other.uvs);
        self.indices.extend(other.indices.iter().map(|t| t.map(|i| i + base)));
    }

    /// Scaled evenly, rotated, then moved.
    #[must_use]
    pub fn placed(mut self, scale: f32, rotation: Mat3, offset: Vec3) -> Self {
        for p in &mut self.positions {
            *p = rotation * (*p * scale) + offset;
        }
        for n in &mut self.normals {
            *n = (rotation * *n).normalize();
        }
        self
    }

    /// Moved.
    #[must_use]
    pub fn moved(mut self, offset: Vec3) -> Self {
        for p in &mut self.positions {
            *p += offset;
        }
        self
    }

    /// As a primitive with a material.
    pub fn into_primitive(self, material: u32) -> Primitive {
        let some = |v: Vec<Vec3>| (!v.is_empty()).then_some(v);
        Primitive {
            positions: self.positions,
            indices: self.indices,
            normals: some(self.normals),
            uvs: if self.uvs.is_empty() { Vec::new() } else { vec![self.uvs] },
            material,
            ..Primitive::default()
        }
    }
}
