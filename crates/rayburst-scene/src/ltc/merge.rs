//! Triangles of one plane put together to convex polygons.
//!
//! Neighbours are joined along their longest shared edges first, as long as what they become is flat,
//! convex and of few corners: a quad's two triangles find each other before anything else does.

use std::collections::HashMap;

use glam::Vec3;

use super::polygon::MAX_CORNERS;

/// Sine of the angle up to which an edge counts as going straight on.
const STRAIGHT: f32 = 1e-4;
/// How far points of a plane may be from it, as a share of the polygon's size.
const FLAT: f32 = 1e-5;
/// The same as a share of coordinates, which are rounded.
const ROUNDING: f32 = 5e-7;

/// A convex polygon and the triangles that it is made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Merged {
    /// Corners, counter-clockwise about the front's normal; none where edges go straight on.
    pub(super) corners: Vec<Vec3>,
    /// Indices of triangles, ascending.
    pub(super) triangles: Vec<u32>,
}

/// A polygon while it grows: all points on its outline, also those where it goes straight on, because
/// a neighbour may have a corner there.
#[derive(Clone, Debug)]
struct Patch {
    outline: Vec<u32>,
    normal: Vec3,
    area: f32,
    triangles: Vec<u32>,
}

/// Puts triangles together, whose corners go counter-clockwise about the front's normal. Triangles
/// without area are left out.
pub(super) fn merge(triangles: &[[Vec3; 3]]) -> Vec<Merged> {
    let mut mesh = Mesh::new(triangles);
    while mesh.join_longest_first() {}
    let merged = |patch: Patch| Merged {
        corners: mesh.corners(&patch).into_iter().map(|c| mesh.points[c as usize]).collect(),
        triangles: patch.triangles,
    };
    let patches = mesh.patches.clone();
    patches.into_iter().flatten().map(merged).collect()
}

struct Mesh {
    points: Vec<Vec3>,
    /// `None` once it has become part of another.
    patches: Vec<Option<Patch>>,
    /// Directed edges of outlines to their patches.
    edges: HashMap<(u32, u32), u32>,
}

impl Mesh {
    fn new(triangles: &[[Vec3; 3]]) -> Self {
        let mut mesh = Self { points: Vec::new(), patches: Vec::new(), edges: HashMap::new() };
        let mut places: HashMap<[u32; 3], u32> = HashMap::new();
        for (index, corners) in (0..).zip(triangles) {
            let vector = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let area = vector.length();
            let Some(normal) = vector.try_normalize().filter(|_| area.is_finite()) else {
                continue;
            };
            let outline = corners.map(|corner| {
                // +0 and −0 are one place.
                let bits = (corner + Vec3::ZERO).to_array().map(f32::to_bits);
                *places.entry(bits).or_insert_with(|| {
                    mesh.points.push(corner);
                    mesh.points.len() as u32 - 1
                })
            });
            let patch = Patch { outline: outline.to_vec(), normal, area, triangles: vec![index] };
            mesh.enter(patch);
        }
        mesh
    }

    fn enter(&mut self, patch: Patch) {
        let id = self.patches.len() as u32;
        for edge in edges(&patch.outline) {
            // Of triangles on top of each other the first has the edge.
            self.edges.entry(edge).or_insert(id);
        }
        self.patches.push(Some(patch));
    }

    fn remove(&mut self, id: u32) -> Option<Patch> {
        let patch = self.patches[id as usize].take()?;
        for edge in edges(&patch.outline) {
            if self.edges.get(&edge) == Some(&id) {
                self.edges.remove(&edge);
            }
        }
        Some(patch)
    }

