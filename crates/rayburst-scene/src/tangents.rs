//! Tangents for normal maps that come without: MikkTSpace.
//!
//! M. S. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited" (2008): triangles around a vertex
//! of equal position, normal and UV that share edges and handedness form a group; the group's
//! tangent is the average of its triangles' tangents in the vertex's plane, weighted by angle.
//! What glTF 2.0 (section 3.7.2.1) asks for is the default without a threshold on angles, so groups
//! are not divided further. Groups are found by union-find over corners instead of recursion, and
//! everything is at most n log n, whatever the mesh looks like.
//!
//! Units: object space; the result points along +u, and `cross(normal, tangent) · w` against +v,
//! upwards in the image.

use std::collections::{BTreeMap, HashMap};

use glam::{Vec2, Vec3, Vec4};

use crate::{Primitive, TextureSlot};

/// Computes tangents for the UVs that a normal map is looked up with. Vertices at seams are split.
/// Does nothing to a primitive without UVs; a primitive without normals is taken as flat.
pub fn generate(primitive: &mut Primitive, normal_map: &TextureSlot) {
    let set = primitive.uvs.get(normal_map.uv_set as usize).or(primitive.uvs.first());
    let Some(uvs) = set else { return };
    let uvs: Vec<Vec2> = uvs.iter().map(|&uv| normal_map.apply(uv)).collect();
    let corners = Corners::new(primitive, &uvs).tangents();
    split(primitive, &corners);
}

/// What one triangle contributes.
#[derive(Clone, Copy)]
struct Face {
    /// Unit direction in which u grows.
    along_u: Vec3,
    /// Whether UVs wind like positions.
    preserving: bool,
    kind: FaceKind,
}

#[derive(Clone, Copy, PartialEq)]
enum FaceKind {
    /// Has a tangent.
    Good,
    /// Has an area but no usable UVs: takes the handedness of a neighbour.
    Follows,
    /// Two equal corners or numbers that are not finite.
    Degenerate,
}

/// A mesh seen as corners: corner `3 f + i` is the vertex `i` of face `f`.
struct Corners<'p> {
    primitive: &'p Primitive,
    faces: Vec<Face>,
    /// Number of the vertex with equal position, normal and UV.
    welded: Vec<u32>,
}

impl<'p> Corners<'p> {
    fn new(primitive: &'p Primitive, uvs: &[Vec2]) -> Self {
        let faces = primitive.indices.iter().map(|t| face(primitive, uvs, *t)).collect();
        let mut corners = Self { primitive, faces, welded: Vec::new() };
        corners.welded = corners.weld(uvs);
        corners
    }

    /// The unit normal at a corner; the face's where vertices have none.
    fn normal(&self, corner: usize) -> Vec3 {
        let triangle = self.primitive.indices[corner / 3];
        match &self.primitive.normals {
            Some(normals) => normals[triangle[corner % 3] as usize],
            None => {
                let [a, b, c] = triangle.map(|i| self.primitive.positions[i as usize]);
                (b - a).cross(c - a).normalize_or_zero()
            }
        }
    }

    fn weld(&self, uvs: &[Vec2]) -> Vec<u32> {
        let mut numbers: HashMap<[u32; 8], u32> = HashMap::new();
        let mut number = |vertex: usize, normal: Vec3| {
            let (p, uv) = (self.primitive.positions[vertex], uvs[vertex]);
            // Adding 0 makes −0 and 0 equal.
            let key = [p.x, p.y, p.z, normal.x, normal.y, normal.z, uv.x, uv.y];
            let next = numbers.len() as u32;
            *numbers.entry(key.map(|x| (x + 0.0).to_bits())).or_insert(next)
        };
        let indices = self.primitive.indices.as_flattened();
        match &self.primitive.normals {
            Some(normals) => {
                let by_vertex: Vec<u32> =
                    normals.iter().enumerate().map(|(v, &n)| number(v, n)).collect();
                indices.iter().map(|&v| by_vertex[v as usize]).collect()
            }
            None => (0..indices.len())
                .map(|corner| number(indices[corner] as usize, self.normal(corner)))
                .collect(),
        }
    }

