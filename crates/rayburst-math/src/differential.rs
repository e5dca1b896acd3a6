//! Ray differentials: how a ray changes from pixel to pixel, for texture filtering.
//!
//! Igehy: "Tracing Ray Differentials", SIGGRAPH 1999; chapter 26.6, Eq. 26.10. With P a ray's origin
//! and D its direction, a differential holds ∂P/∂x, ∂P/∂y, ∂D/∂x and ∂D/∂y for a step of one pixel to
//! the right and one down.

use glam::Vec3;

use crate::{Frame, Ray};

/// Derivatives of a ray by the position on the screen, per pixel: 12 numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct RayDifferential {
    /// Of the origin, one pixel to the right; world units.
    pub origin_dx: Vec3,
    /// Of the origin, one pixel down.
    pub origin_dy: Vec3,
    /// Of the direction, one pixel to the right.
    pub direction_dx: Vec3,
    /// Of the direction, one pixel down.
    pub direction_dy: Vec3,
}

/// Least cosine of incidence that footprints are stretched by.
const GRAZING: f32 = 1e-4;

/// `v` without its part along the plane's normal, moved along `direction` instead.
#[inline]
fn onto_plane(v: Vec3, direction: Vec3, normal: Vec3) -> Vec3 {
    let cosine = direction.dot(normal);
    let least = GRAZING * direction.length();
    let cosine = if cosine.abs() < least { least.copysign(cosine) } else { cosine };
    let moved = v - direction * (v.dot(normal) / cosine);
    if moved.is_finite() { moved } else { Vec3::ZERO }
}

impl RayDifferential {
    /// The differences between a ray and those of the pixels beside it, one to the right and one down:
    /// eye rays, or rays that leave the surfaces of a G-buffer.
    #[inline]
    pub fn between(ray: &Ray, right: &Ray, below: &Ray) -> Self {
        Self {
            origin_dx: right.origin - ray.origin,
            origin_dy: below.origin - ray.origin,
            direction_dx: right.direction - ray.direction,
            direction_dy: below.direction - ray.direction,
        }
    }

    /// Transfer to the plane with a normal that the ray meets at `t`: the origins' derivatives become
    /// those of the hit point, which lie in the plane. A plane that breaks numbers gives zeros.
    #[inline]
    #[must_use]
    pub fn transfer(&self, direction: Vec3, t: f32, normal: Vec3) -> Self {
        let at = |origin: Vec3, change: Vec3| onto_plane(origin + t * change, direction, normal);
        Self {
            origin_dx: at(self.origin_dx, self.direction_dx),
            origin_dy: at(self.origin_dy, self.direction_dy),
            ..*self
        }
    }

    /// Reflection at the point that the origins are at, see [`RayDifferential::transfer`]: the new
    /// direction is D − 2(D·N)N. `normal_change` is ∂N/∂x and ∂N/∂y.
    #[inline]
    #[must_use]
    pub fn reflect(&self, direction: Vec3, normal: Vec3, normal_change: [Vec3; 2]) -> Self {
        let cosine = direction.dot(normal);
        let turned = |change: Vec3, bend: Vec3| {
            let slope = change.dot(normal) + direction.dot(bend);
            change - 2.0 * (cosine * bend + slope * normal)
        };
        Self {
            direction_dx: turned(self.direction_dx, normal_change[0]),
            direction_dy: turned(self.direction_dy, normal_change[1]),
            ..*self
        }
    }

    /// Refraction at the point that the origins are at: the new direction is ηD − μN with
    /// μ = η(D·N) + cos θₜ, for a unit direction and a unit normal on the ray's side. `eta` is the
    /// index of refraction there over the one beyond. Total reflection leaves zeros.
    #[inline]
    #[must_use]
    pub fn refract(
        &self,
        direction: Vec3,
        normal: Vec3,
        normal_change: [Vec3; 2],
        eta: f32,
    ) -> Self {
        let cosine = direction.dot(normal);
        let transmitted = (1.0 - eta * eta * (1.0 - cosine * cosine)).max(0.0).sqrt();
        let mu = eta * cosine + transmitted;
        // dμ/d(D·N).
        let slope_mu = eta + eta * eta * cosine / transmitted.max(GRAZING);
        let turned = |change: Vec3, bend: Vec3| {
            let slope = change.dot(normal) + direction.dot(bend);
            eta * change - (mu * bend + slope_mu * slope * normal)
        };
        if transmitted == 0.0 {
            return Self { direction_dx: Vec3::ZERO, direction_dy: Vec3::ZERO, ..*self };
        }
        Self {
            direction_dx: turned(self.direction_dx, normal_change[0]),
            direction_dy: turned(self.direction_dy, normal_change[1]),
            ..*self
        }
    }

