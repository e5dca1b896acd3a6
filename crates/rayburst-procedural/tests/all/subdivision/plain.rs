//! Catmull-Clark subdivision of everything, face by face and as the rules are written down, and the
//! triangles that it ends in.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};

use crate::check::Expected;

/// Points and polygons.
#[derive(Clone)]
pub(crate) struct Polygons {
    pub(crate) points: Vec<DVec3>,
    pub(crate) faces: Vec<Vec<usize>>,
}

impl Polygons {
    pub(crate) fn new(points: &[Vec3], faces: &[&[usize]]) -> Self {
        Self {
            points: points.iter().map(|p| p.as_dvec3()).collect(),
            faces: faces.iter().map(|f| f.to_vec()).collect(),
        }
    }

    /// What the library takes.
    pub(crate) fn parts(&self) -> (Vec<Vec3>, Vec<u32>, Vec<u32>) {
        (
            self.points.iter().map(|p| p.as_vec3()).collect(),
            self.faces.iter().map(|f| f.len() as u32).collect(),
            self.faces.iter().flatten().map(|&i| i as u32).collect(),
        )
    }

    /// One step: first the moved vertices, then the centres of the faces, then the edges.
    pub(crate) fn subdivided(&self) -> Self {
        let centres: Vec<DVec3> = self
            .faces
            .iter()
            .map(|f| f.iter().map(|&i| self.points[i]).sum::<DVec3>() / f.len() as f64)
            .collect();
        let Neighbours { edges, faces_of, edges_of } = self.neighbours();
        let mut points = Vec::new();
        for (vertex, &old) in self.points.iter().enumerate() {
            let (around, mine) = (&faces_of[vertex], &edges_of[vertex]);
            let border: Vec<_> = mine.iter().filter(|e| edges[e].len() == 1).collect();
            let n = around.len() as f64;
            let new = if around.is_empty() || (around.len() == 1 && !border.is_empty()) {
                old
            } else if !border.is_empty() {
                let middles: DVec3 =
                    border.iter().map(|e| 0.5 * (self.points[e.0] + self.points[e.1])).sum();
                0.5 * old + 0.25 * middles
            } else {
                let q = around.iter().map(|&f| centres[f]).sum::<DVec3>() / n;
                let r =
                    mine.iter().map(|e| 0.5 * (self.points[e.0] + self.points[e.1])).sum::<DVec3>()
                        / mine.len() as f64;
                (q + 2.0 * r + (n - 3.0) * old) / n
            };
            points.push(new);
        }
        let first_centre = points.len();
        points.extend(&centres);
        let mut numbers = BTreeMap::new();
        for (&(a, b), faces) in &edges {
            numbers.insert((a, b), points.len());
            let ends = self.points[a] + self.points[b];
            points.push(match faces[..] {
                [f, g] => 0.25 * (ends + centres[f] + centres[g]),
                _ => 0.5 * ends,
            });
        }
        let mut faces = Vec::new();
        for (number, face) in self.faces.iter().enumerate() {
            let n = face.len();
            let edge = |k: usize| {
                let (a, b) = (face[k % n], face[(k + 1) % n]);
                numbers[&(a.min(b), a.max(b))]
            };
            for k in 0..n {
                faces.push(vec![face[k], edge(k), first_centre + number, edge(k + n - 1)]);
            }
        }
        Self { points, faces }
    }

    fn neighbours(&self) -> Neighbours {
        let mut edges: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        for (number, face) in self.faces.iter().enumerate() {
            for (k, &a) in face.iter().enumerate() {
                let b = face[(k + 1) % face.len()];
                edges.entry((a.min(b), a.max(b))).or_default().push(number);
            }
        }
        let mut faces_of = vec![Vec::new(); self.points.len()];
        for (number, face) in self.faces.iter().enumerate() {
            face.iter().for_each(|&vertex| faces_of[vertex].push(number));
        }
        let mut edges_of = vec![Vec::new(); self.points.len()];
        for &edge in edges.keys() {
            edges_of[edge.0].push(edge);
            edges_of[edge.1].push(edge);
        }
        Neighbours { edges, faces_of, edges_of }
    }

    /// Where the vertices of quadrilaterals are in the end. No step changes that, as is asserted, and
    /// vertices and what they are computed from come together.
    pub(crate) fn limits(&self) -> Vec<DVec3> {
        let Neighbours { edges, faces_of, edges_of } = self.neighbours();
        let limit = |(vertex, &point): (usize, &DVec3)| {
            let others = |edge: &(usize, usize)| self.points[edge.0 + edge.1 - vertex];
            let border: Vec<_> =
                edges_of[vertex].iter().filter(|e| edges[e].len() == 1).map(others).collect();
            if border.len() == 2 {
                let only_face = faces_of[vertex].len() == 1;
                return if only_face { point } else { (border[0] + 4.0 * point + border[1]) / 6.0 };
            }
            let n = faces_of[vertex].len() as f64;
            if n == 0.0 {
                return point;
            }
            let opposite = |&face: &usize| {
                let face = &self.faces[face];
                let at = face.iter().position(|&i| i == vertex).unwrap();
                self.points[face[(at + 2) % 4]]
            };
            let edges: DVec3 = edges_of[vertex].iter().map(others).sum();
            let faces: DVec3 = faces_of[vertex].iter().map(opposite).sum();
            (n * n * point + 4.0 * edges + faces) / (n * (n + 5.0))
        };
        self.points.iter().enumerate().map(limit).collect()
    }
}

