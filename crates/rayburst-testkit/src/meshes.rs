//! Small meshes for oracle tests: random, degenerate, axis-aligned, thin, huge, tiny and closed ones.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use rayburst_math::{Aabb, hash::Rng, warp};

/// A named triangle mesh.
#[derive(Clone, Debug)]
pub struct TestMesh {
    /// For messages.
    pub name: &'static str,
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertices of each triangle.
    pub indices: Vec<[u32; 3]>,
    /// A point from which every ray must hit, if the mesh is closed.
    pub inside: Option<Vec3>,
}

impl TestMesh {
    fn of_triangles(name: &'static str, triangles: impl IntoIterator<Item = [Vec3; 3]>) -> Self {
        let positions: Vec<Vec3> = triangles.into_iter().flatten().collect();
        let indices = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        Self { name, indices: indices.collect(), positions, inside: None }
    }

    /// Bounds of the finite vertices.
    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(self.positions.iter().copied().filter(|p| p.is_finite()))
    }

    /// The mesh under `p · scale + offset`.
    pub fn placed(mut self, name: &'static str, scale: f32, offset: Vec3) -> Self {
        self.name = name;
        for p in self.positions.iter_mut().chain(&mut self.inside) {
            *p = *p * scale + offset;
        }
        self
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.indices[triangle].map(|i| self.positions[i as usize])
    }
}

/// Triangles of random size and place in the unit cube.
pub fn random_soup(count: usize, size: f32, seed: u64) -> TestMesh {
    let mut rng = Rng::new(seed);
    let triangles = (0..count).map(|_| {
        let at = rng.vec3();
        [(); 3].map(|()| at + size * (rng.vec3() - 0.5))
    });
    TestMesh::of_triangles("random soup", triangles.collect::<Vec<_>>())
}

/// Points, needles, repeated, non-finite and ordinary triangles, all mixed.
pub fn degenerate_soup(count: usize, seed: u64) -> TestMesh {
    let mut rng = Rng::new(seed);
    let triangles = (0..count).map(|i| {
        let (a, b, c) = (rng.vec3(), rng.vec3(), rng.vec3());
        match i % 8 {
            0 => [a, a, a],
            1 => [a, b, b],
            2 => [a, 0.5 * (a + b), b],
            3 => [a, b, Vec3::new(c.x, f32::NAN, c.z)],
            4 => [a, Vec3::splat(f32::INFINITY), c],
            5 => [Vec3::ZERO, Vec3::X, Vec3::Y],
            _ => [a, a + 0.1 * (b - 0.5), a + 0.1 * (c - 0.5)],
        }
    });
    TestMesh::of_triangles("degenerate soup", triangles.collect::<Vec<_>>())
}

/// Needles: long, thin triangles in random directions.
pub fn needles(count: usize, seed: u64) -> TestMesh {
    let mut rng = Rng::new(seed);
    let triangles = (0..count).map(|_| {
        let a = rng.vec3();
        let along = warp::uniform_sphere(rng.vec2());
        [a, a + along, a + along + 1e-3 * warp::uniform_sphere(rng.vec2())]
    });
    TestMesh::of_triangles("needles", triangles.collect::<Vec<_>>())
}

/// Axis-aligned boxes on an integer grid, many faces coplanar and touching.
pub fn boxes(per_axis: u32) -> TestMesh {
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for cell in 0..per_axis.pow(3) {
        let at = Vec3::new(
            (cell % per_axis) as f32,
            (cell / per_axis % per_axis) as f32,
            (cell / per_axis / per_axis) as f32,
        );
        push_box(&mut positions, &mut indices, at, at + Vec3::ONE);
    }
    TestMesh { name: "boxes", positions, indices, inside: None }
}

/// One closed axis-aligned cube with shared vertices.
pub fn cube() -> TestMesh {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    push_box(&mut positions, &mut indices, -Vec3::ONE, Vec3::ONE);
    TestMesh { name: "cube", positions, indices, inside: Some(Vec3::new(0.1, -0.2, 0.3)) }
}

