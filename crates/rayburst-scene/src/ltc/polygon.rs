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

use super::axial::Profile;

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

/// An edge as an arc: the normal of its plane and its length in radians.
struct Arc {
    normal: Vec3,
    angle: f32,
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
        }
        // Only directions count; squares of distances shall neither overflow nor vanish.
        for corner in &mut polygon.corners[..polygon.len] {
            *corner /= far;
        }
        polygon
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
    #[inline]
    pub(super) fn map(&self, f: impl Fn(Vec3) -> Vec3) -> Self {
        let mut mapped = Self { len: self.len, corners: [Vec3::ZERO; CAPACITY] };
        for (to, &from) in mapped.corners.iter_mut().zip(self.corners()) {
            *to = f(from);
        }
        mapped
    }

    /// What lies on the side of the plane through the origin to which `normal` points.
    pub(super) fn clip(&self, normal: Vec3) -> Self {
        if self.corners().iter().all(|corner| corner.dot(normal) > 0.0) {
            return *self;
        }
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

    /// The edge that ends in each corner, and the corner.
    #[inline]
    fn arcs(&self) -> impl Iterator<Item = (Arc, Vec3)> {
        let corners = self.corners();
        let mut from = corners.last().copied().unwrap_or_default();
        corners.iter().map(move |&to| (Arc::new(std::mem::replace(&mut from, to), to), to))
    }

    /// ∫cos θ dω / π over a polygon that has been clipped to z > 0: which share of a cosine lobe it
    /// covers.
    pub(super) fn cosine_share(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let sum: f32 = self.arcs().map(|(arc, _)| arc.angle * arc.normal.z).sum();
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
        let mut moments = [0.0; 8];
        let mut vector = Vec3::ZERO;
        if self.is_empty() {
            return ([0.0; N], 0.0);
        }
        let mut from = self.corners[self.len - 1].normalize_or_zero();
        for (arc, corner) in self.arcs() {
            let to = corner.normalize_or_zero();
            vector += arc.angle * arc.normal;
            for (sum, along) in moments.iter_mut().zip(arc.integrals_of_powers(from, to)) {
                *sum += arc.normal.z * along;
            }
            from = to;
        }
        let mut integrals = [0.0f32; N];
        for (integral, profile) in integrals.iter_mut().zip(profiles) {
            *integral = moments.iter().zip(profile).map(|(f, k)| f * k).sum::<f32>().abs();
        }
        (integrals, 0.5 * vector.length())
    }
}

/// The angle of a positive sine and a cosine that share a factor. Abramowitz, Stegun: "Handbook of
/// Mathematical Functions", 1964, 4.4.49: an arc tangent to 2·10⁻⁸.
#[inline]
fn angle(sine: f32, cosine: f32) -> f32 {
    let flat = cosine.abs();
    let t = sine.min(flat) / sine.max(flat);
    let t2 = t * t;
    // Estrin's scheme: halves of the sum do not wait for each other.
    let t4 = t2 * t2;
    let low = (1.0 - 0.333_331_452_8 * t2) + (0.199_935_508_5 - 0.142_088_994_4 * t2) * t4;
    let high =
        (0.106_562_639_3 - 0.075_289_64 * t2) + (0.042_909_613_8 - 0.016_165_736_7 * t2) * t4;
    let t8 = t4 * t4;
    let arc = t * (low + (high + 0.002_866_225_7 * t8) * t8);
    let arc = if sine > flat { FRAC_PI_2 - arc } else { arc };
    if cosine < 0.0 { PI - arc } else { arc }
}

impl Arc {
    #[inline]
    fn new(from: Vec3, to: Vec3) -> Self {
        // Of the difference, so that small polygons keep their digits.
        let cross = from.cross(to - from);
        let sine = cross.length();
        if sine > 0.0 {
            Self { normal: cross / sine, angle: angle(sine, from.dot(to)) }
        } else {
            Self { normal: Vec3::Z, angle: 0.0 }
        }
    }

    /// ∫zᵐ ds along the arc for m from 0 to 7, between its ends as unit vectors.
    #[inline]
    fn integrals_of_powers(&self, a: Vec3, b: Vec3) -> [f32; 8] {
        if self.angle == 0.0 {
            return [0.0; 8];
        }
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
        f
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
