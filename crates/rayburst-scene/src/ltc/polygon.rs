//! Convex polygons as seen from the origin, and integrals over the directions that they cover.
//!
//! Everything is an integral along the polygon's edges, which are arcs of great circles on the unit
//! sphere. A function h(cos θ) about the z axis has ∫h dω = Σ n_z ∫ K(cos θ) ds over the edges, with
//! the unit normal n of the edge's plane and K(c) = ∫_c^1 h dc′ / (1 − c²): Stokes' theorem, in
//! spherical coordinates ∮(∫_c^1 h dc′) dφ. For h = cos θ, K is ½ and this is Lambert's formula
//! ("Photometria", 1760); for polynomials K the inner integrals are those of Arvo ("Applications of
//! Irradiance Tensors to the Simulation of Non-Lambertian Phenomena", SIGGRAPH 1995). Clipping:
//! Sutherland, Hodgman: "Reentrant Polygon Clipping", Communications of the ACM 1974.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI};

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

/// An edge as an arc: the normal of its plane, its length in radians, its ends.
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
                angle: angle(sine, a.dot(b)),
                ends: [a, b],
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

    /// ∫cos θ dω over a polygon that has been clipped to z > 0.
    pub(super) fn cosine_integral(&self) -> f32 {
        PI * self.cosine_share()
    }

    /// ∫h dω for functions h about the z axis given by their K, over a polygon that has been clipped
    /// to z > 0; and the length of ∫ω dω, which for small polygons is their solid angle.
    pub(super) fn axial_integrals<const N: usize>(
        &self,
        profiles: &[Profile; N],
    ) -> ([f32; N], f32) {
        let mut sums = [0.0; N];
        let mut vector = Vec3::ZERO;
        if self.is_empty() {
            return (sums, 0.0);
        }
        for arc in self.arcs() {
            vector += arc.angle * arc.normal;
            let powers = arc.integrals_of_powers();
            for (sum, profile) in sums.iter_mut().zip(profiles) {
                let along: f32 = powers.iter().zip(profile).map(|(f, k)| f * k).sum();
                *sum += arc.normal.z * along;
            }
        }
        (sums.map(f32::abs), 0.5 * vector.length())
    }
}

/// The angle of a positive sine and a cosine that share a factor. Abramowitz, Stegun: "Handbook of
/// Mathematical Functions", 1964, 4.4.49: an arc tangent to 2·10⁻⁸.
#[inline]
fn angle(sine: f32, cosine: f32) -> f32 {
    let flat = cosine.abs();
    let t = sine.min(flat) / sine.max(flat);
    let t2 = t * t;
    let series = [
        0.002_866_225_7,
        -0.016_165_736_7,
        0.042_909_613_8,
        -0.075_289_64,
        0.106_562_639_3,
        -0.142_088_994_4,
        0.199_935_508_5,
        -0.333_331_452_8,
        1.0,
    ];
    let arc = t * series.into_iter().fold(0.0, |sum, c| sum * t2 + c);
    let arc = if sine > flat { FRAC_PI_2 - arc } else { arc };
    if cosine < 0.0 { PI - arc } else { arc }
}

impl Arc {
    /// ∫zᵐ ds along the arc for each m of [`POWERS`].
    fn integrals_of_powers(&self) -> [f32; POWERS.len()] {
        let [a, b] = self.ends.map(Vec3::normalize_or_zero);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ltc::axial::COSINE;

    #[test]
    fn angles_are_those_of_the_library() {
        for i in 0..=20_000 {
            let exact = f64::from(i) / 20_000.0 * std::f64::consts::PI;
            let (sine, cosine) = exact.sin_cos();
            let found = angle(3.0 * sine as f32, 3.0 * cosine as f32);
            assert!((f64::from(found) - exact).abs() < 4e-7, "{exact} {found}");
        }
        for tiny in [1e-20f32, 1e-6, 1e-3] {
            assert!((angle(tiny, 1.0) / tiny.atan() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn an_octant_has_its_form_factor() {
        // A corner of a room: ∫cos θ dω over a quarter of the hemisphere is π/4.
        let octant = SeenPolygon::new([Vec3::X, Vec3::Y, Vec3::Z].into_iter());
        assert!((octant.cosine_integral() - 0.25 * PI).abs() < 1e-6);
        let ([cosine], vector) = octant.axial_integrals(&[COSINE]);
        assert!((cosine - 0.25 * PI).abs() < 1e-6);
        assert!((vector - 0.25 * PI * 3f32.sqrt()).abs() < 1e-6);
        // Half of it.
        let half = octant.clip((Vec3::X - Vec3::Y).normalize());
        assert!((half.cosine_integral() - 0.125 * PI).abs() < 1e-6);
        assert!(octant.clip(-Vec3::Z).is_empty());
        assert_eq!(octant.clip(Vec3::Z).cosine_integral(), octant.cosine_integral());
    }
}