    /// Pairs of corners `(a, b)` such that the edges that start there are one edge of two faces.
    fn adjacent_edges(&self) -> Vec<(usize, usize)> {
        let mut edges = Vec::with_capacity(self.welded.len());
        for corner in 0..self.welded.len() {
            if self.faces[corner / 3].kind != FaceKind::Degenerate {
                let (a, b) = (self.welded[corner], self.welded[next(corner)]);
                edges.push((a.min(b), a.max(b), corner as u32));
            }
        }
        edges.sort_unstable();
        let mut pairs = Vec::with_capacity(edges.len() / 2);
        let mut waiting = std::collections::VecDeque::new();
        for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            waiting.clear();
            for &(low, _, corner) in run {
                let corner = corner as usize;
                let forward = self.welded[corner] == low;
                // Those that wait all run the same way.
                match waiting.front() {
                    Some(&(other, direction)) if direction != forward => {
                        waiting.pop_front();
                        pairs.push((other, corner));
                    }
                    _ => waiting.push_back((corner, forward)),
                }
            }
        }
        pairs
    }

    /// The tangent of each corner, with handedness; zero where there is none.
    fn tangents(mut self) -> Vec<Vec4> {
        let pairs = self.adjacent_edges();
        self.spread_handedness(&pairs);
        let mut groups = Groups::new(self.welded.len());
        for &(a, b) in &pairs {
            let (fa, fb) = (&self.faces[a / 3], &self.faces[b / 3]);
            if fa.preserving == fb.preserving {
                // The edges run against each other.
                groups.join(a, next(b));
                groups.join(next(a), b);
            }
        }
        let mut sums = vec![Vec3::ZERO; self.welded.len()];
        for corner in 0..self.welded.len() {
            if self.faces[corner / 3].kind == FaceKind::Good {
                sums[groups.find(corner)] += self.contribution(corner);
            }
        }
        let mut tangents: Vec<Vec4> = (0..self.welded.len())
            .map(|corner| {
                let face = &self.faces[corner / 3];
                let handedness = if face.preserving { -1.0 } else { 1.0 };
                sums[groups.find(corner)].normalize_or_zero().extend(handedness)
            })
            .collect();
        self.fill_gaps(&mut tangents);
        tangents
    }

    /// Faces without usable UVs take the handedness of the nearest face that has one.
    fn spread_handedness(&mut self, pairs: &[(usize, usize)]) {
        if self.faces.iter().all(|f| f.kind != FaceKind::Follows) {
            return;
        }
        let mut neighbours: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for &(a, b) in pairs {
            neighbours.entry(a / 3).or_default().push(b / 3);
            neighbours.entry(b / 3).or_default().push(a / 3);
        }
        let mut known: Vec<bool> = self.faces.iter().map(|f| f.kind == FaceKind::Good).collect();
        let mut queue: std::collections::VecDeque<usize> =
            (0..self.faces.len()).filter(|&f| known[f]).collect();
        while let Some(f) = queue.pop_front() {
            for &n in neighbours.get(&f).into_iter().flatten() {
                if !known[n] && self.faces[n].kind == FaceKind::Follows {
                    known[n] = true;
                    self.faces[n].preserving = self.faces[f].preserving;
                    queue.push_back(n);
                }
            }
        }
    }

    /// A face's tangent in the plane of the vertex, weighted by the face's angle there.
    fn contribution(&self, corner: usize) -> Vec3 {
        let normal = self.normal(corner);
        let flatten = |v: Vec3| (v - normal * normal.dot(v)).normalize_or_zero();
        let position = |corner: usize| {
            let vertex = self.primitive.indices.as_flattened()[corner];
            self.primitive.positions[vertex as usize]
        };
        let here = position(corner);
        let to_next = flatten(position(next(corner)) - here);
        let to_last = flatten(position(next(next(corner))) - here);
        let angle = to_next.dot(to_last).clamp(-1.0, 1.0).acos();
        angle * flatten(self.faces[corner / 3].along_u)
    }

    /// Corners without a tangent take one of the same vertex, or any in the plane.
    fn fill_gaps(&self, tangents: &mut [Vec4]) {
        let mut of_vertex: HashMap<u32, Vec4> = HashMap::new();
        for (corner, tangent) in tangents.iter().enumerate() {
            if tangent.truncate() != Vec3::ZERO {
                of_vertex.entry(self.welded[corner]).or_insert(*tangent);
            }
        }
        for corner in 0..tangents.len() {
            if tangents[corner].truncate() == Vec3::ZERO {
                tangents[corner] = match of_vertex.get(&self.welded[corner]) {
                    Some(&tangent) => tangent,
                    None => {
                        let normal = self.normal(corner);
                        let normal = if normal == Vec3::ZERO { Vec3::Z } else { normal };
                        normal.any_orthonormal_vector().extend(1.0)
                    }
                };
            }
        }
    }
}

