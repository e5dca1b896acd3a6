//! The patches of a cage.
//!
//! Patches of faces that are regular on their level, and subdivision of the others only: Nießner,
//! Loop, Meyer, DeRose: "Feature-Adaptive GPU Rendering of Catmull-Clark Subdivision Surfaces" (2012).

use glam::{DVec3, Vec2};

use super::limit::{control_points, inner_normal, is_regular};
use super::mesh::{Mesh, Topology, subdivide};

/// A bicubic Bézier patch.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    pub(super) points: [DVec3; 16],
    uvs: [Vec2; 4],
    /// Which normals at the corners to blend, if not the patch's own are to be taken.
    normals: Option<usize>,
}

impl Patch {
    pub(super) fn face_uv(&self, u: f64, v: f64) -> Vec2 {
        let (u, v) = (u as f32, v as f32);
        self.uvs[0].lerp(self.uvs[1], u).lerp(self.uvs[3].lerp(self.uvs[2], u), v)
    }

    /// The unit normal; against the ray where there is none.
    pub(super) fn normal(&self, normals: &[[DVec3; 4]], u: f64, v: f64, direction: DVec3) -> DVec3 {
        let normal = match self.normals {
            Some(index) => {
                let n = &normals[index];
                n[0].lerp(n[1], u).lerp(n[3].lerp(n[2], u), v)
            }
            None => self.own_normal(u, v),
        };
        // A little way inwards there is a normal at corners where edges are in line or of no length.
        let inwards = |x: f64| 0.5 + 0.999 * (x - 0.5);
        let scaled = |n: DVec3| (n / n.abs().max_element()).try_normalize();
        scaled(normal)
            .or_else(|| scaled(self.own_normal(inwards(u), inwards(v))))
            .unwrap_or(-direction)
    }

    fn own_normal(&self, u: f64, v: f64) -> DVec3 {
        let (_, along, across) = evaluate(&self.points, u, v);
        along.cross(across)
    }
}

/// The point of a patch and its derivatives.
pub(super) fn evaluate(points: &[DVec3; 16], u: f64, v: f64) -> (DVec3, DVec3, DVec3) {
    let weights = |t: f64| {
        let s = 1.0 - t;
        let values = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
        let slopes = [-3.0 * s * s, 3.0 * s * (s - 2.0 * t), 3.0 * t * (2.0 * s - t), 3.0 * t * t];
        (values, slopes)
    };
    let ((u, du), (v, dv)) = (weights(u), weights(v));
    let (mut point, mut along, mut across) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for j in 0..4 {
        let (mut row, mut slope) = (DVec3::ZERO, DVec3::ZERO);
        for i in 0..4 {
            row += u[i] * points[4 * j + i];
            slope += du[i] * points[4 * j + i];
        }
        point += v[j] * row;
        along += v[j] * slope;
        across += dv[j] * row;
    }
    (point, along, across)
}

/// The patches of a cage, and the normals that some of them blend.
pub(super) fn build(cage: Mesh, depth: u32) -> (Vec<Patch>, Vec<[DVec3; 4]>) {
    let (mut patches, mut normals) = (Vec::new(), Vec::new());
    let mut wanted: Vec<usize> = (0..cage.face_count()).collect();
    let mut mesh = cage;
    for level in 0..=depth {
        let topology = Topology::new(&mesh);
        let mut irregular = Vec::new();
        for face in wanted {
            let regular = is_regular(&mesh, &topology, face);
            if !regular && level < depth {
                irregular.push(face);
                continue;
            }
            let corners = mesh.face(face).start;
            let mut patch = Patch {
                points: control_points(&mesh, &topology, face),
                uvs: std::array::from_fn(|k| mesh.uvs[corners + k]),
                normals: None,
            };
            if !regular {
                normals.push(corner_normals(&mesh, &topology, &patch, corners));
                patch.normals = Some(normals.len() - 1);
            }
            patches.push(patch);
        }
        if irregular.is_empty() {
            break;
        }

        // Children depend on nothing but the faces around their parent, so that all others can go.
        // What is computed from these borders, which are none, is never looked at.
        let mut touched = vec![false; mesh.points.len()];
        for &face in &irregular {
            mesh.face(face).for_each(|c| touched[mesh.corners[c]] = true);
        }
        let mut is_irregular = vec![false; mesh.face_count()];
        irregular.iter().for_each(|&face| is_irregular[face] = true);
        let kept: Vec<usize> = (0..mesh.face_count())
            .filter(|&face| mesh.face(face).any(|c| touched[mesh.corners[c]]))
            .collect();
        let part = mesh.part(kept.iter().copied());
        wanted = kept
            .iter()
            .enumerate()
            .filter(|&(_, &face)| is_irregular[face])
            .flat_map(|(number, _)| part.face(number))
            .collect();
        mesh = subdivide(&part, &Topology::new(&part));
    }
    (patches, normals)
}

/// The unit normals at the corners of a patch: of the limit surface, or else of the patch.
fn corner_normals(mesh: &Mesh, topology: &Topology, patch: &Patch, corners: usize) -> [DVec3; 4] {
    const PLACES: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    std::array::from_fn(|k| {
        let [u, v] = PLACES[k];
        inner_normal(mesh, topology, corners + k)
            .and_then(DVec3::try_normalize)
            .or_else(|| patch.own_normal(u, v).try_normalize())
            .or_else(|| patch.own_normal(0.5, 0.5).try_normalize())
            .unwrap_or(DVec3::ZERO)
    })
}
