//! The eye rays of a picture without a lens, one a pixel.

use rayburst_math::{
    Ray,
    glam::{Vec2, Vec3},
};
use rayburst_raster::{self as raster, View};
use rayburst_scene::{Camera, Projection};

/// A camera and a picture, with what all rays have in common computed once. Rays have the bits of
/// [`Camera::ray`] without an aperture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EyeRays {
    eye: Vec3,
    frame: [Vec3; 3],
    half: Vec2,
    size: (u32, u32),
    extent: Vec2,
    jitter: Vec2,
    parallel: bool,
}

impl EyeRays {
    pub(crate) fn new(camera: &Camera, size: (u32, u32), jitter: Vec2) -> Self {
        let (half_height, parallel) = match camera.projection {
            Projection::Perspective { fov } => ((0.5 * fov).tan(), false),
            Projection::Orthographic { half_height } => (half_height, true),
        };
        Self {
            eye: camera.eye(),
            frame: camera.frame(),
            half: Vec2::new(half_height * size.0 as f32 / size.1.max(1) as f32, half_height),
            size,
            extent: Vec2::new(size.0 as f32, size.1 as f32),
            jitter,
            parallel,
        }
    }

    /// The ray through the centre of a pixel, jitter added; its direction is a unit vector.
    #[inline(always)]
    pub(crate) fn ray(&self, x: u32, y: u32) -> Ray {
        let [r, u, v] = self.frame;
        let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + self.jitter;
        let p = (2.0 * pixel / self.extent - Vec2::ONE) * self.half;
        if self.parallel {
            return Ray::new(self.eye + p.x * r - p.y * u, v);
        }
        let s = p.x * r - p.y * u + v;
        Ray::new(self.eye, s * (1.0 / s.dot(s).sqrt()))
    }

    /// The directions of the rays through `N` pixels side by side, `[axis][lane]`.
    #[inline(always)]
    pub(crate) fn directions<const N: usize>(&self, x: u32, y: u32) -> [[f32; N]; 3] {
        let [r, u, v] = self.frame;
        let mut directions = [[v.x; N], [v.y; N], [v.z; N]];
        if self.parallel {
            return directions;
        }
        let py = (2.0 * (y as f32 + 0.5 + self.jitter.y) / self.extent.y - 1.0) * self.half.y;
        let up = py * u;
        for lane in 0..N {
            let px = (x + lane as u32) as f32 + 0.5 + self.jitter.x;
            let px = (2.0 * px / self.extent.x - 1.0) * self.half.x;
            let (sx, sy, sz) =
                (px * r.x - up.x + v.x, px * r.y - up.y + v.y, px * r.z - up.z + v.z);
            let scale = 1.0 / ((sx * sx + sy * sy) + sz * sz).sqrt();
            directions[0][lane] = sx * scale;
            directions[1][lane] = sy * scale;
            directions[2][lane] = sz * scale;
        }
        directions
    }

    /// Where the ray of a pixel begins.
    #[inline(always)]
    pub(crate) fn origin(&self, x: u32, y: u32) -> Vec3 {
        if self.parallel { self.ray(x, y).origin } else { self.eye }
    }

    /// The same for the rasteriser.
    pub(crate) fn view(&self) -> View {
        let half = self.half;
        let projection = if self.parallel {
            raster::Projection::Orthographic { half }
        } else {
            raster::Projection::Perspective { half }
        };
        let (eye, frame, jitter) = (self.eye, self.frame, self.jitter);
        View { eye, frame, projection, size: self.size, jitter }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_those_of_the_camera() {
        let size = (37, 21);
        let camera =
            Camera::look_at(Vec3::new(0.3, -2.0, 5.0), Vec3::new(1.0, 0.7, -3.0), Vec3::Y, 1.1);
        let projection = Projection::Orthographic { half_height: 2.5 };
        for camera in [camera, Camera { projection, ..camera }] {
            for jitter in [Vec2::ZERO, Vec2::new(-0.37, 0.21)] {
                let rays = EyeRays::new(&camera, size, jitter);
                for y in 0..size.1 {
                    for x in 0..size.0 {
                        let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + jitter;
                        let ray = camera.ray(pixel, size, Vec2::ZERO).0;
                        assert_eq!(rays.ray(x, y), ray);
                        assert_eq!(rays.origin(x, y), ray.origin);
                        let directions = rays.directions::<2>(x, y);
                        assert_eq!(Vec3::from(directions.map(|axis| axis[0])), ray.direction);
                    }
                }
            }
        }
    }
}
