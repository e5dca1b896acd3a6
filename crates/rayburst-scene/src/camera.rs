//! Cameras: Eq. 26.2 of the chapter, with a thin lens or an orthographic projection.
//!
//! For a picture of w×h pixels, vertical field of view φ, f = tan(φ/2) and aspect ratio a = w/h, the
//! ray through the point (x, y) of the picture has the direction d = s/‖s‖ with
//!
//! s(x, y) = a f (2x/w − 1) **r** − f (2y/h − 1) **u** + **v**
//!
//! Pixel (0, 0) is in the top left corner, which is why **u** has a minus sign; pixel centres are at
//! +0.5. The frame {**r**, **u**, **v**} (right, up, into the scene) is left-handed. The thin lens is
//! that of Cook, Porter, Carpenter: "Distributed Ray Tracing", SIGGRAPH 1984.

use glam::{Affine3A, Mat3A, Vec2, Vec3};
use rayburst_math::{Ray, RayCone, RayDifferential, differential::of_normalized, warp};

/// How directions map to pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A pinhole or a thin lens; vertical field of view in radians.
    Perspective {
        /// Full vertical angle, radians, in (0, π).
        fov: f32,
    },
    /// Parallel rays.
    Orthographic {
        /// Half the height of the view, world units. The width follows the picture's aspect ratio.
        half_height: f32,
    },
}

/// A camera in world space. It looks along −z of its transform with +y up (glTF's convention).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Camera to world; rigid.
    pub transform: Affine3A,
    /// Projection.
    pub projection: Projection,
    /// Diameter of the lens in world units; 0 is a pinhole.
    pub aperture: f32,
    /// Distance from the lens to the plane in focus along the viewing direction, world units.
    pub focus: f32,
}

