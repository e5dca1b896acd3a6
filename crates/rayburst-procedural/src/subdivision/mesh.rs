//! Polygons, their neighbours, and one step of subdivision.
//!
//! Catmull, Clark: "Recursively Generated B-Spline Surfaces on Arbitrary Topological Meshes" (1978),
//! with the border rules of Nasri: "Polyhedral Subdivision Methods for Free-Form Surfaces" (1987).

use std::collections::HashMap;

use glam::{DVec3, Vec2};

/// Polygons with counter-clockwise corners.
pub(super) struct Mesh {
    pub(super) points: Vec<DVec3>,
    /// The first corner of each face, and one past the last.
    pub(super) starts: Vec<usize>,
    /// The vertex of each corner.
    pub(super) corners: Vec<usize>,
    /// The place of each corner in the cage's face, where faces are quadrilaterals.
    pub(super) uvs: Vec<Vec2>,
}

impl Mesh {
    pub(super) fn face_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The corners of a face.
    pub(super) fn face(&self, face: usize) -> std::ops::Range<usize> {
        self.starts[face]..self.starts[face + 1]
    }

    fn average(&self, face: usize) -> DVec3 {
        let corners = self.face(face);
        let count = corners.len() as f64;
        corners.map(|c| self.points[self.corners[c]]).sum::<DVec3>() / count
    }

    /// The mesh of some faces only.
    pub(super) fn part(&self, faces: impl Iterator<Item = usize>) -> Self {
        let mut part =
            Self { points: Vec::new(), starts: vec![0], corners: Vec::new(), uvs: Vec::new() };
        let mut numbers = HashMap::new();
        for face in faces {
            for corner in self.face(face) {
                let vertex = self.corners[corner];
                let number = *numbers.entry(vertex).or_insert_with(|| {
                    part.points.push(self.points[vertex]);
                    part.points.len() - 1
                });
                part.corners.push(number);
                part.uvs.push(self.uvs[corner]);
            }
            part.starts.push(part.corners.len());
        }
        part
    }
}

/// Who is whose neighbour.
pub(super) struct Topology {
    /// The face of each corner.
    face: Vec<usize>,
    /// For the edge from each corner to the next one: the corner from which the neighbour goes back.
    twin: Vec<Option<usize>>,
    /// A corner of each vertex: of those on a border the one whose edge is the border.
    first: Vec<Option<usize>>,
}

impl Topology {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let mut face = vec![0; mesh.corners.len()];
        for f in 0..mesh.face_count() {
            face[mesh.face(f)].fill(f);
        }
        let mut topology = Self { face, twin: Vec::new(), first: vec![None; mesh.points.len()] };
        let edge = |c: usize| (mesh.corners[c], mesh.corners[topology.next(mesh, c)]);
        let edges: HashMap<_, _> = (0..mesh.corners.len()).map(|c| (edge(c), c)).collect();
        let twin = |c: usize| {
            let (from, to) = edge(c);
            edges.get(&(to, from)).copied()
        };
        topology.twin = (0..mesh.corners.len()).map(twin).collect();
        for (c, &vertex) in mesh.corners.iter().enumerate() {
            if topology.first[vertex].is_none() || topology.twin[c].is_none() {
                topology.first[vertex] = Some(c);
            }
        }
        topology
    }

    pub(super) fn next(&self, mesh: &Mesh, corner: usize) -> usize {
        let face = mesh.face(self.face[corner]);
        if corner + 1 == face.end { face.start } else { corner + 1 }
    }

    pub(super) fn previous(&self, mesh: &Mesh, corner: usize) -> usize {
        let face = mesh.face(self.face[corner]);
        if corner == face.start { face.end - 1 } else { corner - 1 }
    }

    pub(super) fn face_of(&self, corner: usize) -> usize {
        self.face[corner]
    }

    pub(super) fn twin(&self, corner: usize) -> Option<usize> {
        self.twin[corner]
    }

    pub(super) fn is_border(&self, vertex: usize) -> bool {
        self.first[vertex].is_some_and(|corner| self.twin[corner].is_none())
    }

    /// The corners around a vertex, counter-clockwise.
    pub(super) fn ring<'a>(
        &'a self,
        mesh: &'a Mesh,
        vertex: usize,
    ) -> impl Iterator<Item = usize> + 'a {
        let first = self.first[vertex];
        std::iter::successors(first, move |&corner| {
            self.twin[self.previous(mesh, corner)].filter(|&next| Some(next) != first)
        })
    }

    /// The two neighbours of a vertex along the border.
    pub(super) fn border_neighbours(&self, mesh: &Mesh, vertex: usize) -> Option<[usize; 2]> {
        let first = self.first[vertex]?;
        let last = self.ring(mesh, vertex).last()?;
        Some([self.next(mesh, first), self.previous(mesh, last)].map(|c| mesh.corners[c]))
    }
}

