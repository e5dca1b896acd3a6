//! Closed meshes and where their inside is.

use std::collections::BTreeMap;

use glam::{Affine3A, Mat3, Quat, Vec3};
use rayburst_accel::TriangleMesh;
use rayburst_math::hash::{pcg, to_unit};

/// A mesh that no ray leaves.
#[derive(Clone, Debug, Default)]
pub struct ClosedMesh {
    /// Vertex positions, shared between triangles.
    pub positions: Vec<Vec3>,
    /// Vertices of each triangle.
    pub indices: Vec<[u32; 3]>,
    /// Images of the cube from −1 to 1 that lie inside, well away from the surface.
    pub inside: Vec<Affine3A>,
}

impl ClosedMesh {
    /// The geometry of a BLAS.
    pub fn geometry(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.positions, &self.indices)
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.indices[triangle].map(|i| self.positions[i as usize])
    }

    /// Mesh and inside under an affine map.
    #[must_use]
    pub fn mapped(mut self, map: Affine3A) -> Self {
        self.positions.iter_mut().for_each(|p| *p = map.transform_point3(*p));
        self.inside.iter_mut().for_each(|cube| *cube = map * *cube);
        self
    }

    /// The vertices rounded to whole numbers, then moved by whole numbers: exact far away too.
    #[must_use]
    pub fn on_lattice(mut self, scale: f32, offset: Vec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = (*p * scale).round() + offset);
        let map = Affine3A::from_translation(offset) * Affine3A::from_scale(Vec3::splat(scale));
        self.inside.iter_mut().for_each(|cube| *cube = map * *cube);
        self
    }

    /// Both meshes; what is inside the first must be inside the second.
    #[must_use]
    pub fn within(mut self, outer: &Self) -> Self {
        let first = self.positions.len() as u32;
        self.positions.extend(&outer.positions);
        self.indices.extend(outer.indices.iter().map(|t| t.map(|i| i + first)));
        self
    }

    /// What keeps the mesh from being closed, if anything does: each edge must be passed once in
    /// either direction.
    pub fn defect(&self) -> Option<String> {
        let mut edges = BTreeMap::new();
        for &[a, b, c] in &self.indices {
            for edge in [(a, b), (b, c), (c, a)] {
                if edges.insert(edge, ()).is_some() {
                    return Some(format!("the edge {edge:?} is passed twice in one direction"));
                }
            }
        }
        let open = edges.keys().find(|&&(a, b)| !edges.contains_key(&(b, a)))?;
        Some(format!("the edge {open:?} has one triangle"))
    }
}

/// A cube around the origin.
fn cube(half: f32) -> Vec<Affine3A> {
    vec![Affine3A::from_scale(Vec3::splat(half))]
}

/// A sphere made of an icosahedron by splitting each triangle in four, `level` times, whose vertices
/// are then moved to radii between 0.75 and 0.75 + `noise`.
pub fn noisy_sphere(level: u32, noise: f32) -> ClosedMesh {
    let golden = 0.5 + 1.25f32.sqrt();
    let mut positions: Vec<Vec3> = (0..12)
        .map(|i: usize| {
            let sign = |bit: usize| if i >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let mut p = Vec3::ZERO;
            p[i / 4] = sign(0);
            p[(i / 4 + 1) % 3] = golden * sign(1);
            p.normalize()
        })
        .collect();
    // The faces of the icosahedron: triples of neighbours, wound outwards.
    let near = |a: Vec3, b: Vec3| a.dot(b) > 0.4 && a.dot(b) < 0.9;
    let mut indices = vec![];
    for a in 0..12usize {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i| positions[i]);
                if near(p, q) && near(q, r) && near(r, p) {
                    let outwards = (q - p).cross(r - p).dot(p) > 0.0;
                    indices.push(if outwards { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
    for _ in 0..level {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = positions[a as usize] + positions[b as usize];
                positions.push(sum.normalize());
                positions.len() as u32 - 1
            })
        };
        let split = |&[a, b, c]: &[u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        indices = indices.iter().flat_map(split).collect();
    }
    for (i, p) in positions.iter_mut().enumerate() {
        *p *= 0.75 + noise * to_unit(pcg(i as u32));
    }
    ClosedMesh { positions, indices, inside: cube(0.35) }
}

/// A box from −1 to 1 whose edges are cut into `cells` equal parts on each axis.
pub fn grid_box(cells: [u32; 3]) -> ClosedMesh {
    let mut mesh = ClosedMesh { inside: cube(0.9), ..ClosedMesh::default() };
    let mut ids = BTreeMap::new();
    for axis in 0..3 {
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, cells[axis]] {
            for (a, b) in (0..cells[j]).flat_map(|a| (0..cells[k]).map(move |b| (a, b))) {
                let mut vertex = |a: u32, b: u32| {
                    let mut p = [0; 3];
                    (p[axis], p[j], p[k]) = (side, a, b);
                    *ids.entry(p).or_insert_with(|| {
                        let at = |i: usize| 2.0 * p[i] as f32 / cells[i] as f32 - 1.0;
                        mesh.positions.push(Vec3::new(at(0), at(1), at(2)));
                        mesh.positions.len() as u32 - 1
                    })
                };
                let [p, q, r, s] =
                    [vertex(a, b), vertex(a + 1, b), vertex(a + 1, b + 1), vertex(a, b + 1)];
                mesh.indices.extend(if side == 0 {
                    [[p, r, q], [p, s, r]]
                } else {
                    [[p, q, r], [p, r, s]]
                });
            }
        }
    }
    mesh
}

