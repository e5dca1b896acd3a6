//! Faces as bicubic Bézier patches with the limit surface's points and normals.
//!
//! The control points are those of Loop, Schaefer: "Approximating Catmull-Clark Subdivision Surfaces
//! with Bicubic Patches" (2008): exact where all vertices are regular, else with exact corners and
//! without gaps between neighbours. Limit tangents: Halstead, Kass, DeRose: "Efficient, Fair
//! Interpolation using Catmull-Clark Surfaces" (1993).

use std::f64::consts::PI;

use glam::DVec3;

use super::mesh::{Mesh, Topology};

/// Whether a face is a bicubic patch: it and all around it are quadrilaterals, and they meet in fours,
/// on a border in twos, or alone in a corner.
pub(super) fn is_regular(mesh: &Mesh, topology: &Topology, face: usize) -> bool {
    let is_quad = |face: usize| mesh.face(face).len() == 4;
    is_quad(face)
        && mesh.face(face).all(|corner| {
            let vertex = mesh.corners[corner];
            let (mut count, mut quads) = (0, true);
            for c in topology.ring(mesh, vertex) {
                count += 1;
                quads &= is_quad(topology.face_of(c));
            }
            quads && if topology.is_border(vertex) { count <= 2 } else { count == 4 }
        })
}

/// The control points of a quadrilateral among quadrilaterals, in rows of equal v.
pub(super) fn control_points(mesh: &Mesh, topology: &Topology, face: usize) -> [DVec3; 16] {
    // Of each corner: its own point, those next to it along the edges that leave and enter it, and
    // the one inside.
    const PLACES: [[usize; 4]; 4] = [[0, 1, 4, 5], [3, 7, 2, 6], [15, 14, 11, 10], [12, 8, 13, 9]];
    let mut points = [DVec3::ZERO; 16];
    for (corner, places) in mesh.face(face).zip(PLACES) {
        let inside = inner_point(mesh, topology, corner);
        let previous = topology.previous(mesh, corner);
        let along = |twin: Option<usize>, end: usize| match twin {
            Some(corner) => 0.5 * (inside + inner_point(mesh, topology, corner)),
            None => (2.0 * vertex(mesh, corner) + vertex(mesh, end)) / 3.0,
        };
        // The neighbour's corner at the same vertex follows its corner at the other end.
        let next = topology.next(mesh, corner);
        let beyond = topology.twin(corner).map(|twin| topology.next(mesh, twin));
        points[places[0]] = limit_point(mesh, topology, corner);
        points[places[1]] = along(beyond, next);
        points[places[2]] = along(topology.twin(previous), previous);
        points[places[3]] = inside;
    }
    points
}

fn vertex(mesh: &Mesh, corner: usize) -> DVec3 {
    mesh.points[mesh.corners[corner]]
}

/// The control point inside the face, next to a corner.
fn inner_point(mesh: &Mesh, topology: &Topology, corner: usize) -> DVec3 {
    let (next, previous) = (topology.next(mesh, corner), topology.previous(mesh, corner));
    let opposite = topology.next(mesh, next);
    let count = topology.ring(mesh, mesh.corners[corner]).count();
    // A border is the middle of what would go on beyond it.
    let border = topology.is_border(mesh.corners[corner]);
    let n = if border { (2 * count).max(4) } else { count } as f64;
    let edges = vertex(mesh, next) + vertex(mesh, previous);
    (n * vertex(mesh, corner) + 2.0 * edges + vertex(mesh, opposite)) / (n + 5.0)
}

fn limit_point(mesh: &Mesh, topology: &Topology, corner: usize) -> DVec3 {
    let at = mesh.corners[corner];
    let count = topology.ring(mesh, at).count();
    if !topology.is_border(at) {
        let sum: DVec3 = topology.ring(mesh, at).map(|c| inner_point(mesh, topology, c)).sum();
        return sum / count as f64;
    }
    match topology.border_neighbours(mesh, at) {
        Some([a, b]) if count > 1 => {
            (mesh.points[a] + 4.0 * mesh.points[at] + mesh.points[b]) / 6.0
        }
        _ => mesh.points[at],
    }
}

/// The limit normal at a corner whose vertex is not on a border; not a unit vector, and zero where the
/// surface has no normal.
pub(super) fn inner_normal(mesh: &Mesh, topology: &Topology, corner: usize) -> Option<DVec3> {
    let at = mesh.corners[corner];
    if topology.is_border(at) {
        return None;
    }
    let n = topology.ring(mesh, at).count() as f64;
    let turn = |i: f64| (2.0 * PI * i / n).cos();
    let weight = 1.0 + turn(1.0) + (PI / n).cos() * (2.0 * (9.0 + turn(1.0))).sqrt();
    let mut tangents = [DVec3::ZERO; 2];
    for (i, c) in topology.ring(mesh, at).enumerate() {
        let next = topology.next(mesh, c);
        let edge = vertex(mesh, next);
        let opposite = vertex(mesh, topology.next(mesh, next));
        // The sine is the cosine a quarter of a turn later.
        for (tangent, late) in tangents.iter_mut().zip([0.0, 0.25 * n]) {
            let i = i as f64 - late;
            *tangent += weight * turn(i) * edge + (turn(i) + turn(i + 1.0)) * opposite;
        }
    }
    Some(tangents[0].cross(tangents[1]))
}
