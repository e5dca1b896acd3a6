//! Polygons to triangles.
//!
//! Convex polygons become a fan around their first vertex; concave ones are cut by ear clipping
//! (Meisters, "Polygons Have Ears", 1975) in the plane of Newell's normal (Sutherland, Sproull and
//! Schumacker, "A Characterization of Ten Hidden-Surface Algorithms", 1974, attributed to Newell),
//! along whose strongest axis the polygon is projected. A polygon of n vertices always gives n − 2
//! triangles, in the polygon's winding. Ear clipping takes cubic time at worst; where all tests of a
//! file exceed a budget that honest polygons do not reach, the rest is fanned, so that a hostile
//! file cannot stall the reader.

use glam::{DVec2, DVec3, Vec3};

/// Tests of a point against an ear that all polygons together may spend: some to begin with, and
/// some for each vertex. Tens of thousands of jagged polygons stay below.
const FIRST_TESTS: u64 = 1 << 27;
const TESTS_PER_VERTEX: u64 = 256;

/// Cuts the polygons of one file; keeps its scratch space between them.
#[derive(Debug)]
pub(crate) struct Triangulator {
    budget: u64,
    flat: Vec<DVec2>,
    previous: Vec<u32>,
    next: Vec<u32>,
}

impl Triangulator {
    /// For one file.
    pub(crate) fn new() -> Self {
        Self { budget: FIRST_TESTS, flat: vec![], previous: vec![], next: vec![] }
    }

    /// Calls `emit` with three positions in the polygon for each triangle.
    pub(crate) fn triangulate(&mut self, polygon: &[Vec3], mut emit: impl FnMut([u32; 3])) {
        match polygon {
            [] | [_] | [_, _] => {}
            [_, _, _] => emit([0, 1, 2]),
            &[a, b, c, d] => {
                if is_better_split_by_second_diagonal(a, b, c, d) {
                    emit([0, 1, 3]);
                    emit([1, 2, 3]);
                } else {
                    emit([0, 1, 2]);
                    emit([0, 2, 3]);
                }
            }
            _ => {
                if self.project(polygon) && !self.is_convex() {
                    self.clip_ears(emit);
                } else {
                    (1..polygon.len() as u32 - 1).for_each(|i| emit([0, i, i + 1]));
                }
            }
        }
    }

    /// Projects counter-clockwise; `false` if the polygon has no area.
    fn project(&mut self, polygon: &[Vec3]) -> bool {
        let origin = polygon[0].as_dvec3();
        let at = |i: usize| polygon[i].as_dvec3() - origin;
        let mut normal = DVec3::ZERO;
        for i in 0..polygon.len() {
            normal += at(i).cross(at((i + 1) % polygon.len()));
        }
        if !normal.is_finite() || normal == DVec3::ZERO {
            return false;
        }
        let size = normal.abs();
        let (x, y) = if size.x >= size.y && size.x >= size.z {
            (if normal.x > 0.0 { DVec3::Y } else { -DVec3::Y }, DVec3::Z)
        } else if size.y >= size.z {
            (if normal.y > 0.0 { DVec3::Z } else { -DVec3::Z }, DVec3::X)
        } else {
            (if normal.z > 0.0 { DVec3::X } else { -DVec3::X }, DVec3::Y)
        };
        self.flat.clear();
        self.flat.extend((0..polygon.len()).map(|i| DVec2::new(at(i).dot(x), at(i).dot(y))));
        true
    }

    fn is_convex(&self) -> bool {
        let n = self.flat.len();
        // Turns alone would take a star polygon that winds twice for convex: the fan must turn the
        // same way throughout as well.
        (0..n).all(|i| turn(self.flat[i], self.flat[(i + 1) % n], self.flat[(i + 2) % n]) >= 0.0)
            && (1..n - 1).all(|i| turn(self.flat[0], self.flat[i], self.flat[i + 1]) >= 0.0)
    }