    /// For a ray that a rough surface scattered to `direction`, a unit vector: both directions'
    /// derivatives are `spread` longer, and never along one line.
    #[inline]
    #[must_use]
    pub fn widen(&self, direction: Vec3, spread: f32) -> Self {
        let along_x =
            if self.direction_dx == Vec3::ZERO { self.origin_dx } else { self.direction_dx };
        let frame = Frame::from_normal_tangent(direction, along_x);
        let side = if self.direction_dy == Vec3::ZERO { self.origin_dy } else { self.direction_dy };
        let along_y = frame.bitangent * 1.0f32.copysign(side.dot(frame.bitangent));
        Self {
            direction_dx: self.direction_dx + spread * frame.tangent,
            direction_dy: self.direction_dy + spread * along_y,
            ..*self
        }
    }

    /// For a ray that a surface scattered anywhere, where the direction it came from says nothing: the
    /// footprint stays and opens by `spread`.
    #[inline]
    #[must_use]
    pub fn scatter(&self, direction: Vec3, spread: f32) -> Self {
        Self { direction_dx: Vec3::ZERO, direction_dy: Vec3::ZERO, ..*self }
            .widen(direction, spread)
    }
}

/// The footprint of an eye ray by two more rays, those through the pixels to the right and below: how
/// far from `position` they meet the plane that the first ray met (chapter 26.6).
#[inline]
pub fn offsets_on_plane(position: Vec3, normal: Vec3, right: &Ray, below: &Ray) -> [Vec3; 2] {
    [right, below].map(|ray| onto_plane(ray.origin - position, ray.direction, normal))
}