fn face(primitive: &Primitive, uvs: &[Vec2], triangle: [u32; 3]) -> Face {
    let [a, b, c] = triangle.map(|i| primitive.positions[i as usize]);
    let [ta, tb, tc] = triangle.map(|i| uvs[i as usize]);
    let mut face = Face { along_u: Vec3::ZERO, preserving: false, kind: FaceKind::Degenerate };
    let finite = a.is_finite() && b.is_finite() && c.is_finite();
    if !finite || a == b || b == c || c == a {
        return face;
    }
    face.kind = FaceKind::Follows;
    let (d1, d2) = (b - a, c - a);
    let (t1, t2) = (tb - ta, tc - ta);
    let area = t1.x * t2.y - t1.y * t2.x;
    face.preserving = area > 0.0;
    let along_u = (t2.y * d1 - t1.y * d2).normalize_or_zero();
    let along_v = t1.x * d2 - t2.x * d1;
    let usable = area.abs() > f32::MIN_POSITIVE && area.is_finite();
    if usable && along_u != Vec3::ZERO && along_v != Vec3::ZERO {
        face.along_u = if face.preserving { along_u } else { -along_u };
        face.kind = FaceKind::Good;
    }
    face
}

/// The next corner of the same face.
fn next(corner: usize) -> usize {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

/// Disjoint sets of corners; the smallest corner stands for its set.
struct Groups(Vec<u32>);

impl Groups {
    fn new(corners: usize) -> Self {
        Self((0..corners as u32).collect())
    }

    fn find(&mut self, corner: usize) -> usize {
        let mut at = corner as u32;
        while self.0[at as usize] != at {
            let above = self.0[self.0[at as usize] as usize];
            self.0[at as usize] = above;
            at = above;
        }
        at as usize
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}

/// Gives vertices their tangents; a vertex whose corners differ becomes several.
fn split(primitive: &mut Primitive, corners: &[Vec4]) {
    let count = primitive.positions.len();
    let mut tangents: Vec<Option<Vec4>> = vec![None; count];
    // Vertices beyond `count`: what they copy.
    let mut copies: Vec<u32> = Vec::new();
    let mut copy_of: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    for (vertex, &tangent) in primitive.indices.as_flattened_mut().iter_mut().zip(corners) {
        match &mut tangents[*vertex as usize] {
            first @ None => *first = Some(tangent),
            Some(first) if *first == tangent => {}
            Some(_) => {
                let key = (*vertex, tangent.to_array().map(f32::to_bits));
                *vertex = *copy_of.entry(key).or_insert_with(|| {
                    copies.push(*vertex);
                    tangents.push(Some(tangent));
                    (count + copies.len() - 1) as u32
                });
            }
        }
    }
    let unused = Vec4::new(1.0, 0.0, 0.0, 1.0);
    primitive.tangents = Some(tangents.into_iter().map(|t| t.unwrap_or(unused)).collect());
    append(&mut primitive.positions, &copies);
    primitive.normals.iter_mut().for_each(|v| append(v, &copies));
    primitive.uvs.iter_mut().for_each(|v| append(v, &copies));
    primitive.colors.iter_mut().for_each(|v| append(v, &copies));
    primitive.skin.iter_mut().for_each(|v| append(v, &copies));
    for target in &mut primitive.targets {
        for deltas in [&mut target.positions, &mut target.normals, &mut target.tangents] {
            deltas.iter_mut().for_each(|v| append(v, &copies));
        }
    }
}

fn append<T: Copy>(values: &mut Vec<T>, copies: &[u32]) {
    values.reserve_exact(copies.len());
    for &i in copies {
        values.push(values[i as usize]);
    }
}

#[cfg(test)]
mod tests {
    use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};

    use super::*;

    /// A published implementation, as an oracle.
    struct Oracle<'p> {
        primitive: &'p Primitive,
        corners: Vec<Vec4>,
    }

    impl Geometry for Oracle<'_> {
        fn num_faces(&self) -> usize {
            self.primitive.indices.len()
        }

        fn num_vertices_of_face(&self, _: usize) -> usize {
            3
        }

        fn position(&self, face: usize, vert: usize) -> [f32; 3] {
            self.primitive.positions[self.primitive.indices[face][vert] as usize].to_array()
        }

        fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
            let corners = Corners { primitive: self.primitive, faces: vec![], welded: vec![] };
            corners.normal(3 * face + vert).to_array()
        }

        fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
            self.primitive.uvs[0][self.primitive.indices[face][vert] as usize].to_array()
        }

        fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, vert: usize) {
            let [x, y, z, w] = space.unwrap_or_default().tangent_encoded();
            self.corners[3 * face + vert] = Vec4::new(x, y, z, -w);
        }
    }

    fn oracle(primitive: &Primitive) -> Vec<Vec4> {
        let corners = vec![Vec4::ZERO; 3 * primitive.indices.len()];
        let mut oracle = Oracle { primitive, corners };
        generate_tangents(&mut oracle).unwrap();
        oracle.corners
    }

    /// A wavy grid whose UVs are mirrored in the right half, with seams in normals and UVs.
    fn grid(side: usize, smooth: bool) -> Primitive {
        let mut mesh = Primitive { uvs: vec![vec![]], ..Primitive::default() };
        let mut normals = vec![];
        for y in 0..=side {
            for x in 0..=side {
                let (u, v) = (x as f32 / side as f32, y as f32 / side as f32);
                let wave = |s: f32| (7.0 * s).sin();
                mesh.positions.push(Vec3::new(u, v, 0.2 * wave(u) * wave(v + 0.3)));
                let mirrored = if u > 0.5 { 1.0 - u } else { u };
                mesh.uvs[0].push(Vec2::new(mirrored + 0.1 * wave(v), v + 0.05 * wave(u)));
                normals.push(Vec3::new(0.3 * wave(u), 0.3 * wave(v), 1.0).normalize());
            }
        }
        mesh.normals = smooth.then_some(normals);
        let row = side as u32 + 1;
        for y in 0..side as u32 {
            for x in 0..side as u32 {
                let a = y * row + x;
                mesh.indices.push([a, a + 1, a + row + 1]);
                mesh.indices.push([a, a + row + 1, a + row]);
            }
        }
        mesh
    }

    fn corners_of(mesh: &Primitive) -> Vec<Vec4> {
        let tangents = mesh.tangents.as_ref().unwrap();
        mesh.indices.as_flattened().iter().map(|&i| tangents[i as usize]).collect()
    }

    #[test]
    fn agrees_with_the_published_implementation() {
        for smooth in [true, false] {
            let mut mesh = grid(24, smooth);
            let expected = oracle(&mesh);
            generate(&mut mesh, &TextureSlot::new(0));
            for (corner, (got, want)) in corners_of(&mesh).iter().zip(&expected).enumerate() {
                assert_eq!(got.w, want.w, "handedness of corner {corner}, smooth {smooth}");
                let close = got.truncate().dot(want.truncate());
                assert!(close > 1.0 - 1e-5, "corner {corner}: {got} {want}, smooth {smooth}");
            }
        }
    }

    #[test]
    fn real_meshes_agree_with_the_published_implementation() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes/");
        for file in ["gltf_tests/NormalTangentTest.glb", "damaged_helmet/DamagedHelmet.glb"] {
            let path = std::path::PathBuf::from(folder).join(file);
            if !path.exists() {
                #[allow(clippy::print_stderr)]
                {
                    eprintln!("skipped: {} is not there", path.display());
                }
                continue;
            }
            let scene = crate::import::load(&path, &crate::import::LoadOptions::default()).unwrap();
            let mesh = &scene.meshes[0].primitives[0];
            let (got, want) = (corners_of(mesh), oracle(mesh));
            for (corner, (got, want)) in got.iter().zip(&want).enumerate() {
                // Where UVs collapse the oracle gives its default or nothing.
                if ![Vec3::X, Vec3::ZERO].contains(&want.truncate()) {
                    let close = got.truncate().dot(want.truncate()) > 1.0 - 1e-4;
                    assert!(close && got.w == want.w, "{file}, corner {corner}: {got} {want}");
                }
            }
        }
    }

    #[test]
    fn vertices_split_only_at_seams() {
        let side = 24;
        let mut mesh = grid(side, true);
        let vertices = mesh.positions.len();
        generate(&mut mesh, &TextureSlot::new(0));
        // Mirrored UVs meet in one column of vertices.
        assert_eq!(mesh.positions.len(), vertices + side + 1);
        assert_eq!(mesh.normals.as_ref().unwrap().len(), mesh.positions.len());
        assert_eq!(mesh.uvs[0].len(), mesh.positions.len());
    }

    #[test]
    fn an_upright_picture_has_its_bitangent_up() {
        // u to the right, v downwards, seen from +z.
        let mut mesh = Primitive {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0)],
            normals: Some(vec![Vec3::Z; 3]),
            uvs: vec![vec![Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0)]],
            indices: vec![[0, 1, 2]],
            ..Primitive::default()
        };
        generate(&mut mesh, &TextureSlot::new(0));
        let tangent = mesh.tangents.as_ref().unwrap()[0];
        assert_eq!(tangent, Vec4::new(1.0, 0.0, 0.0, 1.0));
        assert_eq!(Vec3::Z.cross(tangent.truncate()) * tangent.w, Vec3::Y);
        // A texture turned by a quarter turns its tangents.
        let turned = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        generate(&mut mesh, &TextureSlot { transform: turned, ..TextureSlot::new(0) });
        let tangent = mesh.tangents.as_ref().unwrap()[0];
        assert!(tangent.abs_diff_eq(Vec4::new(0.0, -1.0, 0.0, 1.0), 1e-6), "{tangent}");
    }

    #[test]
    fn broken_and_extreme_meshes_take_no_time() {
        // A fan of 200,000 triangles around one vertex, the same triangle many times over, points,
        // and numbers that are not finite.
        let count = 200_000u32;
        let angle = |i: u32| i as f32 / count as f32 * 6.0;
        let rim = (0..count).map(|i| Vec3::new(angle(i).cos(), angle(i).sin(), 0.0));
        let mut mesh = Primitive {
            positions: std::iter::once(Vec3::ZERO).chain(rim).collect(),
            ..Primitive::default()
        };
        mesh.uvs = vec![mesh.positions.iter().map(|p| Vec2::new(p.x, p.y)).collect()];
        mesh.normals = Some(vec![Vec3::Z; mesh.positions.len()]);
        mesh.indices = (1..count).map(|i| [0, i, i + 1]).collect();
        mesh.indices.extend((0..count).map(|_| [0, 5, 900]));
        mesh.indices.extend((0..count).map(|_| [7, 7, 7]));
        mesh.positions[9] = Vec3::NAN;
        mesh.uvs[0][12] = Vec2::splat(f32::INFINITY);
        let start = std::time::Instant::now();
        generate(&mut mesh, &TextureSlot::new(0));
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
        assert!(mesh.tangents.unwrap().iter().all(|t| t.is_finite() && t.w.abs() == 1.0));
    }
}