struct Neighbours {
    /// The faces at each edge, the edge by its vertices, the smaller first.
    edges: BTreeMap<(usize, usize), Vec<usize>>,
    faces_of: Vec<Vec<usize>>,
    edges_of: Vec<Vec<(usize, usize)>>,
}

/// Boxes over the faces of the last step, four of a face of the step before, and so on.
pub(crate) struct Tessellation {
    mesh: Polygons,
    /// Boxes of the last level first; each has four of the level before.
    levels: Vec<Vec<(DVec3, DVec3)>>,
    /// How far from the limit surface the triangles are.
    pub(crate) deviation: f64,
}

impl Tessellation {
    pub(crate) fn new(cage: &Polygons, steps: usize) -> Self {
        let mut mesh = cage.clone();
        for _ in 0..steps {
            mesh = mesh.subdivided();
        }
        // The middles of the faces show how much triangles between limit points cut off.
        let (limits, next) = (mesh.limits(), mesh.subdivided());
        let next_limits = next.limits();
        let mut cut = 0.0f64;
        for (number, face) in mesh.faces.iter().enumerate() {
            let middle = 0.25 * face.iter().map(|&i| limits[i]).sum::<DVec3>();
            cut = cut.max(middle.distance(next_limits[limits.len() + number]));
        }
        for (a, b) in limits.iter().zip(&next_limits) {
            assert!(a.distance(*b) < 1e-12, "no limit: {a} {b}");
        }
        let deviation = 1.5 * cut + 1e-7;
        mesh.points = limits;
        let boxes = |points: &mut dyn Iterator<Item = DVec3>| {
            points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)))
        };
        let mut levels = vec![
            mesh.faces
                .iter()
                .map(|f| boxes(&mut f.iter().map(|&i| mesh.points[i])))
                .collect::<Vec<_>>(),
        ];
        for _ in 1..steps {
            let below = &levels[levels.len() - 1];
            let above =
                below.chunks(4).map(|c| boxes(&mut c.iter().flat_map(|b| [b.0, b.1]))).collect();
            levels.push(above);
        }
        Self { mesh, levels, deviation }
    }

    /// Calls `visit` with the triangles of all boxes that `enter` wants.
    fn visit(
        &self,
        enter: &mut dyn FnMut(DVec3, DVec3) -> bool,
        visit: &mut dyn FnMut([DVec3; 3]),
    ) {
        let top = self.levels.len() - 1;
        let mut stack: Vec<(usize, usize)> =
            (0..self.levels[top].len()).map(|i| (top, i)).collect();
        while let Some((level, i)) = stack.pop() {
            let (lower, upper) = self.levels[level][i];
            if !enter(lower, upper) {
                continue;
            }
            if level > 0 {
                stack.extend((4 * i..4 * i + 4).map(|child| (level - 1, child)));
                continue;
            }
            let p: Vec<DVec3> = self.mesh.faces[i].iter().map(|&k| self.mesh.points[k]).collect();
            visit([p[0], p[1], p[2]]);
            visit([p[0], p[2], p[3]]);
        }
    }

    /// All places where a line meets the triangles.
    pub(crate) fn line(&self, o: DVec3, d: DVec3) -> Vec<Expected> {
        let mut found: Vec<Expected> = Vec::new();
        let mut enter = |lower: DVec3, upper: DVec3| {
            let (a, b) = ((lower - o) / d, (upper - o) / d);
            let near = (0..3).map(|i| a[i].min(b[i])).fold(f64::NEG_INFINITY, f64::max);
            let far = (0..3).map(|i| a[i].max(b[i])).fold(f64::INFINITY, f64::min);
            near <= far + 1e-12 * far.abs()
        };
        self.visit(&mut enter, &mut |[a, b, c]| {
            let normal = (b - a).cross(c - a);
            let t = normal.dot(a - o) / normal.dot(d);
            let p = o + t * d;
            let inside = |a: DVec3, b: DVec3| (b - a).cross(p - a).dot(normal) >= 0.0;
            if t.is_finite() && inside(a, b) && inside(b, c) && inside(c, a) {
                found.push(Expected { t, normal: normal.normalize(), soft: false });
            }
        });
        found.sort_by(|a, b| a.t.total_cmp(&b.t));
        found.dedup_by(|a, b| (a.t - b.t).abs() * d.length() < 1e-9);
        found
    }

    /// The distance of a point from the triangles.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        let best = std::cell::Cell::new(f64::INFINITY);
        let mut enter = |lower: DVec3, upper: DVec3| p.distance(p.clamp(lower, upper)) < best.get();
        self.visit(&mut enter, &mut |triangle| {
            best.set(best.get().min(distance_to_triangle(p, triangle)));
        });
        best.get()
    }
}

fn distance_to_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let inside = |a: DVec3, b: DVec3| (b - a).cross(p - a).dot(normal) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        return (p - a).dot(normal.normalize()).abs();
    }
    let to_edge = |a: DVec3, b: DVec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a + t * (b - a))
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}
