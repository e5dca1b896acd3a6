//! Convex polygons as seen from the origin, and integrals over the directions that they cover.
//!
//! Everything is an integral along the polygon's edges, which are arcs of great circles on the unit
//! sphere. A function h(cos θ) about the z axis has ∫h dω = Σ n_z ∫ K(cos θ) ds over the edges, with
//! the unit normal n of the edge's plane and K(c) = ∫_c^1 h dc′ / (1 − c²): Stokes' theorem, in
//! spherical coordinates ∮(∫_c^1 h dc′) dφ. For h = cos θ, K is ½ and this is Lambert's formula
//! ("Photometria", 1760); for polynomials K the inner integrals are those of Arvo ("Applications of
//! Irradiance Tensors to the Simulation of Non-Lambertian Phenomena", SIGGRAPH 1995). Clipping:
//! Sutherland, Hodgman: "Reentrant Polygon Clipping", Communications of the ACM 1974.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::axial::{POWERS, Profile};

/// The most corners that a polygon light may have.
pub const MAX_CORNERS: usize = 8;
/// Each of three clips adds a corner at most, and rounding another.
const CAPACITY: usize = 12;

/// A convex polygon seen from the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeenPolygon {
    len: usize,
    corners: [Vec3; CAPACITY],
}

/// An edge as an arc: the normal of its plane, its length in radians, its ends as unit vectors.
struct Arc {
    normal: Vec3,
    angle: f32,
    ends: [Vec3; 2],
}

impl SeenPolygon {
    /// From corners in order, the first [`MAX_CORNERS`] of them. Empty with fewer than three, or where
    /// one is not finite.
    pub(super) fn new(corners: impl Iterator<Item = Vec3>) -> Self {
        let mut polygon = Self { len: 0, corners: [Vec3::ZERO; CAPACITY] };
        for corner in corners.take(MAX_CORNERS) {
            polygon.push(corner);
        }
        let far = polygon.corners().iter().fold(0.0f32, |far, c| far.max(c.abs().max_element()));
        let finite = polygon.corners().iter().all(|c| c.is_finite());
        if polygon.len < 3 || !finite || far == 0.0 {
            polygon.len = 0;
            return polygon;
        }
        // Only directions count; squares of distances shall neither overflow nor vanish.
        polygon.map(|c| c / far)
    }

    fn push(&mut self, corner: Vec3) {
        if let Some(place) = self.corners.get_mut(self.len) {
            *place = corner;
            self.len += 1;
        }
    }

    fn corners(&self) -> &[Vec3] {
        &self.corners[..self.len]
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len < 3
    }

    /// Each corner mapped linearly.
    pub(super) fn map(mut self, f: impl Fn(Vec3) -> Vec3) -> Self {
        for corner in &mut self.corners[..self.len] {
            *corner = f(*corner);
        }
        self
    }

    /// What lies on the side of the plane through the origin to which `normal` points.
    pub(super) fn clip(&self, normal: Vec3) -> Self {
        let mut kept = Self { len: 0, corners: [Vec3::ZERO; CAPACITY] };
        let Some(&last) = self.corners().last() else { return kept };
        let (mut from, mut height_from) = (last, last.dot(normal));
        for &to in self.corners() {
            let height_to = to.dot(normal);
            if (height_from > 0.0) != (height_to > 0.0) {
                kept.push(from + (to - from) * (height_from / (height_from - height_to)));
            }
            if height_to > 0.0 {
                kept.push(to);
            }
            (from, height_from) = (to, height_to);
        }
        kept
    }

    fn arcs(&self) -> impl Iterator<Item = Arc> {
        (0..self.len).filter_map(|i| {
            let (a, b) = (self.corners[i], self.corners[(i + 1) % self.len]);
            // Of the difference, so that small polygons keep their digits.
            let cross = a.cross(b - a);
            let sine = cross.length();
            (sine > 0.0).then(|| Arc {
                normal: cross / sine,
                angle: sine.atan2(a.dot(b)),
                ends: [a.normalize_or_zero(), b.normalize_or_zero()],
            })
        })
    }

    /// ∫cos θ dω / π over a polygon that has been clipped to z > 0: which share of a cosine lobe it
    /// covers.
    pub(super) fn cosine_share(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let sum: f32 = self.arcs().map(|arc| arc.angle * arc.normal.z).sum();
        (0.5 * FRAC_1_PI * sum.abs()).min(1.0)
    }

    /// ∫ω dω, the vector irradiance, up to its sign.
    pub(super) fn vector(&self) -> Vec3 {
        if self.is_empty() {
            return Vec3::ZERO;
        }
        0.5 * self.arcs().map(|arc| arc.angle * arc.normal).sum::<Vec3>()
    }

    /// ∫h dω for functions h about the z axis given by their K, over a polygon that has been clipped
    /// to z > 0.
    pub(super) fn axial_integrals<const N: usize>(&self, profiles: &[Profile; N]) -> [f32; N] {
        let mut sums = [0.0; N];
        if self.is_empty() {
            return sums;
        }
        for arc in self.arcs() {
            let powers = arc.integrals_of_powers();
            for (sum, profile) in sums.iter_mut().zip(profiles) {
                let along: f32 = powers.iter().zip(profile).map(|(f, k)| f * k).sum();
                *sum += arc.normal.z * along;
            }
        }
        sums.map(f32::abs)
    }
}

impl Arc {
    /// ∫zᵐ ds along the arc for each m of [`POWERS`].
    fn integrals_of_powers(&self) -> [f32; POWERS.len()] {
        let [a, b] = self.ends;
        let n = self.normal;
        // With r² + n_z² = 1, z = r cos ψ along the arc and z′ = −r sin ψ.
        let slope = |p: Vec3| n.x * p.y - n.y * p.x;
        let (slope_a, slope_b) = (slope(a), slope(b));
        let r2 = n.x * n.x + n.y * n.y;
        let mut f = [0.0f32; 8];
        f[0] = self.angle;
        f[1] = slope_a - slope_b;
        let (mut power_a, mut power_b) = (1.0, 1.0);
        for m in 2..f.len() {
            power_a *= a.z;
            power_b *= b.z;
            let ends = power_a * slope_a - power_b * slope_b;
            f[m] = (ends + (m - 1) as f32 * r2 * f[m - 2]) / m as f32;
        }
        POWERS.map(|m| f[m])
    }
}