/// The change of the unit vector along `v` where `v` changes by `change`.
#[inline]
pub fn of_normalized(v: Vec3, change: Vec3) -> Vec3 {
    let squared = v.length_squared();
    let moved = (change - v * (v.dot(change) / squared)) / squared.sqrt();
    if moved.is_finite() { moved } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec2};

    use super::*;
    use crate::hash::Rng;

    /// A step of a tenth of a pixel, in `f64`.
    const STEP: f64 = 1e-4;

    /// What is differentiated: origin and direction at a point of the screen.
    type Path = dyn Fn(f64, f64) -> (DVec3, DVec3);

    /// Central differences.
    fn finite(path: &Path) -> [DVec3; 4] {
        let (right, left) = (path(STEP, 0.0), path(-STEP, 0.0));
        let (below, above) = (path(0.0, STEP), path(0.0, -STEP));
        [right.0 - left.0, below.0 - above.0, right.1 - left.1, below.1 - above.1]
            .map(|d| d / (2.0 * STEP))
    }

    fn check(ours: &RayDifferential, path: &Path, tolerance: f64) {
        let ours = [ours.origin_dx, ours.origin_dy, ours.direction_dx, ours.direction_dy];
        for (i, (ours, exact)) in ours.iter().zip(finite(path)).enumerate() {
            let error = (ours.as_dvec3() - exact).length() / (0.01 + exact.length());
            assert!(error < tolerance, "derivative {i}: {ours} instead of {exact}");
        }
    }

    /// A random ray towards the origin that varies with the screen, as its value and derivatives.
    fn random(rng: &mut Rng) -> (Ray, RayDifferential, [DVec3; 6]) {
        let origin = 4.0 * (rng.vec3() - 0.5) + Vec3::Y * 4.0;
        let direction = (0.5 * (rng.vec3() - 0.5) - origin).normalize();
        let mut small = || 0.1 * (rng.vec3() - 0.5);
        let [a, b] = [small(), small()];
        let [c, d] = [small(), small()].map(|v| v - direction * v.dot(direction));
        let differential =
            RayDifferential { origin_dx: a, origin_dy: b, direction_dx: c, direction_dy: d };
        (
            Ray::new(origin, direction),
            differential,
            [origin, direction, a, b, c, d].map(|v| v.as_dvec3()),
        )
    }

    fn ray_at(v: [DVec3; 6], x: f64, y: f64) -> (DVec3, DVec3) {
        (v[0] + x * v[2] + y * v[3], (v[1] + x * v[4] + y * v[5]).normalize())
    }

    #[test]
    fn transfer_follows_the_plane() {
        let mut rng = Rng::new(1);
        for _ in 0..500 {
            let (ray, differential, values) = random(&mut rng);
            let normal = (Vec3::Y + rng.vec3() - 0.5).normalize();
            let exact = normal.as_dvec3();
            if ray.direction.dot(normal).abs() < 0.2 {
                continue;
            }
            let path = move |x: f64, y: f64| {
                let (origin, direction) = ray_at(values, x, y);
                let t = -origin.dot(exact) / direction.dot(exact);
                (origin + t * direction, direction)
            };
            let t = -ray.origin.dot(normal) / ray.direction.dot(normal);
            check(&differential.transfer(ray.direction, t, normal), &path, 1e-3);
        }
    }

    /// Where a ray meets the unit sphere from outside.
    fn on_sphere((origin, direction): (DVec3, DVec3)) -> Option<DVec3> {
        let b = origin.dot(direction);
        let d = b * b - origin.length_squared() + 1.0;
        (d > 0.05).then(|| origin - direction * (b + d.sqrt()))
    }

    #[test]
    fn mirrors_and_glass_of_spheres_turn_differentials() {
        let mut rng = Rng::new(2);
        let mut tested = 0;
        for _ in 0..500 {
            let (ray, differential, values) = random(&mut rng);
            let Some(point) = on_sphere(ray_at(values, 0.0, 0.0)) else { continue };
            let normal = point.as_vec3();
            let t = (point - values[0]).length() as f32;
            let at_hit = differential.transfer(ray.direction, t, normal);
            // On the unit sphere the normal is the point.
            let bend = [at_hit.origin_dx, at_hit.origin_dy];
            let mirror = move |x: f64, y: f64| {
                let (origin, direction) = ray_at(values, x, y);
                let n = on_sphere((origin, direction)).unwrap();
                (n, direction - 2.0 * direction.dot(n) * n)
            };
            check(&at_hit.reflect(ray.direction, normal, bend), &mirror, 2e-3);
            let eta = 1.0 / 1.5;
            let glass = move |x: f64, y: f64| {
                let (origin, direction) = ray_at(values, x, y);
                let n = on_sphere((origin, direction)).unwrap();
                let cosine = direction.dot(n);
                let transmitted = (1.0 - eta * eta * (1.0 - cosine * cosine)).sqrt();
                (n, eta * direction - (eta * cosine + transmitted) * n)
            };
            check(&at_hit.refract(ray.direction, normal, bend, eta as f32), &glass, 2e-3);
            tested += 1;
        }
        assert!(tested > 200);
    }

    #[test]
    fn offset_rays_agree_with_the_differential() {
        let eye = Vec3::new(0.0, 2.0, 0.0);
        let towards = |x: f32, y: f32| {
            Ray::new(eye, (Vec3::new(0.3, -1.0, 0.4) + Vec3::new(x, 0.0, y)).normalize())
        };
        let (ray, pixel) = (towards(0.0, 0.0), 1e-3);
        let [right, below] = [towards(pixel, 0.0), towards(0.0, pixel)];
        let t = eye.y / -ray.direction.y;
        let by_rays = offsets_on_plane(ray.at(t), Vec3::Y, &right, &below);
        let differential = RayDifferential::between(&ray, &right, &below);
        let at_hit = differential.transfer(ray.direction, t, Vec3::Y);
        for (a, b) in by_rays.iter().zip([at_hit.origin_dx, at_hit.origin_dy]) {
            assert!((*a - b).length() < 5e-3 * b.length(), "{a} {b}");
            assert!(a.y.abs() < 1e-6);
        }
        // One pixel is 1e-3 at distance 1 along y: exactly 2e-3 on the plane.
        assert!((by_rays[0] - Vec3::new(2e-3, 0.0, 0.0)).length() < 1e-5);
    }

    #[test]
    fn rough_lobes_open_in_both_directions() {
        let mut rng = Rng::new(9);
        for _ in 0..200 {
            let (ray, mut differential, _) = random(&mut rng);
            if rng.f32() < 0.5 {
                // Along one line.
                differential.direction_dy = 2.0 * differential.direction_dx;
            }
            for wide in [
                differential.widen(ray.direction, 0.25),
                differential.scatter(ray.direction, 0.25),
                RayDifferential::default().widen(ray.direction, 0.25),
            ] {
                let area = wide.direction_dx.cross(wide.direction_dy).length();
                assert!(area > 0.9 * 0.25 * 0.25, "{area}");
            }
        }
    }

    #[test]
    fn normalising_has_its_derivative() {
        let v = Vec3::new(1.0, -2.0, 0.5);
        let change = Vec3::new(0.3, 0.1, -0.7);
        let step = 1e-3;
        let finite =
            ((v + step * change).normalize() - (v - step * change).normalize()) / (2.0 * step);
        assert!((of_normalized(v, change) - finite).length() < 1e-3);
        assert_eq!(of_normalized(Vec3::ZERO, change), Vec3::ZERO);
    }

    #[test]
    fn broken_input_gives_zeros_or_finite_numbers() {
        let some = RayDifferential { origin_dx: Vec3::X, ..RayDifferential::default() };
        let grazing = some.transfer(Vec3::X, 2.0, Vec3::Y);
        assert!(grazing.origin_dx.is_finite());
        let broken = some.transfer(Vec3::NAN, f32::NAN, Vec3::NAN);
        assert_eq!(broken.origin_dx, Vec3::ZERO);
        let total = some.refract(Vec3::new(0.8, -0.6, 0.0), Vec3::Y, [Vec3::ZERO; 2], 1.5);
        assert_eq!(total.direction_dx, Vec3::ZERO);
        let none = Vec2::ZERO.extend(0.0);
        assert!(some.widen(none, 1.0).direction_dx.is_finite());
    }
}