    fn clip_ears(&mut self, mut emit: impl FnMut([u32; 3])) {
        let n = self.flat.len() as u32;
        self.previous.clear();
        self.previous.extend((0..n).map(|i| if i == 0 { n - 1 } else { i - 1 }));
        self.next.clear();
        self.next.extend((0..n).map(|i| if i == n - 1 { 0 } else { i + 1 }));

        self.budget += TESTS_PER_VERTEX * u64::from(n);
        let mut left = n;
        let mut current = 0_u32;
        let mut since_last_ear = 0;
        while left > 3 {
            let (before, after) = (self.previous[current as usize], self.next[current as usize]);
            // After a full turn without an ear (a polygon that crosses itself), any corner is cut.
            let forced = since_last_ear >= left;
            if forced || self.is_ear(before, current, after) {
                emit([before, current, after]);
                self.next[before as usize] = after;
                self.previous[after as usize] = before;
                left -= 1;
                since_last_ear = 0;
                // Going on two vertices further keeps triangles from piling up at one vertex.
                current = self.next[after as usize];
            } else {
                since_last_ear += 1;
                current = after;
            }
            if self.budget == 0 {
                break;
            }
        }
        // What remains is a triangle, or after a spent budget a polygon to be fanned.
        let first = current;
        let mut second = self.next[first as usize];
        for _ in 0..left - 2 {
            let third = self.next[second as usize];
            emit([first, second, third]);
            second = third;
        }
    }

    fn is_ear(&mut self, before: u32, current: u32, after: u32) -> bool {
        let [a, b, c] = [before, current, after].map(|i| self.flat[i as usize]);
        if turn(a, b, c) < 0.0 {
            self.budget = self.budget.saturating_sub(1);
            return false;
        }
        let (lower, upper) = (a.min(b).min(c), a.max(b).max(c));
        let mut other = self.next[after as usize];
        while other != before {
            if self.budget == 0 {
                return false;
            }
            self.budget -= 1;
            let p = self.flat[other as usize];
            let is_near = p.x >= lower.x && p.x <= upper.x && p.y >= lower.y && p.y <= upper.y;
            // Vertices that coincide with a corner are seams of a hole's bridge, not obstacles.
            if is_near
                && p != a
                && p != b
                && p != c
                && turn(a, b, p) >= 0.0
                && turn(b, c, p) >= 0.0
                && turn(c, a, p) >= 0.0
            {
                return false;
            }
            other = self.next[other as usize];
        }
        true
    }
}