/// A closed mesh, alone or instanced.
#[derive(Clone, Debug)]
pub struct ClosedScene {
    /// For messages.
    pub name: String,
    /// The mesh.
    pub mesh: ClosedMesh,
    /// Where it is placed; without instances if nowhere.
    pub instances: Vec<Affine3A>,
}

/// All scenes built from formulas.
pub fn scenes() -> Vec<ClosedScene> {
    let scaled = |scale: Vec3| Affine3A::from_scale(scale);
    let skew = Mat3::from_cols(Vec3::X, Vec3::new(30.0, 1.0, 0.0), Vec3::new(0.0, 20.0, 1.0));
    let far = Vec3::new(1e6, 2e6, -3e6);
    let rotation = Affine3A::from_quat(Quat::from_xyzw(0.5, -0.1, 0.3, 0.8).normalize());
    let sphere = noisy_sphere(3, 0.5);
    let mut scenes: Vec<_> = [
        ("noisy sphere", noisy_sphere(4, 0.5)),
        ("spikes", noisy_sphere(3, 4.0)),
        ("smooth sphere", noisy_sphere(4, 0.0)),
        ("cube", grid_box([1; 3])),
        ("grid box", grid_box([12; 3])),
        ("rotated grid box", grid_box([9, 8, 7]).mapped(rotation)),
        ("sliver box", grid_box([160, 2, 1])),
        ("skewed box", grid_box([5; 3]).mapped(Affine3A::from_mat3(skew))),
        ("stretched sphere", sphere.clone().mapped(scaled(Vec3::new(1000.0, 1.0, 0.01)))),
        ("sphere × 1e-6", sphere.clone().mapped(scaled(Vec3::splat(1e-6)))),
        ("sphere × 1e6", sphere.clone().mapped(scaled(Vec3::splat(1e6)))),
        ("box × 1e-30", grid_box([6; 3]).mapped(scaled(Vec3::splat(1e-30)))),
        ("sphere × 1e17", sphere.clone().mapped(scaled(Vec3::splat(1e17)))),
        ("far sphere", sphere.clone().on_lattice(64.0, far)),
        ("far box", grid_box([8; 3]).on_lattice(4.0, -far)),
        (
            "sphere in a box",
            sphere.clone().within(&grid_box([4; 3]).mapped(scaled(Vec3::ONE * 2.0))),
        ),
    ]
    .map(|(name, mesh)| ClosedScene { name: name.to_owned(), mesh, instances: vec![] })
    .into();
    let place = |i: u32| {
        let unit = |k: u32| 2.0 * to_unit(pcg(100 * i + k)) - 1.0;
        let axes = Mat3::from_quat(Quat::from_xyzw(unit(0), unit(1), unit(2), 0.6).normalize());
        let scale =
            Vec3::new(1.0 + 0.5 * unit(3), 1.0 + 0.5 * unit(4), [1.0, -0.7][i as usize % 2]);
        let shear = Mat3::from_cols(Vec3::X, Vec3::new(0.8 * unit(5), 1.0, 0.0), Vec3::Z);
        let translation = 3.0 * Vec3::new(unit(6), unit(7), unit(8));
        Affine3A::from_mat3_translation(axes * shear * Mat3::from_diagonal(scale), translation)
    };
    for (name, mesh) in [("sphere", &sphere), ("grid box", &grid_box([6; 3]))] {
        for count in [1, 24] {
            scenes.push(ClosedScene {
                name: format!("{count} × {name}"),
                mesh: mesh.clone(),
                instances: (0..count).map(place).collect(),
            });
        }
    }
    scenes
}

/// How often the mesh winds around a point: the sum of the solid angles of its triangles (van
/// Oosterom and Strackee, "The solid angle of a plane triangle", 1983), in full spheres.
pub fn winding_number(mesh: &ClosedMesh, p: Vec3) -> f64 {
    let angle = |triangle: usize| {
        let [a, b, c] =
            mesh.corners(triangle).map(|corner| (corner.as_dvec3() - p.as_dvec3()).normalize());
        let determinant = a.dot(b.cross(c));
        2.0 * determinant.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    };
    (0..mesh.indices.len()).map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_are_closed_and_the_inside_is_inside() {
        for scene in scenes() {
            let mesh = &scene.mesh;
            assert_eq!(mesh.defect(), None, "{}", scene.name);
            for cube in &mesh.inside {
                for corner in 0..8 {
                    let sign = |bit: u32| if corner >> bit & 1 == 0 { 1.0 } else { -1.0 };
                    let p = cube.transform_point3(Vec3::new(sign(0), sign(1), sign(2)));
                    let winding = winding_number(mesh, p);
                    assert!(winding > 0.9, "{}: {p} has winding number {winding}", scene.name);
                }
            }
        }
    }

    #[test]
    fn an_open_mesh_is_no_closed_one() {
        let mut mesh = grid_box([3; 3]);
        mesh.indices.pop();
        assert!(mesh.defect().is_some());
        let outside = winding_number(&grid_box([2; 3]), Vec3::new(3.0, 0.1, 0.2));
        assert!(outside.abs() < 1e-6, "{outside}");
    }
}