impl Camera {
    /// A pinhole camera at `eye` that looks at `target`; `fov` is the full vertical angle in radians.
    ///
    /// Where `up` is parallel to the view, another axis takes its place; `target` equal to `eye`
    /// looks along −z. The plane in focus goes through `target`.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, fov: f32) -> Self {
        let v = (target - eye).normalize_or(-Vec3::Z);
        let r = v
            .cross(up)
            .try_normalize()
            .or_else(|| v.cross(-Vec3::Z).try_normalize())
            .unwrap_or(Vec3::X);
        let u = r.cross(v);
        let distance = eye.distance(target);
        Self {
            transform: Affine3A {
                matrix3: Mat3A::from_cols(r.into(), u.into(), (-v).into()),
                translation: eye.into(),
            },
            projection: Projection::Perspective { fov },
            aperture: 0.0,
            focus: if distance > 0.0 { distance } else { 1.0 },
        }
    }

    /// Where the camera is.
    #[inline]
    pub fn eye(&self) -> Vec3 {
        self.transform.translation.into()
    }

    /// The frame {**r**, **u**, **v**}: right, up, into the scene.
    #[inline]
    pub fn frame(&self) -> [Vec3; 3] {
        let m = &self.transform.matrix3;
        [m.x_axis.into(), m.y_axis.into(), (-m.z_axis).into()]
    }

    /// Half the size of the picture at distance 1 (perspective) or in the world (orthographic).
    #[inline]
    fn half_extent(&self, size: (u32, u32)) -> Vec2 {
        let half_height = match self.projection {
            Projection::Perspective { fov } => (0.5 * fov).tan(),
            Projection::Orthographic { half_height } => half_height,
        };
        Vec2::new(half_height * size.0 as f32 / size.1.max(1) as f32, half_height)
    }

    /// The ray through a point of the picture, its direction a unit vector, and its footprint.
    ///
    /// `pixel` is in pixels from the top left corner, centres at +0.5. `lens` in [0, 1)² picks the
    /// point of the lens; a pinhole ignores it.
    #[inline]
    pub fn ray(&self, pixel: Vec2, size: (u32, u32), lens: Vec2) -> (Ray, RayCone) {
        let [r, u, v] = self.frame();
        let ndc = 2.0 * pixel / Vec2::new(size.0 as f32, size.1 as f32) - Vec2::ONE;
        let p = ndc * self.half_extent(size);
        match self.projection {
            Projection::Orthographic { half_height } => {
                let cone = RayCone { width: 2.0 * half_height / size.1.max(1) as f32, spread: 0.0 };
                (Ray::new(self.eye() + p.x * r - p.y * u, v), cone)
            }
            Projection::Perspective { fov } => {
                let s = p.x * r - p.y * u + v;
                let direction = s.normalize();
                let cone = RayCone::of_pixel(fov, size.1).off_axis(direction.dot(v));
                let Some(offset) = self.lens_offset(lens) else {
                    return (Ray::new(self.eye(), direction), cone);
                };
                let direction = (self.focus * s - offset).normalize();
                (Ray::new(self.eye() + offset, direction), cone)
            }
        }
    }

    /// How the ray of [`Camera::ray`] changes from pixel to pixel.
    pub fn ray_differential(&self, pixel: Vec2, size: (u32, u32), lens: Vec2) -> RayDifferential {
        let [r, u, v] = self.frame();
        let half = self.half_extent(size);
        let step = 2.0 * half / Vec2::new(size.0 as f32, size.1 as f32);
        let (dx, dy) = (step.x * r, -step.y * u);
        if let Projection::Orthographic { .. } = self.projection {
            return RayDifferential { origin_dx: dx, origin_dy: dy, ..RayDifferential::default() };
        }
        let p = step * pixel - half;
        let s = p.x * r - p.y * u + v;
        let (towards, scale) = match self.lens_offset(lens) {
            None => (s, 1.0),
            Some(offset) => (self.focus * s - offset, self.focus),
        };
        RayDifferential {
            direction_dx: of_normalized(towards, scale * dx),
            direction_dy: of_normalized(towards, scale * dy),
            ..RayDifferential::default()
        }
    }

    /// Where a ray leaves the lens, from its middle; `None` for a pinhole.
    #[inline]
    fn lens_offset(&self, lens: Vec2) -> Option<Vec3> {
        if self.aperture <= 0.0 || self.focus <= 0.0 {
            return None;
        }
        let [r, u, _] = self.frame();
        let disk = 0.5 * self.aperture * warp::concentric_disk(lens);
        Some(disk.x * r + disk.y * u)
    }

    /// Where the picture shows a point of the world, in pixels, and the point's depth along **v**;
    /// `None` behind a perspective camera. With a lens, the centre of the blur.
    pub fn project(&self, world: Vec3, size: (u32, u32)) -> Option<(Vec2, f32)> {
        let [r, u, v] = self.frame();
        let to = world - self.eye();
        let depth = to.dot(v);
        let scale = match self.projection {
            Projection::Perspective { .. } if depth <= 0.0 => return None,
            Projection::Perspective { .. } => depth,
            Projection::Orthographic { .. } => 1.0,
        };
        let p = Vec2::new(to.dot(r), -to.dot(u)) / (scale * self.half_extent(size));
        Some((0.5 * (p + Vec2::ONE) * Vec2::new(size.0 as f32, size.1 as f32), depth))
    }

    /// Diameter in pixels of the blur of a point at `depth` (the circle of confusion).
    pub fn circle_of_confusion(&self, depth: f32, size: (u32, u32)) -> f32 {
        match self.projection {
            Projection::Perspective { .. } if self.focus > 0.0 => {
                let pixels_per_unit = 0.5 * size.1 as f32 / (self.half_extent(size).y * self.focus);
                self.aperture * ((depth - self.focus) / depth).abs() * pixels_per_unit
            }
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use rayburst_math::hash::Rng;

    use super::*;

    const SIZE: (u32, u32) = (640, 360);

    fn camera() -> Camera {
        Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-4.0, 0.5, -2.0), Vec3::Y, 0.9)
    }

    #[test]
    fn the_centre_looks_along_v_and_the_first_pixel_is_up_and_left() {
        let camera = camera();
        let [r, u, v] = camera.frame();
        assert!((r.cross(u) + v).length() < 1e-6, "right-handed {{r, u, −v}}");
        let (centre, _) = camera.ray(Vec2::new(320.0, 180.0), SIZE, Vec2::ZERO);
        assert!((centre.direction - v).length() < 1e-6);
        let (first, _) = camera.ray(Vec2::splat(0.5), SIZE, Vec2::ZERO);
        assert!(first.direction.dot(u) > 0.0 && first.direction.dot(r) < 0.0);
        assert!((first.direction.length() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn differentials_and_cones_are_those_of_neighbouring_pixels() {
        let perspective = camera();
        let parallel =
            Camera { projection: Projection::Orthographic { half_height: 2.5 }, ..perspective };
        let thin_lens = Camera { aperture: 0.3, focus: 4.0, ..perspective };
        let mut rng = Rng::new(13);
        for camera in [perspective, parallel, thin_lens] {
            for _ in 0..500 {
                let pixel = rng.vec2() * Vec2::new(640.0, 360.0);
                let lens = rng.vec2();
                let ours = camera.ray_differential(pixel, SIZE, lens);
                let ray = |x: f32, y: f32| camera.ray(pixel + Vec2::new(x, y), SIZE, lens).0;
                let [right, left] = [ray(0.5, 0.0), ray(-0.5, 0.0)];
                let [below, above] = [ray(0.0, 0.5), ray(0.0, -0.5)];
                for (ours, finite) in [
                    (ours.origin_dx, right.origin - left.origin),
                    (ours.origin_dy, below.origin - above.origin),
                    (ours.direction_dx, right.direction - left.direction),
                    (ours.direction_dy, below.direction - above.direction),
                ] {
                    let error = (ours - finite).length();
                    assert!(error < 2e-6 + 1e-3 * finite.length(), "{ours} {finite}");
                }
                // The cone has the pixel's solid angle, or its area.
                let (_, cone) = camera.ray(pixel, SIZE, lens);
                if camera.aperture == 0.0 {
                    let angle = ours.direction_dx.cross(ours.direction_dy).length().sqrt();
                    assert!((cone.spread - angle).abs() < 1e-2 * angle.max(1e-6), "{cone:?}");
                    let width = ours.origin_dx.cross(ours.origin_dy).length().sqrt();
                    assert!((cone.width - width).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn corners_follow_the_field_of_view_and_the_aspect_ratio() {
        let camera = camera();
        let [r, u, v] = camera.frame();
        let f = (0.45f32).tan();
        let a = 640.0 / 360.0;
        for (x, y) in [(0.0, 0.0), (640.0, 0.0), (0.0, 360.0), (640.0, 360.0)] {
            let (ray, _) = camera.ray(Vec2::new(x, y), SIZE, Vec2::ZERO);
            let d = ray.direction / ray.direction.dot(v);
            let sign = |p: f32| if p > 0.0 { 1.0 } else { -1.0 };
            assert!((d.dot(r) - a * f * sign(x)).abs() < 1e-5);
            assert!((d.dot(u) + f * sign(y)).abs() < 1e-5);
        }
    }

    #[test]
    fn projecting_undoes_ray_generation() {
        let mut rng = Rng::new(3);
        let perspective = camera();
        let parallel =
            Camera { projection: Projection::Orthographic { half_height: 2.5 }, ..perspective };
        for camera in [perspective, parallel] {
            for _ in 0..1000 {
                let pixel = rng.vec2() * Vec2::new(640.0, 360.0);
                let (ray, _) = camera.ray(pixel, SIZE, Vec2::splat(0.5));
                let t = rng.range(0.1, 50.0);
                let (back, depth) = camera.project(ray.at(t), SIZE).unwrap();
                assert!((back - pixel).length() < 2e-2, "{back} {pixel}");
                let expected = t * ray.direction.dot(camera.frame()[2]);
                assert!((depth - expected).abs() < 1e-4 * t.max(1.0));
            }
        }
        assert!(perspective.project(perspective.eye() - perspective.frame()[2], SIZE).is_none());
    }

    #[test]
    fn lens_rays_meet_in_the_plane_of_focus_and_blur_by_the_formula_elsewhere() {
        let camera = Camera { aperture: 0.2, focus: 4.0, ..camera() };
        let mut rng = Rng::new(8);
        let pinhole = Camera { aperture: 0.0, ..camera };
        let pixel = Vec2::new(500.25, 40.5);
        let [_, _, v] = camera.frame();
        let (axis, _) = pinhole.ray(pixel, SIZE, Vec2::ZERO);
        for depth in [1.0f32, 2.0, 4.0, 9.0] {
            let point = axis.at(depth / axis.direction.dot(v));
            let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
            for _ in 0..2000 {
                // The pixel that sees `point` through this point of the lens: where the line from
                // the lens through the point meets the plane of focus.
                let lens = rng.vec2();
                let disk = 0.1 * warp::concentric_disk(lens);
                let [r, u, _] = camera.frame();
                let from = camera.eye() + disk.x * r + disk.y * u;
                let focused = from + (point - from) * (camera.focus / depth);
                let (seen, _) = pinhole.project(focused, SIZE).unwrap();
                let (ray, _) = camera.ray(seen, SIZE, lens);
                let along = (point - ray.origin).length();
                assert!((ray.at(along) - point).length() < 2e-3, "rays miss the point");
                low = low.min(seen);
                high = high.max(seen);
            }
            let expected = camera.circle_of_confusion(depth, SIZE);
            let blur = high - low;
            assert!((blur - Vec2::splat(expected)).abs().max_element() < 0.02 * expected + 0.05);
        }
        assert_eq!(camera.circle_of_confusion(4.0, SIZE), 0.0);
    }

    #[test]
    fn lens_points_are_uniform_over_the_lens() {
        let camera = Camera { aperture: 2.0, focus: 4.0, ..camera() };
        let [r, u, _] = camera.frame();
        let mut rng = Rng::new(21);
        const N: u64 = 200_000;
        let mut bins = vec![0u64; 8 * 16];
        for _ in 0..N {
            let (ray, _) = camera.ray(Vec2::new(10.0, 20.0), SIZE, rng.vec2());
            let p =
                Vec2::new((ray.origin - camera.eye()).dot(r), (ray.origin - camera.eye()).dot(u));
            // Equal areas: r² and the angle are uniform.
            let ring = ((p.length_squared() * 8.0) as usize).min(7);
            let turn = p.y.atan2(p.x) / std::f32::consts::TAU + 0.5;
            bins[ring * 16 + ((turn * 16.0) as usize).min(15)] += 1;
        }
        let expected = vec![N as f64 / 128.0; 128];
        let test = rayburst_testkit::statistics::chi_square(&bins, &expected);
        assert!(test.passes(), "{test:?}");
    }
}