/// Twice the signed area of a triangle.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether a quadrilateral is concave at its second or fourth corner, so that only the diagonal
/// between those lies inside.
fn is_better_split_by_second_diagonal(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> bool {
    let agree = |p: Vec3, q: Vec3, r: Vec3, s: Vec3| {
        let [p, q, r, s] = [p, q, r, s].map(|v| v.as_dvec3());
        (q - p).cross(r - p).dot((r - p).cross(s - p)) >= 0.0
    };
    !agree(a, b, c, d) && agree(b, c, d, a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(polygon: &[Vec3]) -> Vec<[u32; 3]> {
        let mut triangles = Vec::new();
        Triangulator::new().triangulate(polygon, |t| triangles.push(t));
        triangles
    }

    fn area_of(polygon: &[Vec3], triangles: &[[u32; 3]]) -> (f64, f64) {
        let at = |i: u32| polygon[i as usize].as_dvec3();
        let mut normal = DVec3::ZERO;
        for i in 0..polygon.len() {
            normal += at(i as u32).cross(at(((i + 1) % polygon.len()) as u32));
        }
        let normal = normal.normalize();
        let areas = triangles
            .iter()
            .map(|t| (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0])).dot(normal) * 0.5);
        areas.fold((0.0, 0.0), |(sum, absolute), a| (sum + a, absolute + a.abs()))
    }

    /// Covers the polygon once: the sum of areas equals the sum of absolute areas.
    fn assert_covers(polygon: &[Vec3]) {
        let triangles = cut(polygon);
        assert_eq!(triangles.len(), polygon.len() - 2);
        let (sum, absolute) = area_of(polygon, &triangles);
        assert!((sum - absolute).abs() <= 1e-6 * absolute, "{sum} {absolute} {triangles:?}");
    }

    #[test]
    fn a_convex_polygon_becomes_a_fan() {
        let hexagon: Vec<Vec3> = (0..6)
            .map(|i| (i as f32 * std::f32::consts::TAU / 6.0).sin_cos())
            .map(|(y, x)| Vec3::new(x, y, 1.0))
            .collect();
        assert_eq!(cut(&hexagon), [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]);
    }

    #[test]
    fn concave_quadrilaterals_are_split_by_the_inner_diagonal() {
        let dart =
            [(0.0, 0.0), (2.0, -1.0), (0.5, 0.0), (2.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 3.0));
        for turn in 0..4 {
            let mut rotated = dart;
            rotated.rotate_left(turn);
            assert_covers(&rotated);
        }
    }

    #[test]
    fn concave_polygons_are_covered_once_in_every_plane_and_winding() {
        // A comb: every other vertex is reflex.
        let mut comb: Vec<(f32, f32)> = Vec::new();
        for i in 0..20 {
            comb.push((i as f32, if i % 2 == 0 { 0.0 } else { 5.0 }));
        }
        comb.extend([(19.0, 6.0), (0.0, 6.0)]);
        // The letter L and a spiral.
        let letter = vec![(0., 0.), (3., 0.), (3., 1.), (1., 1.), (1., 4.), (0., 4.)];
        let mut spiral = Vec::new();
        for i in 0..60 {
            let angle = i as f32 * 0.3;
            spiral.push(((1.0 + angle) * angle.cos(), (1.0 + angle) * angle.sin()));
        }
        for i in (0..60).rev() {
            let angle = i as f32 * 0.3;
            spiral.push(((0.5 + angle) * angle.cos(), (0.5 + angle) * angle.sin()));
        }
        for shape in [comb, letter, spiral] {
            for axes in [[Vec3::X, Vec3::Y], [Vec3::Y, Vec3::Z], [Vec3::Z, Vec3::X]] {
                let tilt = Vec3::new(0.1, 0.2, 0.3);
                let mut polygon: Vec<Vec3> = shape
                    .iter()
                    .map(|&(x, y)| (axes[0] + tilt) * x + (axes[1] - tilt) * y + Vec3::splat(100.0))
                    .collect();
                assert_covers(&polygon);
                polygon.reverse();
                assert_covers(&polygon);
            }
        }
    }

    #[test]
    fn degenerate_polygons_still_give_all_their_triangles() {
        assert_eq!(cut(&[Vec3::ZERO; 7]).len(), 5);
        assert_eq!(cut(&[Vec3::splat(f32::NAN); 6]).len(), 4);
        let line: Vec<Vec3> = (0..9).map(|i| Vec3::X * (i % 3) as f32).collect();
        assert_eq!(cut(&line).len(), 7);
        let bow_tie =
            [(0., 0.), (2., 2.), (2., 0.), (0., 2.), (1., 5.)].map(|(x, y)| Vec3::new(x, y, 0.0));
        assert_eq!(cut(&bow_tie).len(), 3);
        assert!(cut(&[Vec3::ZERO; 2]).is_empty());
    }

    #[test]
    fn a_huge_jagged_polygon_takes_bounded_time() {
        let n = 200_000;
        let jagged: Vec<Vec3> = (0..n)
            .map(|i| {
                let angle = i as f32 / n as f32 * std::f32::consts::TAU;
                let radius = if i % 2 == 0 { 1.0 } else { 0.3 };
                Vec3::new(angle.cos() * radius, angle.sin() * radius, 0.0)
            })
            .collect();
        assert_eq!(cut(&jagged).len(), n - 2);
    }
}