fn push_box(positions: &mut Vec<Vec3>, indices: &mut Vec<[u32; 3]>, lower: Vec3, upper: Vec3) {
    let first = positions.len() as u32;
    for corner in 0..8 {
        let pick = |bit: usize, axis: usize| {
            if corner >> bit & 1 == 0 { lower[axis] } else { upper[axis] }
        };
        positions.push(Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2)));
    }
    // Outward faces, two triangles each.
    for [a, b, c, d] in
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    {
        indices.push([first + a, first + b, first + c]);
        indices.push([first + a, first + c, first + d]);
    }
}

/// A closed sphere of radius 1 with shared vertices, `2 · columns · (rows − 1)` triangles.
pub fn sphere(columns: u32, rows: u32) -> TestMesh {
    let mut positions = vec![Vec3::Y];
    for row in 1..rows {
        let (sin, cos) = (PI * row as f32 / rows as f32).sin_cos();
        for column in 0..columns {
            let phi = TAU * column as f32 / columns as f32;
            positions.push(Vec3::new(sin * phi.cos(), cos, sin * phi.sin()));
        }
    }
    positions.push(-Vec3::Y);
    let at = |row: u32, column: u32| 1 + (row - 1) * columns + column % columns;
    let last = positions.len() as u32 - 1;
    let mut indices = Vec::new();
    for column in 0..columns {
        indices.push([0, at(1, column + 1), at(1, column)]);
        for row in 1..rows - 1 {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            indices.extend([[a, b, c], [b, d, c]]);
        }
        indices.push([last, at(rows - 1, column), at(rows - 1, column + 1)]);
    }
    TestMesh { name: "sphere", positions, indices, inside: Some(Vec3::new(0.05, 0.1, -0.07)) }
}

/// A closed box of height-field walls around random spikes: a sphere whose vertices are moved along
/// their radius by a random factor in [0.5, 1].
pub fn spiky_sphere(columns: u32, rows: u32, seed: u64) -> TestMesh {
    let mut rng = Rng::new(seed);
    let mut mesh = sphere(columns, rows);
    mesh.name = "spiky sphere";
    for p in &mut mesh.positions {
        *p *= rng.range(0.5, 1.0);
    }
    mesh
}

/// The meshes of the oracle sweeps, at most 10,000 triangles each.
pub fn all() -> Vec<TestMesh> {
    vec![
        random_soup(2000, 0.1, 1),
        random_soup(300, 1.5, 2),
        degenerate_soup(1600, 3),
        needles(1000, 4),
        boxes(4),
        cube(),
        sphere(40, 20),
        spiky_sphere(48, 24, 5),
        sphere(32, 16).placed("sphere at 1e6", 1.0, Vec3::new(1e6, -1e6, 1e6)),
        spiky_sphere(32, 16, 6).placed("spiky sphere of 1e-6", 1e-6, Vec3::ZERO),
        sphere(24, 12).placed("sphere of 1e6", 1e6, Vec3::ZERO),
    ]
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    #[test]
    fn closed_meshes_use_every_edge_once_each_way() {
        for mesh in all().into_iter().filter(|m| m.inside.is_some()) {
            let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
            for [a, b, c] in &mesh.indices {
                for edge in [(*a, *b), (*b, *c), (*c, *a)] {
                    *edges.entry(edge).or_default() += 1;
                }
            }
            assert!(
                edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)),
                "{}",
                mesh.name
            );
        }
    }

    #[test]
    fn faces_of_closed_meshes_point_outwards() {
        for mesh in [cube(), sphere(40, 20)] {
            for i in 0..mesh.indices.len() {
                let [a, b, c] = mesh.corners(i);
                assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "{} {i}", mesh.name);
            }
        }
    }
}