    /// Goes over all shared edges once; whether any patches were joined.
    fn join_longest_first(&mut self) -> bool {
        let shared = self.edges.keys().filter(|(a, b)| a < b && self.edges.contains_key(&(*b, *a)));
        let length = |&(a, b): &(u32, u32)| {
            self.points[a as usize].distance_squared(self.points[b as usize])
        };
        let mut shared: Vec<(u32, u32)> = shared.copied().collect();
        shared.sort_by(|x, y| length(y).total_cmp(&length(x)).then(x.cmp(y)));
        let mut any = false;
        for (a, b) in shared {
            let (Some(&p), Some(&q)) = (self.edges.get(&(a, b)), self.edges.get(&(b, a))) else {
                continue;
            };
            if p == q {
                continue;
            }
            let (Some(first), Some(second)) =
                (&self.patches[p as usize], &self.patches[q as usize])
            else {
                continue;
            };
            if let Some(joined) = self.joined(first, second, (a, b)) {
                self.remove(p);
                self.remove(q);
                self.enter(joined);
                any = true;
            }
        }
        any
    }

    /// Two patches as one, if that is flat and convex. `p` has the edge from `a` to `b`.
    fn joined(&self, p: &Patch, q: &Patch, (a, b): (u32, u32)) -> Option<Patch> {
        let size = (p.area + q.area).sqrt();
        let base = self.points[a as usize];
        let far_off = |&i: &u32| {
            let point = self.points[i as usize];
            let slack = FLAT * size + ROUNDING * point.abs().max_element();
            (point - base).dot(p.normal).abs() > slack
        };
        if p.normal.dot(q.normal) < 1.0 - FLAT || q.outline.iter().any(far_off) {
            return None;
        }
        // From b around p to a, then around q back to b.
        let mut outline = rotated(&p.outline, b)?;
        outline.extend(&rotated(&q.outline, a)?[1..q.outline.len() - 1]);
        remove_spikes(&mut outline);
        let mut sorted = outline.clone();
        sorted.sort_unstable();
        if outline.len() < 3 || sorted.windows(2).any(|w| w[0] == w[1]) {
            return None;
        }
        let vector = self.area_vector(&outline);
        let mut triangles = [p.triangles.as_slice(), &q.triangles].concat();
        triangles.sort_unstable();
        let area = p.area + q.area;
        let patch = Patch { outline, normal: vector.try_normalize()?, area, triangles };
        let kept_its_area = (vector.length() - area).abs() <= 1e-3 * area;
        (kept_its_area && self.is_convex(&patch) && self.corners(&patch).len() <= MAX_CORNERS)
            .then_some(patch)
    }

    fn area_vector(&self, outline: &[u32]) -> Vec3 {
        let at = |i: u32| self.points[i as usize];
        let base = at(outline[0]);
        outline.windows(2).map(|w| 0.5 * (at(w[0]) - base).cross(at(w[1]) - base)).sum()
    }

    /// For each point of the outline the sine of the turn there, positive to the left.
    fn turns(&self, patch: &Patch) -> impl Iterator<Item = (u32, f32)> {
        let n = patch.outline.len();
        (0..n).map(move |i| {
            let at = |i: usize| self.points[patch.outline[i % n] as usize];
            let come = (at(i) - at(i + n - 1)).normalize_or_zero();
            let go = (at(i + 1) - at(i)).normalize_or_zero();
            (patch.outline[i], come.cross(go).dot(patch.normal))
        })
    }

    fn is_convex(&self, patch: &Patch) -> bool {
        self.turns(patch).all(|(_, sine)| sine > -STRAIGHT)
    }

    /// The points where the outline does not go straight on.
    fn corners(&self, patch: &Patch) -> Vec<u32> {
        self.turns(patch).filter(|(_, sine)| *sine > STRAIGHT).map(|(point, _)| point).collect()
    }
}

fn edges(outline: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    let next = outline.iter().cycle().skip(1);
    outline.iter().copied().zip(next.copied())
}

/// The outline from one of its points on.
fn rotated(outline: &[u32], from: u32) -> Option<Vec<u32>> {
    let start = outline.iter().position(|&p| p == from)?;
    Some([&outline[start..], &outline[..start]].concat())
}

/// Takes out where an outline goes to a point and back: edges that both patches had.
fn remove_spikes(outline: &mut Vec<u32>) {
    while outline.len() >= 3 {
        let n = outline.len();
        let Some(i) = (0..n).find(|&i| outline[i] == outline[(i + 2) % n]) else { return };
        let mut gone = [(i + 1) % n, (i + 2) % n];
        gone.sort_unstable();
        outline.remove(gone[1]);
        outline.remove(gone[0]);
    }
}

