//! What a frame's camera sees: rays of pixels, pixels of points.

use rayburst_math::{
    Ray, RayCone,
    glam::{Vec2, Vec3},
    lanes::{F32x16, LANES, Mask16, Vec2x16, Vec3x16},
};
use rayburst_raster as raster;
use rayburst_scene::{Camera, Projection, TextureLod};

use crate::RayFootprint;

/// A camera at one frame: with the size it is rendered at, and where in the pixels rays go through.
///
/// Frames see through a pinhole: a lens would smear what passes say of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameView {
    camera: Camera,
    size: (u32, u32),
    jitter: Vec2,
    /// What all rays have in common.
    frame: [Vec3; 3],
    half: Vec2,
    extent: Vec2,
    cone: RayCone,
}

impl FrameView {
    /// A view of `size` pixels; `jitter` in pixels moves the points that rays go through off the
    /// pixels' centres.
    pub fn new(camera: Camera, size: (u32, u32), jitter: Vec2) -> Self {
        let camera = Camera { aperture: 0.0, ..camera };
        let extent = Vec2::new(size.0 as f32, size.1 as f32);
        let half_height = match camera.projection {
            Projection::Perspective { fov } => (0.5 * fov).tan(),
            Projection::Orthographic { half_height } => half_height,
        };
        let half = Vec2::new(half_height * size.0 as f32 / size.1.max(1) as f32, half_height);
        let (_, cone) = camera.ray(0.5 * extent, size, Vec2::ZERO);
        Self { camera, size, jitter, frame: camera.frame(), half, extent, cone }
    }

    /// The camera, without a lens.
    #[inline]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Width and height in pixels.
    #[inline]
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Where rays go through, relative to the pixels' centres, in pixels.
    #[inline]
    pub fn jitter(&self) -> Vec2 {
        self.jitter
    }

    /// Half the size of the picture at distance 1 (perspective) or in the world (orthographic).
    #[inline]
    pub(crate) fn half_extent(&self) -> Vec2 {
        self.half
    }

    /// Width and height in pixels, as numbers to calculate with.
    #[inline]
    pub(crate) fn extent(&self) -> Vec2 {
        self.extent
    }

    /// The cone of a pixel's ray, whose direction is given.
    #[inline]
    pub fn cone(&self, direction: Vec3) -> RayCone {
        match self.camera.projection {
            Projection::Perspective { .. } => self.cone.off_axis(direction.dot(self.frame[2])),
            Projection::Orthographic { .. } => self.cone,
        }
    }

    /// What a pixel sees at the eye.
    #[inline]
    pub fn footprint(&self, lod: TextureLod, (x, y): (u32, u32)) -> RayFootprint {
        let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + self.jitter;
        let cone = match lod {
            TextureLod::Cones => self.cone(self.ray(x, y).direction),
            _ => self.cone,
        };
        RayFootprint::of_eye(lod, &self.camera, at, self.size, Vec2::ZERO, cone)
    }

    /// The ray through a pixel, its direction a unit vector: with the bits of [`Camera::ray`].
    #[inline(always)]
    pub fn ray(&self, x: u32, y: u32) -> Ray {
        let [r, u, v] = self.frame;
        let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + self.jitter;
        let p = (2.0 * pixel / self.extent - Vec2::ONE) * self.half;
        match self.camera.projection {
            Projection::Perspective { .. } => {
                let s = p.x * r - p.y * u + v;
                Ray::new(self.camera.eye(), s * (1.0 / s.dot(s).sqrt()))
            }
            Projection::Orthographic { .. } => Ray::new(self.camera.eye() + p.x * r - p.y * u, v),
        }
    }