/// The mesh subdivided once; the children of a face are as many as its corners, side by side and in
/// the same order, those of the first face first.
pub(super) fn subdivide(mesh: &Mesh, topology: &Topology) -> Mesh {
    let faces = mesh.face_count();
    let mut points: Vec<DVec3> = (0..faces).map(|f| mesh.average(f)).collect();

    let mut edge_points = vec![0; mesh.corners.len()];
    for c in 0..mesh.corners.len() {
        let next = topology.next(mesh, c);
        let ends = mesh.points[mesh.corners[c]] + mesh.points[mesh.corners[next]];
        edge_points[c] = match topology.twin(c) {
            Some(twin) if twin < c => edge_points[twin],
            twin => {
                points.push(match twin {
                    Some(twin) => {
                        let sides = [c, twin].map(|c| points[topology.face_of(c)]);
                        0.25 * (ends + sides[0] + sides[1])
                    }
                    None => 0.5 * ends,
                });
                points.len() - 1
            }
        };
    }

    let vertices = points.len();
    for vertex in 0..mesh.points.len() {
        let moved = vertex_point(mesh, topology, vertex, &points[..faces]);
        points.push(moved);
    }

    let mut children = Mesh { points, starts: vec![0], corners: Vec::new(), uvs: Vec::new() };
    for face in 0..faces {
        let corners = mesh.face(face);
        let quad = corners.len() == 4;
        let centre = 0.25 * corners.clone().map(|c| mesh.uvs[c]).sum::<Vec2>();
        for c in corners {
            let (previous, next) = (topology.previous(mesh, c), topology.next(mesh, c));
            children.corners.extend([
                vertices + mesh.corners[c],
                edge_points[c],
                face,
                edge_points[previous],
            ]);
            let uv = |c: usize| mesh.uvs[c];
            children.uvs.extend(if quad {
                [uv(c), 0.5 * (uv(c) + uv(next)), centre, 0.5 * (uv(c) + uv(previous))]
            } else {
                [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]
            });
            children.starts.push(children.corners.len());
        }
    }
    children
}

fn vertex_point(mesh: &Mesh, topology: &Topology, vertex: usize, centres: &[DVec3]) -> DVec3 {
    let point = mesh.points[vertex];
    let (mut faces, mut edges, mut count) = (DVec3::ZERO, DVec3::ZERO, 0);
    for corner in topology.ring(mesh, vertex) {
        faces += centres[topology.face_of(corner)];
        edges += mesh.points[mesh.corners[topology.next(mesh, corner)]];
        count += 1;
    }
    let n = f64::from(count);
    if !topology.is_border(vertex) {
        // (Q + 2R + (n - 3) S) / n with R the average of the edges' middles.
        return if count == 0 { point } else { (faces / n + edges / n + (n - 2.0) * point) / n };
    }
    match topology.border_neighbours(mesh, vertex) {
        Some([a, b]) if count > 1 => 0.125 * (mesh.points[a] + mesh.points[b]) + 0.75 * point,
        _ => point,
    }
}