#[cfg(test)]
mod tests {
    use rayburst_math::{Frame, hash::Rng, warp};

    use super::*;

    fn quad(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> [[Vec3; 3]; 2] {
        [[a, b, c], [a, c, d]]
    }

    fn area(corners: &[Vec3]) -> f32 {
        let fan = corners.windows(2).map(|w| (w[0] - corners[0]).cross(w[1] - corners[0]));
        0.5 * fan.sum::<Vec3>().length()
    }

    #[test]
    fn a_grid_of_quads_is_one_rectangle_however_it_lies() {
        let mut rng = Rng::new(7);
        for _ in 0..50 {
            let frame = Frame::from_normal(warp::uniform_sphere(rng.vec2()));
            let place = 20.0 * (rng.vec3() - Vec3::splat(0.5));
            let (columns, rows) = (1 + rng.below(5), 1 + rng.below(5));
            let at = |x: u32, y: u32| {
                place + frame.to_world(Vec3::new(0.3 * x as f32, 0.5 * y as f32, 0.0))
            };
            let mut triangles = Vec::new();
            for y in 0..rows {
                for x in 0..columns {
                    triangles.extend(quad(at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)));
                }
            }
            let merged = merge(&triangles);
            assert_eq!(merged.len(), 1, "{columns} {rows}");
            assert_eq!(merged[0].corners.len(), 4);
            assert_eq!(merged[0].triangles.len(), triangles.len());
            let expected = 0.15 * (columns * rows) as f32;
            assert!((area(&merged[0].corners) - expected).abs() < 1e-3 * expected);
            let facing = (1..3)
                .map(|i| {
                    let c = &merged[0].corners;
                    (c[i] - c[0]).cross(c[i + 1] - c[0])
                })
                .sum::<Vec3>();
            assert!(facing.dot(frame.normal) > 0.0);
        }
    }

    #[test]
    fn cubes_become_six_squares_and_discs_stay_within_eight_corners() {
        let c = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
        let sides =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let cube: Vec<_> =
            sides.iter().flat_map(|s| quad(c(s[0]), c(s[1]), c(s[2]), c(s[3]))).collect();
        let merged = merge(&cube);
        assert_eq!(merged.len(), 6);
        assert!(merged.iter().all(|m| m.corners.len() == 4 && m.triangles.len() == 2));

        let rim = |i: u32| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / 20.0).sin_cos();
            Vec3::new(cos, sin, 0.0)
        };
        let disc: Vec<_> = (0..20).map(|i| [Vec3::ZERO, rim(i), rim(i + 1)]).collect();
        let merged = merge(&disc);
        assert!(merged.len() > 1 && merged.iter().all(|m| m.corners.len() <= MAX_CORNERS));
        let whole: f32 = merged.iter().map(|m| area(&m.corners)).sum();
        let expected = 10.0 * (0.1 * std::f32::consts::PI).sin();
        assert!((whole - expected).abs() < 1e-3, "{whole} {expected}");
        let mut all: Vec<u32> = merged.iter().flat_map(|m| m.triangles.clone()).collect();
        all.sort_unstable();
        assert!(all.iter().copied().eq(0..20));
    }

    #[test]
    fn what_is_not_flat_not_convex_or_nothing_is_not_merged() {
        let (o, x, y, z) = (Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z);
        // Folded along the shared edge.
        assert_eq!(merge(&[[o, x, y], [x, x + y + 0.05 * z, y]]).len(), 2);
        // A dart.
        assert_eq!(merge(&[[o, x, y], [o, y, -x - 2.0 * y]]).len(), 2);
        // Back to back.
        assert_eq!(merge(&[[o, x, y], [o, y, x]]).len(), 2);
        // Twice the same.
        assert_eq!(merge(&[[o, x, y], [o, x, y]]).len(), 2);
        assert!(merge(&[[o, x, x], [o, x * f32::NAN, y], [o, o, o]]).is_empty());
        assert!(merge(&[]).is_empty());
    }
}