    /// The directions of the rays through `N` pixels side by side, `[axis][lane]`.
    #[inline(always)]
    pub(crate) fn directions<const N: usize>(&self, x: u32, y: u32) -> [[f32; N]; 3] {
        let [r, u, v] = self.frame;
        let mut directions = [[v.x; N], [v.y; N], [v.z; N]];
        if let Projection::Orthographic { .. } = self.camera.projection {
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

    /// The directions of the rays through sixteen pixels, by columns and rows; with the bits of
    /// [`FrameView::ray`].
    #[inline(always)]
    pub(crate) fn directions_at(&self, x: &[u32; LANES], y: &[u32; LANES]) -> Vec3x16 {
        let [r, u, v] = self.frame;
        if let Projection::Orthographic { .. } = self.camera.projection {
            return Vec3x16::splat(v);
        }
        let (mut px, mut py) = (F32x16::ZERO, F32x16::ZERO);
        for i in 0..LANES {
            px.0[i] = x[i] as i32 as f32;
            py.0[i] = y[i] as i32 as f32;
        }
        let of = |p: F32x16, jitter: f32, extent: f32, half: f32| {
            (2.0 * ((p + 0.5) + jitter) / F32x16::splat(extent) - 1.0) * half
        };
        let px = of(px, self.jitter.x, self.extent.x, self.half.x);
        let py = of(py, self.jitter.y, self.extent.y, self.half.y);
        let across = Vec3x16::splat(r) * px;
        let s = (across - Vec3x16::splat(u) * py) + Vec3x16::splat(v);
        s * (1.0 / s.length())
    }

    /// Whether all rays begin at the eye.
    #[inline(always)]
    pub(crate) fn is_perspective(&self) -> bool {
        matches!(self.camera.projection, Projection::Perspective { .. })
    }

    /// Where the ray of a pixel begins.
    #[inline(always)]
    pub(crate) fn origin(&self, x: u32, y: u32) -> Vec3 {
        match self.camera.projection {
            Projection::Perspective { .. } => self.camera.eye(),
            Projection::Orthographic { .. } => self.ray(x, y).origin,
        }
    }

    /// The same view for the rasteriser.
    pub(crate) fn to_raster(self) -> raster::View {
        let half = self.half;
        let projection = match self.camera.projection {
            Projection::Perspective { .. } => raster::Projection::Perspective { half },
            Projection::Orthographic { .. } => raster::Projection::Orthographic { half },
        };
        let Self { frame, size, jitter, .. } = self;
        raster::View { eye: self.camera.eye(), frame, projection, size, jitter }
    }

    /// Distance of a point along the viewing direction.
    #[inline]
    pub fn depth(&self, world: Vec3) -> f32 {
        (world - self.camera.eye()).dot(self.frame[2])
    }

    /// [`FrameView::depth`] of sixteen points.
    #[inline(always)]
    pub(crate) fn depth16(&self, world: Vec3x16) -> F32x16 {
        (world - Vec3x16::splat(self.camera.eye())).dot(Vec3x16::splat(self.frame[2]))
    }

    /// Where the picture shows a point, in pixels, without the jitter; `None` behind the eye.
    #[inline]
    pub fn project(&self, world: Vec3) -> Option<Vec2> {
        self.camera.project(world, self.size).map(|(pixel, _)| pixel)
    }

    /// [`FrameView::project`] of sixteen points, how deep they are along the viewing direction, and which
    /// are not behind the eye.
    #[inline(always)]
    pub(crate) fn project16(&self, world: Vec3x16) -> (Vec2x16, F32x16, Mask16) {
        let [r, u, v] = self.frame;
        let to = world - Vec3x16::splat(self.camera.eye());
        let depth = to.dot(Vec3x16::splat(v));
        let (scale, seen) = match self.camera.projection {
            Projection::Perspective { .. } => (depth, depth.is_greater(F32x16::ZERO)),
            Projection::Orthographic { .. } => (F32x16::ONE, Mask16::ALL),
        };
        let right = to.dot(Vec3x16::splat(r)) / (scale * self.half.x);
        let down = -to.dot(Vec3x16::splat(u)) / (scale * self.half.y);
        let pixel = Vec2x16 {
            x: 0.5 * (right + 1.0) * self.extent.x,
            y: 0.5 * (down + 1.0) * self.extent.y,
        };
        (pixel, depth, seen)
    }

    /// The diameters of the cones of pixels' rays at the distances `t`; see [`FrameView::cone`].
    #[inline(always)]
    pub(crate) fn cone_width16(&self, directions: Vec3x16, t: F32x16) -> F32x16 {
        let mut spread = F32x16::splat(self.cone.spread);
        if let Projection::Perspective { .. } = self.camera.projection {
            let cosine = directions.dot(Vec3x16::splat(self.frame[2]));
            spread = spread * cosine * cosine.sqrt();
        }
        (spread * t + self.cone.width).abs()
    }
}

#[cfg(test)]
mod tests {
    use rayburst_math::glam::Affine3A;

    use super::*;

    #[test]
    fn rays_are_the_cameras_and_points_come_back() {
        let eye = Vec3::new(3.0, 2.0, -1.0);
        let perspective = Camera::look_at(eye, Vec3::new(-1.0, 0.5, 2.0), Vec3::Y, 0.9);
        let orthographic = Camera {
            projection: Projection::Orthographic { half_height: 2.0 },
            transform: Affine3A::from_rotation_y(0.4) * perspective.transform,
            ..perspective
        };
        for camera in [perspective, orthographic] {
            for size in [(1, 1), (17, 5), (640, 360)] {
                let jitter = Vec2::new(0.2, -0.4);
                let view = FrameView::new(camera, size, jitter);
                for (x, y) in [(0, 0), (size.0 - 1, size.1 - 1), (size.0 / 2, size.1 / 3)] {
                    let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + jitter;
                    let (expected, cone) = camera.ray(pixel, size, Vec2::ZERO);
                    let ray = view.ray(x, y);
                    assert_eq!(ray, expected);
                    assert_eq!(view.origin(x, y), ray.origin);
                    let directions = view.directions::<2>(x, y);
                    assert_eq!(Vec3::from(directions.map(|axis| axis[0])), ray.direction);
                    let directions = view.directions_at(&[x; LANES], &[y; LANES]);
                    assert_eq!(directions.lane(5), ray.direction);
                    let ours = view.cone(ray.direction);
                    assert_eq!(ours.width, cone.width);
                    assert!((ours.spread - cone.spread).abs() <= 1e-5 * cone.spread);
                    let point = ray.at(4.0);
                    assert!((view.project(point).unwrap() - pixel).length() < 1e-3 * size.0 as f32);
                    assert!(view.depth(point) > 0.0);
                }
            }
        }
    }
}
