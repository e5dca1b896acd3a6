//! What is wrong with a cage, if anything.

use std::collections::HashSet;

use glam::{Vec2, Vec3};

use super::mesh::{Mesh, Topology};

/// Why polygons make no subdivision surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CageError {
    /// There is no polygon.
    #[error("a cage needs at least one polygon")]
    Empty,
    /// The sizes of the polygons do not add up to the number of indices.
    #[error("the polygons have {expected} corners, but there are {found} indices")]
    Count {
        /// The sum of the sizes.
        expected: usize,
        /// The number of indices.
        found: usize,
    },
    /// A polygon has fewer than three corners.
    #[error("polygon {0} has fewer than three corners")]
    TooSmall(usize),
    /// A polygon names a vertex that there is not.
    #[error("polygon {face} names vertex {vertex}, which does not exist")]
    Vertex {
        /// The polygon.
        face: usize,
        /// The vertex.
        vertex: u32,
    },
    /// A polygon has a vertex twice.
    #[error("polygon {face} has vertex {vertex} twice")]
    Repeated {
        /// The polygon.
        face: usize,
        /// The vertex.
        vertex: u32,
    },
    /// A vertex has a coordinate that is not a finite number.
    #[error("vertex {0} is not finite")]
    NotFinite(usize),
    /// Three or more polygons share an edge, or two that wind in opposite senses.
    #[error("more than one polygon goes from vertex {from} to vertex {to}")]
    Edge {
        /// Where the edge begins.
        from: u32,
        /// Where it ends.
        to: u32,
    },
    /// The polygons at a vertex do not form one fan: they meet in nothing but the vertex.
    #[error("the polygons at vertex {0} share no edges that would join them all")]
    Fan(u32),
}

/// The cage as a mesh, if it is one that can be subdivided. Vertices of no polygon are allowed.
pub(super) fn check(points: &[Vec3], sizes: &[u32], indices: &[u32]) -> Result<Mesh, CageError> {
    if sizes.is_empty() {
        return Err(CageError::Empty);
    }
    if let Some(vertex) = points.iter().position(|p| !p.is_finite()) {
        return Err(CageError::NotFinite(vertex));
    }
    let expected = sizes.iter().fold(0usize, |sum, &n| sum.saturating_add(n as usize));
    if expected != indices.len() {
        return Err(CageError::Count { expected, found: indices.len() });
    }
    let mut mesh = Mesh {
        points: points.iter().map(|p| p.as_dvec3()).collect(),
        starts: vec![0],
        corners: indices.iter().map(|&i| i as usize).collect(),
        uvs: Vec::with_capacity(indices.len()),
    };
    let mut edges = HashSet::new();
    for (face, &size) in sizes.iter().enumerate() {
        if size < 3 {
            return Err(CageError::TooSmall(face));
        }
        let start = mesh.starts[face];
        let corners = &indices[start..start + size as usize];
        let mut sorted = corners.to_vec();
        sorted.sort_unstable();
        if let Some(&vertex) = sorted.last()
            && vertex as usize >= points.len()
        {
            return Err(CageError::Vertex { face, vertex });
        }
        if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(CageError::Repeated { face, vertex: pair[0] });
        }
        for (k, &from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % corners.len()];
            if !edges.insert((from, to)) {
                return Err(CageError::Edge { from, to });
            }
            // Of other polygons than quadrilaterals the first subdivision makes new ones.
            mesh.uvs.push([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y][k.min(3)]);
        }
        mesh.starts.push(start + size as usize);
    }
    let topology = Topology::new(&mesh);
    let mut fans = vec![0usize; points.len()];
    for &vertex in &mesh.corners {
        fans[vertex] += 1;
    }
    match (0..points.len()).find(|&v| topology.ring(&mesh, v).count() != fans[v]) {
        Some(vertex) => Err(CageError::Fan(vertex as u32)),
        None => Ok(mesh),
    }
}
